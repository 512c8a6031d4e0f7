"""One page on a drape for those who drape: what is computed of it, its figures, its text."""
