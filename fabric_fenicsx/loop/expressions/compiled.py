"""Expressions with memory as a compiled loop: what numpy cannot do for all points at once.

The C compiler is there where dolfinx is, which compiles its forms with it. A loop is kept beside
dolfinx's forms, under a name made of its source.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...arrays import Array
from ...mechanics.scalars import Steps

__all__ = ["march"]


WRITTEN: dict[str, str] = {
    "Sum": "{} + {}",
    "Product": "{} * {}",
    "Division": "{} / {}",
    "Power": "pow({}, {})",
    "Abs": "fabs({})",
    "Real": "{}",
    "Sign": "({0} > 0) - ({0} < 0)",
    "Sqrt": "sqrt({})",
    "Exp": "exp({})",
    "Ln": "log({})",
    "Sin": "sin({})",
    "Cos": "cos({})",
    "Tan": "tan({})",
    "Asin": "asin({})",
    "Acos": "acos({})",
    "Atan": "atan({})",
    "Atan2": "atan2({}, {})",
    "Sinh": "sinh({})",
    "Cosh": "cosh({})",
    "Tanh": "tanh({})",
    "Conditional": "{} ? {} : {}",
    "MaxValue": "fmax({}, {})",
    "MinValue": "fmin({}, {})",
    "LT": "{} < {}",
    "LE": "{} <= {}",
    "GT": "{} > {}",
    "GE": "{} >= {}",
    "EQ": "{} == {}",
    "NE": "{} != {}",
    "AndCondition": "{} && {}",
    "OrCondition": "{} || {}",
    "NotCondition": "!{}",
}
"""What an operator of UFL is in C, by the name of its class."""

FRAME = """#include <math.h>
/* Inputs x, parameters p, memory h; M of them with partial derivatives P in x, h and p. Of the
   inputs those in moving have slopes dx. */
void march(long points, long columns, long active, long moved, const double *x, const double *dx,
           const double *p, const long *moving, const long *slot, const char *begins,
           double *h, double *dh)
{{
  enum {{ X = {inputs}, M = {memory}, N = {parameters} }};
  const long size = points * columns;
  for (long i = 0; i + 1 < points; ++i) {{
    if (begins[i + 1]) continue;
    for (long c = 0; c < columns; ++c) {{
      const long at = i * columns + c, next = at + columns;
      double now[M], P[M][X + M + N];
{body}
      for (int m = 0; m < M; ++m) {{
        h[m * size + next] = now[m];
        for (long a = 0; a < active; ++a) {{
          double d = 0.0;
          for (long s = 0; s < moved; ++s)
            d += P[m][moving[s]] * dx[(s * active + a) * size + at];
          for (int s = 0; s < M; ++s) d += P[m][X + s] * dh[(s * active + a) * size + at];
          dh[(m * active + a) * size + next] = d;
        }}
        for (int s = 0; s < N; ++s)
          dh[(m * active + slot[s]) * size + next] += P[m][X + M + s];
      }}
    }}
  }}
}}
"""


def march(
    steps: Steps,
    partials: Sequence[dict[str, int]],
    inputs: Sequence[str],
    memory: Sequence[str],
    parameters: Sequence[str],
) -> Callable[..., tuple[Array, Array]]:
    """Compile the loop that remembers.

    Args:
        steps: the next values of the memory first, then their partial derivatives.
        partials: for each of them, where in the steps' results the derivative in a symbol is.
        inputs: names of the symbols given at every point.
        memory: of those remembered.
        parameters: of the numbers.

    Returns:
        A function of the inputs (n_inputs, n_points, n_columns), the slopes of those that have any
        (n_moving, n_active, n_points, n_columns), the numbers of these, the parameters' values,
        their places among the active ones, the numbers of the points that records begin with,
        (n_records,), and the memory there, (n_memory, n_records). It gives memory and its slopes
        before each point, shaped likewise.
    """
    places = (
        {name: f"x[{k} * size + at]" for k, name in enumerate(inputs)}
        | {name: f"h[{k} * size + at]" for k, name in enumerate(memory)}
        | {name: f"p[{k}]" for k, name in enumerate(parameters)}
    )
    lines = []
    for k, (operator, operands) in enumerate(steps.operations):
        if operator == "given":
            value = places[operands]
        elif operator == "number":
            value = repr(operands)
        else:
            value = WRITTEN[operator].format(*(f"v{i}" for i in operands))
        lines.append(f"const double v{k} = {value};")
    for m, own in enumerate(partials):
        lines.append(f"now[{m}] = v{steps.results[m]};")
        for s, name in enumerate((*inputs, *memory, *parameters)):
            value = f"v{steps.results[own[name]]}" if name in own else "0.0"
            lines.append(f"P[{m}][{s}] = {value};")
    source = FRAME.format(
        inputs=len(inputs),
        memory=len(memory),
        parameters=len(parameters),
        body="\n".join("      " + line for line in lines),
    )
    function = ctypes.CDLL(str(_library(source))).march
    n_memory = len(memory)

    def run(
        x: Array,
        dx: Array,
        moving: npt.NDArray[Any],
        values: Array,
        slot: npt.NDArray[Any],
        begins: npt.NDArray[Any],
        first: Array,
    ) -> tuple[Array, Array]:
        points, columns = x.shape[1:]
        active = dx.shape[1]
        h = np.zeros((n_memory, points, columns))
        h[:, begins] = first[:, :, None]
        dh = np.zeros((n_memory, active, points, columns))
        flags = np.zeros(points, dtype=np.int8)
        flags[begins] = 1
        real = [np.ascontiguousarray(a, dtype=float) for a in (x, dx, values)]
        whole = [np.ascontiguousarray(a, dtype=ctypes.c_long) for a in (moving, slot)]
        function(
            *(ctypes.c_long(number) for number in (points, columns, active, len(moving))),
            *(ctypes.c_void_p(a.ctypes.data) for a in (*real, *whole, flags, h, dh)),
        )
        return h, dh

    return run


def _library(source: str) -> Path:
    """The compiled source, made where it is not there yet."""
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "fabric-fenicsx"
    name = hashlib.sha256(source.encode()).hexdigest()[:24]
    path = cache / f"march_{name}.so"
    if not path.exists():
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache) as folder:
            code, made = Path(folder) / "march.c", Path(folder) / "march.so"
            code.write_text(source)
            compiler = os.environ.get("CC", "cc")
            options = ["-O2", "-shared", "-fPIC", "-o", str(made), str(code), "-lm"]
            subprocess.run([compiler, *options], check=True)
            # At once, so that another rank never sees half a file.
            os.replace(made, path)
    return path
