"""The kinds of measurement: each folder has its keys, its model, its effects and made-up data."""
