"""Networks of geometrically exact beams that predict how woven fabric drapes.

    import fabric_fenicsx as ff

    ff.run(ff.make_case("drape", punch_travel_mm=40.0), "results/mine")

What is public, and where it is, stands in ``__init__.pyi`` beside this file, for people, type
checkers and this module alike; a name is imported when it is first used, since dolfinx takes a
second. Units inside the package: N, mm, s, rad, MPa, tonne.
"""

import ast as _ast
from importlib import import_module as _import_module
from pathlib import Path as _Path
from typing import Any as _Any

__version__ = "0.1.0"

_PLACES = {
    alias.name: node.module
    for node in _ast.parse(_Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, _ast.ImportFrom)
    for alias in node.names
}

__all__ = [*_PLACES]


def __getattr__(name: str) -> _Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(_import_module(f".{_PLACES[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_PLACES])
