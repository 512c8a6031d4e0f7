"""The kinds of measurement: each folder has its keys, its model, its effects and made-up data.

``KINDS`` has them in the order in which one may need what was fitted to those before it.
"""

from ..measurement.kind import Kind
from .bias_extension import BIAS_EXTENSION
from .cantilever import CANTILEVER
from .drape import DRAPE
from .picture_frame import PICTURE_FRAME

__all__ = ["KINDS", "kind_of"]

KINDS = (PICTURE_FRAME, BIAS_EXTENSION, CANTILEVER, DRAPE)


def kind_of(test: str) -> Kind:
    """The kind of a name.

    Raises:
        KeyError: there is none.
    """
    return {kind.name: kind for kind in KINDS}[test]
