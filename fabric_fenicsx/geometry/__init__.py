"""Shapes of tools from files: triangulated surfaces and their distance on a grid; no UFL here."""
