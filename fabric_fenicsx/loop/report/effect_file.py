"""A discovered term as a Python file: an effect that a diagnosis tries and a case takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ... import __version__
from ...mechanics.laws.shaped import OF_ELASTIC
from ...mechanics.laws.shapes import shape_of
from ..inference.effects import valued
from .discovered import Discovered

__all__ = ["effect_file"]

HEAD = '''"""{name}: {about}.

Found by fabric-fenicsx {version} in: {titles}.

    {formula}

Of which nobody knows more than was measured: beyond {reach:.4g} ({x}) it stays what it is there.
"""
'''

LAW = '''
from dataclasses import dataclass
from typing import Any

import fabric_fenicsx as ff

# Moments per area of fabric [N], angles in rad, times in s.
FOUND = ff.{law}(
{numbers}
)


@dataclass(frozen=True)
class {class_name}(ff.CrossingLaw):
    """{about}: {formula}."""

    amount: Any = ff.per_area("amount", "how much there is of it; 1 as it was found", float, 1.0)

    forms = (
        ff.Form(
            "{name}",
            "as found",
            ({{"amount": ff.Parameter("{name}_amount", amplitude=True)}},),
            meaning="{about}",{carried}
        ),
    )

    def moment(self, at: ff.Crossing) -> Any:
        """What was found, so many times."""
        return at.number(self.amount) * FOUND.moment(at)

    def history(self, at: ff.Crossing) -> dict[str, Any]:
        """What was found remembers."""
        return FOUND.history(at)
'''

OF_THE_RIG = """
from ufl import max_value, min_value

import fabric_fenicsx as ff

AMOUNT = ff.Parameter("{name}_amount", amplitude=True, meaning="1 as it was found")
{reaches}
SHAPE = {{
{numbers}
}}

{added}

FOUND = {found}
EFFECTS = [ff.Effect("{name}", "{test}", "{about}", (FOUND,), of_fabric=False)]
"""

ADDED = '''
def added(p, x):
    """What is added, {y}, at {x} = x."""
    share = max_value(min_value(x / REACH, 1), -1)
    return p["{name}_amount"] * ({constant!r} + ff.shape_of(x=share, **SHAPE))
'''

ADDED_BY_TWO = '''
def added(p, v, w):
    """What is added, {y}, at {x} = v and {also_x} = w."""
    x, other = (max_value(min_value(n / r, 1), -1) for n, r in ((v, REACH), (w, ALSO_REACH)))
    return p["{name}_amount"] * ff.product_of(x=x, w=other, **SHAPE)
'''

FOUND_OF_THE_RIG = 'ff.of_the_rig("as found", (AMOUNT,), "{acts_on}", "{variable}", added{options})'
FOUND_OF_THE_RUN = 'ff.of_the_run("as found", (AMOUNT,), "{base}", added{options})'

OF_A_STRIP = """
import fabric_fenicsx as ff

EFFECTS = [
    ff.strip_term(
        "{name}",
        term="{term}",
        form="{form}",
        ranges={ranges!r},
        values={values!r},
    )
]
"""


OF_EACH = {
    "cantilever": """
import fabric_fenicsx as ff

EFFECTS = [ff.own_term("{name}", form="{label}")]
""",
    "travel": """
import fabric_fenicsx as ff

EFFECTS = [ff.own_places("{name}")]
""",
    "reading": """
import fabric_fenicsx as ff

EFFECTS = [ff.own_gains("{name}")]
""",
    "moment": """
import fabric_fenicsx as ff

EFFECTS = [ff.own_moments("{name}", base="{base}")]
""",
}
"""What each run or specimen has of its own, of strips, or of frames by what it acts on."""


def effect_file(term: Discovered, titles: str) -> str:
    """The text of a term's file.

    Args:
        term: what was found.
        titles: of the measurements.
    """
    shape = term.shape
    words = {
        "name": term.name,
        "class_name": term.name.title().replace("_", ""),
        "about": term.effect.meaning,
        "test": term.effect.test,
        "version": __version__,
        "titles": " ".join(titles.split()).replace('"', "'"),
        "formula": term.formula,
        "reach": _plain(shape.reach),
        "x": shape.x,
        "y": shape.y,
        "acts_on": term.effect.acts_on,
    }
    if shape.points:
        strip = term.effect.test == "cantilever"
        text = HEAD + OF_EACH["cantilever" if strip else term.effect.acts_on]
        base = term.effect.name.partition("_")[0]
        return text.format(label=term.variant.label, base=base, **words)
    if term.effect.test == "cantilever":
        values = _plain({p.name: term.values[p.name] for p in term.variant.parameters})
        ranges = _plain(shape.fixed["ranges"])
        form = {"term": term.effect.name, "form": term.variant.label}
        return (HEAD + OF_A_STRIP).format(values=values, ranges=ranges, **form, **words)
    numbers = {name: valued(n, term.values) for name, n in shape.fixed.items()}
    if numbers.get("base") in OF_ELASTIC:
        numbers |= {"k1": term.values["k1_N"], "k3": term.values["k3_N"]}
    numbers = _plain(numbers)
    if "base" in numbers or "law" in numbers:
        words["law"] = "ShapedLaw"
        if "law" in numbers:
            words["law"] = numbers.pop("law").__name__
            del numbers["variable"]
        lines = "\n".join(f"    {name}={value!r}," for name, value in numbers.items())
        carried: str = getattr(term.variant, "carried", "")
        words["carried"] = f'\n            carried="{carried}",' if carried else ""
        return (HEAD + LAW).format(numbers=lines, **words)
    kept = ("memory", "turning", "slow", "way", "gain", "also", "stick_angle", "curve", "reach")
    more = "".join(f", {key}={numbers.pop(key)!r}" for key in kept if key in numbers)
    if "of" in numbers:
        words["found"] = FOUND_OF_THE_RUN.format(base=numbers.pop("of"), options=more)
    else:
        rig = {"variable": numbers.pop("variable"), "options": more, **words}
        words["found"] = FOUND_OF_THE_RIG.format(**rig)
    numbers["kind"] = numbers.pop("shape")
    if "powers" in numbers:
        also_reach = numbers.pop("also_reach")
        words["reaches"] = f"REACH, ALSO_REACH = {words['reach']!r}, {also_reach!r}"
        words["added"] = ADDED_BY_TWO.format(also_x=shape.also, **words)
    else:
        constant, reach = numbers.pop("constant", 0.0), words["reach"]
        if "last" in numbers:
            reach, words["x"] = numbers.pop("last"), shape.also
        if numbers.pop("from_the_top", False):
            constant = -float(shape_of(x=1.0, **numbers))
        words["reaches"] = f"REACH = {reach!r}"
        words["added"] = ADDED.format(constant=constant, **words)
    return (HEAD + OF_THE_RIG).format(numbers=_lines(numbers), **words)


def _plain(value: Any) -> Any:
    """Numbers as Python writes them: numpy's own, of version 2, say that they are numpy's."""
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, (tuple, list)):
        return tuple(_plain(one) for one in value)
    return value.item() if isinstance(value, np.generic) else value


def _lines(numbers: Mapping[str, Any]) -> str:
    """Entries of a dictionary, one to a line."""
    return "\n".join(f"    {name!r}: {value!r}," for name, value in numbers.items())
