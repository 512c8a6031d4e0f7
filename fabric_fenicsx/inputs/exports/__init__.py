"""Tables as testing machines and cameras export them: text, cells, numbers and units."""
