"""The energy balance of a run, step by step.

    work of tools, supports and weight = stored + kinetic + lost + remainder

    change of momentum = impulse of weight, tools, supports and nodal loads

Work of what moves by prescription is taken with the mean of the force before and after the step,
weight exactly, losses with the force at the end of the step. The remainder is the numerical damping
of the time integration and the error of these sums; both vanish with the step. Impulses are summed
likewise, the force of the first step being that at its end; a run starts at rest. Momentum and
impulse are about the origin, see solving.momentum.

All is of the whole sheet, also where a quarter of it is modelled: its images in x = 0 and y = 0
carry the same work and energy, and of the sum of a force and its images only z is left, of a moment
nothing.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from .model import Model
from .momentum import Momentum
from .stepping import Step

__all__ = ["Balance"]


class Balance:
    """Sums the work of a run. Every method is collective.

    Args:
        model: what is run.
        past: columns of the last recorded step, to go on from; None at the start.
        quarter: whether it is the part x >= 0, y >= 0 of a symmetric sheet.
    """

    def __init__(
        self, model: Model, past: dict[str, float] | None = None, *, quarter: bool = False
    ) -> None:
        self.model = model
        self._parts = 4.0 if quarter else 1.0
        self._whole = np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0]) if quarter else np.ones(6)
        past = past or {}
        self.external = past.get("external_work_N_mm", 0.0)
        self.lost = past.get("lost_N_mm", 0.0)
        self._tool_force = {
            tool.name: np.array([past.get(f"{tool.name}_force_{a}_N", 0.0) for a in "xyz"])
            for tool in model.tools
        }
        self._tool_place = {tool.name: model.tool_place(tool.name) for tool in model.tools}
        self._reaction: Array | None = None
        self._time = past.get("time_s", 0.0)
        self._momentum = None if model.alpha is None else Momentum(model)
        self._impulse = _read(past, "impulse_{}_N_s", "angular_impulse_{}_N_mm_s")
        self._wrench = None
        if "external_force_x_N" in past:
            self._wrench = _read(past, "external_force_{}_N", "external_moment_{}_N_mm")

    def step(self, step: Step, outside: dict[str, Array]) -> dict[str, float]:
        """Columns for a converged step, its increment still in the fields.

        Args:
            step: the step.
            outside: what acts from outside, as of ``Model.outside``.
        """
        model = self.model
        row: dict[str, float] = {}
        forces = model.tool_forces(outside)
        for tool in model.tools:
            force = forces[tool.name] * self._whole[:3] + 0.0
            place = model.tool_place(tool.name)
            moved = place - self._tool_place[tool.name]
            self.external += float((force + self._tool_force[tool.name]) @ moved) / 2.0
            self._tool_force[tool.name], self._tool_place[tool.name] = force, place
            row |= {f"{tool.name}_force_{a}_N": float(f) for a, f in zip("xyz", force, strict=True)}
        self.external += self._parts * (model.weight_work(outside) + self._support_work())

        energies, losses = model.system.sums("energy", "loss")
        energies = {name: self._parts * e for name, e in energies.items()}
        self.lost += self._parts * sum(losses.values())
        kinetic = energies.get("inertia", 0.0)
        stored = sum(energies.values()) - kinetic
        row |= {f"energy_{name.replace(' ', '_')}_N_mm": e for name, e in energies.items()}
        return (
            row
            | self._momenta(step, outside)
            | {
                "external_work_N_mm": self.external,
                "stored_N_mm": stored,
                "kinetic_N_mm": kinetic,
                "lost_N_mm": self.lost,
                "remainder_N_mm": self.external - stored - kinetic - self.lost,
            }
        )

    def _momenta(self, step: Step, outside: dict[str, Array]) -> dict[str, float]:
        """Momentum, impulse and what acts from outside; nothing in statics."""
        if self._momentum is None:
            return {}
        wrench = self._momentum.external(outside, step.reactions) * self._whole + 0.0
        before = wrench if self._wrench is None else self._wrench
        self._impulse += (before + wrench) / 2.0 * (step.time - self._time)
        self._wrench, self._time = wrench, step.time
        momentum = self._momentum.momentum() * self._whole + 0.0
        columns = _columns(momentum, "momentum_{}_N_s", "angular_momentum_{}_N_mm_s")
        columns |= _columns(self._impulse, "impulse_{}_N_s", "angular_impulse_{}_N_mm_s")
        return columns | _columns(wrench, "external_force_{}_N", "external_moment_{}_N_mm")

    def _support_work(self) -> float:
        """Work of the supports over the step; only those that move do any."""
        model = self.model
        if not model.moving_supports:
            return 0.0
        reaction = model.own_reactions()[:, :3]
        before = np.zeros_like(reaction) if self._reaction is None else self._reaction
        self._reaction = reaction
        increment = model.fields.w.x.array.reshape(-1, 6)[: model.disc.owned, :3]
        own = float(np.sum((reaction + before) / 2.0 * increment))
        return float(model.comm.allreduce(own))


def _columns(values: Array, first: str, second: str) -> dict[str, float]:
    """Six numbers under the names of x, y and z."""
    names = [name.format(axis) for name in (first, second) for axis in "xyz"]
    return dict(zip(names, values.tolist(), strict=True))


def _read(past: dict[str, float], first: str, second: str) -> Array:
    """The six numbers of a recorded step; 0 where there was none."""
    names = [name.format(axis) for name in (first, second) for axis in "xyz"]
    return np.array([past.get(name, 0.0) for name in names])
