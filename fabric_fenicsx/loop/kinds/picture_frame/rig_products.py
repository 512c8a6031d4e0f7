"""Terms without a formula of a crosshead's rig over two variables together.

Of w each has a few powers, of v a shape, see product_of:

    what is added to the reading or to the travel = Σ_p (w/w_max)^p (a_p + f_p(v/v_max))
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from ufl import max_value, min_value

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, Shape, Values
from .rig_terms import CYCLES, of_the_rig, rig_term
from .shapes import X, Y, fitted, moving, of_powers, over, product
from .variant import FrameVariant

__all__ = ["rig_products"]

Powers = tuple[tuple[int, ...], ...]

#: A line, and one that bends.
BENT: Powers = ((1,), (1, 2))
#: What is there at the first run too, or is not.
FROM_THE_FIRST: Powers = ((1,), (0, 1))

PRODUCTS: dict[str, dict[tuple[str, str], tuple[str, str, Powers]]] = {
    "reading": {
        ("displacement", "time"): ("displacement", "time", BENT),
        ("displacement", "run"): ("displacement", "run", BENT),
        ("displacement", "rate"): ("speed", "displacement", BENT),
        ("rate", "time"): ("speed", "time", ((1,),)),
        ("rate", "run"): ("speed", "run", ((1,),)),
        ("time", "run"): ("run", "time", FROM_THE_FIRST),
    },
    "travel": {
        ("displacement", "time"): ("displacement", "time", BENT),
        ("displacement", "run"): ("displacement", "run", BENT),
        ("displacement", "force"): ("force", "displacement", BENT),
        ("force", "time"): ("force", "time", BENT),
        ("force", "run"): ("force", "run", BENT),
        ("time", "run"): ("run", "time", FROM_THE_FIRST),
    },
}
"""What acts on the reading and the travel: names in a report; w, v and sets of powers of w."""


MOVING = {
    ("reading", "displacement", "time"): ("time", "displacement"),
    ("travel", "displacement", "time"): ("time", "displacement"),
    ("reading", "displacement", "rate"): ("speed", "displacement"),
}
"""Those whose shape over v moves with w, (w, v)."""


def rig_products(largest: Mapping[str, float]) -> Iterator[Effect]:
    """The terms.

    Args:
        largest: sizes of the variables; see terms.ranges_of. There are none by what it has not.
    """
    for acts_on, kinds in PRODUCTS.items():
        for names, (w, v, powers) in kinds.items():
            if w in largest and v in largest:
                name = f"{acts_on}_of_{names[0]}_and_{names[1]}"
                forms = [f for some in powers for f in _forms(acts_on, name, w, v, some, largest)]
                if (acts_on, *names) in MOVING:
                    along = MOVING[acts_on, *names]
                    forms += _forms(acts_on, name, *along, (0,), largest, moves=True)
                yield replace(rig_term(acts_on, name, names, forms), of_two=True)


def _forms(
    acts_on: str,
    name: str,
    w: str,
    v: str,
    powers: tuple[int, ...],
    largest: Mapping[str, float],
    *,
    moves: bool = False,
) -> Iterator[FrameVariant]:
    drawn = moving(name, CYCLES[v]) if moves else over(v, name, 3, largest[v])
    for label, one, numbers in drawn:
        coefficients = of_powers(name, powers, one)
        if coefficients is None:
            continue
        constants = tuple(Parameter(f"{name}_{p}_0", amplitude=True) for p in powers)
        own = {**numbers, "powers": powers, "coefficients": coefficients, "constants": constants}
        reach, also_reach = largest[v], largest[w]
        yield of_the_rig(
            label if moves else f"{label}, powers {', '.join(map(str, powers))}",
            fitted(own),
            acts_on,
            v,
            partial(_at, own, reach, also_reach),
            also=w,
            shape=Shape(
                X[v],
                Y[acts_on],
                reach,
                partial(product, own),
                own | {"variable": v, "also": w, "also_reach": also_reach},
                also=X[w],
                also_reach=also_reach,
            ),
        )


def _at(
    numbers: Mapping[str, Any], reach: float, also_reach: float, p: Values, v: Any, w: Any
) -> Any:
    """What is added at two variables, beyond their reaches as there."""
    x, other = (max_value(min_value(n / r, 1), -1) for n, r in ((v, reach), (w, also_reach)))
    return product(numbers, p, x, other)
