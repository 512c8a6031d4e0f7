"""The mechanics as UFL: each file is a page of formulas. Nothing here assembles or solves.

Notation (see docs/theory.md): a quaternion q = (q0, q) is the rotation of a node from its
reference; Γ and K are the material strains of the beam, N and M their section forces; γ is the
shear angle of a crossing. Warp and weft are the two families of tows.
"""
