"""Networks of geometrically exact beams that predict how woven fabric drapes.

Units inside the package: N, mm, s, rad, MPa, tonne.
"""

__version__ = "0.1.0"
