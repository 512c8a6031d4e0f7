"""The loop with measurements: fit the model, find what it lacks, add that, report the error."""
