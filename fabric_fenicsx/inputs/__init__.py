"""Reading and checking what users write: keys with units, YAML, and one line for a mistake."""
