"""What a model remembers from step to step: fields updated when a step is accepted.

A history is a field and an expression for its next value, evaluated with the increment of the step
still in the unknowns. All expressions are evaluated before any field changes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .. import _dolfinx
from ..arrays import Array, Integers
from ..fabric.net import Where
from ..mechanics import beam, crossover
from .discretisation import Discretisation

__all__ = ["Histories"]


class Histories:
    """The remembered fields of a model, by name.

    Args:
        disc: the discretised net.
    """

    def __init__(self, disc: Discretisation) -> None:
        self.disc = disc
        self._entries: dict[str, tuple[Where, Any, Any]] = {}
        self._numbers: dict[str, Array] = {}

    def add(self, name: str, where: Where, field: Any, expression: Any) -> None:
        """Remember ``expression`` in ``field``. Collective; compiles.

        Args:
            name: unique; names the array in step files.
            where: constant per "cells" or "crossings", or at the "nodes".
            field: the function that holds it; None on a rank without crossings.
            expression: its next value (UFL).

        Raises:
            ValueError: the name is there already.
        """
        self._check_new(name)
        disc = self.disc
        form = None
        if field is not None:
            space = field.function_space
            if where == "cells":
                form = beam.cell_values(disc.tows, expression, space)
            elif where == "nodes":
                form = beam.node_sums(disc.tows, expression, space)
            elif disc.connectors is not None:
                form = crossover.crossing_values(disc.connectors, expression, space)
        self._entries[name] = where, field, disc.compiled(form)

    def add_numbers(self, name: str, values: Array) -> None:
        """Keep numbers in the step files that whoever hands them over changes in place himself.

        Args:
            name: unique; names the array in step files.
            values: the same on every rank, in an array that stays the same object.

        Raises:
            ValueError: the name is there already.
        """
        self._check_new(name)
        self._numbers[name] = values

    def _check_new(self, name: str) -> None:
        if name in self._entries or name in self._numbers:
            raise ValueError(f"{name}: remembered twice")

    def update(self) -> None:
        """Evaluate every expression, then change the fields."""
        new = {
            name: self.next(name) for name, entry in self._entries.items() if entry[1] is not None
        }
        for name, values in new.items():
            field = self._entries[name][1]
            field.x.array[:] = values.ravel()
            field.x.scatter_forward()

    def next(self, name: str) -> Array:
        """Next values of a field on this rank, those of ghosts not to be used, (n, size)."""
        where, field, form = self._entries[name]
        size = field.function_space.dofmap.index_map_bs
        if where == "nodes":
            return self.disc.node_values(form, size)
        values = np.zeros_like(field.x.array)
        _dolfinx.add_vector(values, form)
        return values.reshape(-1, size)

    @property
    def names(self) -> list[str]:
        """Names of all that is remembered."""
        return [*self._numbers, *self._entries]

    @property
    def numbers(self) -> dict[str, Array]:
        """The kept numbers by name."""
        return dict(self._numbers)

    def own(self) -> dict[Where, dict[str, Array]]:
        """This rank's own part of the remembered fields, rows in the order of the net."""
        found: dict[Where, dict[str, Array]] = {"nodes": {}, "cells": {}, "crossings": {}}
        for name, (where, _, _) in self._entries.items():
            found[where][name] = self.disc.in_order(where, self._own_values(name))
        return found

    def save(self) -> dict[str, Array]:
        """The remembered values in the order of the net, on every rank. Collective."""
        disc = self.disc
        saved = {name: values.copy() for name, values in self._numbers.items()}
        gather = {
            "nodes": disc.gather_nodes,
            "cells": disc.gather_cells,
            "crossings": disc.gather_crossings,
        }
        # All of a kind in one message.
        for where, gathered in gather.items():
            names = [name for name, entry in self._entries.items() if entry[0] == where]
            if names:
                own = [self._own_values(name) for name in names]
                whole = gathered(np.hstack(own))
                ends = np.cumsum([values.shape[1] for values in own])[:-1]
                saved |= dict(zip(names, np.hsplit(whole, ends), strict=True))
        return saved

    def _own_values(self, name: str) -> Array:
        """This rank's part of a remembered field, (n, size)."""
        disc = self.disc
        where, field, _ = self._entries[name]
        if where == "nodes":
            return field.x.array.reshape(-1, 3)[: disc.owned]
        if where == "cells":
            return disc.cell_values(field)
        return np.zeros((0, 1)) if field is None else disc.crossing_values(field)

    def load(self, saved: dict[str, Array]) -> None:
        """Put saved values back; KeyError where one is missing."""
        self.read(saved.__getitem__, lambda name, where, numbers: saved[name][numbers])

    def read(
        self,
        whole: Callable[[str], Array],
        rows: Callable[[str, Where, Integers], Array],
    ) -> None:
        """Put saved values back, of fields those that this rank needs.

        Args:
            whole: gives kept numbers by name.
            rows: gives rows of a field by its name, what they belong to and the net's numbers.
        """
        disc = self.disc
        for name, numbers in self._numbers.items():
            numbers[:] = whole(name)
        for name, (where, field, _) in self._entries.items():
            if field is None:
                continue
            size = field.function_space.dofmap.index_map_bs
            values = field.x.array.reshape(-1, size)
            if where == "nodes":
                values[:] = rows(name, where, disc.local_nodes)
                continue
            own = disc.net.cell_numbers[disc.cell_places]
            if where == "crossings":
                own = disc.numbers["crossings"][disc.connector_order]
            dofs = _dolfinx.cell_dofs(field.function_space)[:, 0]
            values[dofs] = rows(name, where, own).reshape(len(own), size)
