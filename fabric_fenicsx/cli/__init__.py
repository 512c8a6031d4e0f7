"""The command line. Nothing here imports dolfinx before a run begins: help must come at once.

A further command is a function in a module of its own, registered in `app.py`; it does its heavy
imports inside, and what it does on several ranks inside `collective`.
"""

from ..parallel import from_root
from .app import app
from .collective import collective

__all__ = ["app", "collective", "from_root"]
