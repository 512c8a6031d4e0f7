"""The experiments: draping over a hemisphere, the picture frame, the cantilever."""
