"""Picture frames."""
