"""Synthetic measurements from closed forms and ordinary differential equations.

They are made without the package they test: nothing here imports it, so an error in its formulas
cannot cancel against the same error in the data.
"""
