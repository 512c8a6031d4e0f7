"""What a fabric is: tows, crossings, sections and their meshes. Knows nothing of mechanics."""
