"""Draped sheets."""
