"""Expressions of UFL with memory, evaluated over records together with their derivatives."""
