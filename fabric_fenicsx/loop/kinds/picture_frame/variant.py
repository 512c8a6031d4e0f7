"""A form of an effect in a picture frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

from ....mechanics.laws.law import CrossingLaw, Form
from ...inference.effects import Effect, Values, Variant

__all__ = ["FrameVariant", "law_effects"]


@dataclass(frozen=True, slots=True, eq=False)
class FrameVariant(Variant):
    """An effect in a picture frame, as expressions in UFL of its parameters.

    Attributes:
        laws: laws of a crossing (mechanics.laws) whose moments per area of fabric [N] add.
        by_run: factor of these, from the parameters and how many runs of its specimen were before;
            None where they go by none, or each run has its own (``each_run``).
        travel: true crosshead displacement [mm] from the parameters, the crosshead's place D [mm]
            and the true displacement at the reading before, None unless ``remembers_travel``.
        reading: what the load cell adds [N] at the time t [s].
        remembers_travel: ``travel`` depends on ``past``.
        goes_back: parameter of ``travel``, the time in which a frame that is free goes back to
            where the fabric is at rest [s]; "per_time" is then among the parameters. Empty: it
            stays.
        added_reading: what the load cell adds [N], from the parameters and what ``of`` names.
        added_travel: by how much the frame is ahead of the crosshead [mm], from the same.
        added_rate: how fast that changes [mm/s], likewise; None: as it does from one point to the
            next, or in place and time.
        of: of "time" in the run [s], the crosshead's "displacement" [mm], "speed" [mm/s] and
            "acceleration" [mm/s²], the "force" [N] of the model and its "force_rate" [N/s], and
            "per_time", 1 over the step from the point before [1/s], "displacement_before" and
            "force_before" there, and "run", how many there were before in its folder; of strips
            their "width" and "free_length", by which they are longer than wide [mm], and
            "pinned_angle", that of the middle if nothing slips [rad].
        remembered: what ``added_reading`` and ``added_travel`` find as "memory" among these, from
            the parameters, the others, and its value at the point before; 0 before the first.
        variable: what a term without a formula depends on, from these; by default the first.
        carried: what ``laws`` remember as "variable" from earlier runs of a specimen, "path" or
            "largest_angle"; empty where each run begins anew.
        like: a form whose laws have the same expressions, which serve both.
        of_baseline: parameters of the baseline that ``laws`` needs as well.
        rounds: steps of Newton's in which ``added_travel`` is found with the force that it leaves;
            0: with that without it.
        in_series: ... and at the rate that it leaves, as what gives way at once does.
        each_run: what it has parameters of in each run, empty if nothing: the "zero" of a load cell
            (``reading``) or its "gain", more than 1, the "place" that the frame was put back to
            before, by how much it is ahead of the crosshead [mm], or how much there is of the
            "moment" of ``laws``. Those of a holdout run can only come from that run: its error is
            then what is left after them.
        from_the_first: ... but in the first that is fitted, from which the others differ by these.
    """

    laws: Callable[[Values], tuple[Any, ...]] | None = None
    by_run: Callable[[Values, Any], Any] | None = None
    travel: Callable[[Values, Any, Any], Any] | None = None
    reading: Callable[[Values, Any], Any] | None = None
    remembers_travel: bool = False
    goes_back: str = ""
    added_reading: Callable[[Values, Values], Any] | None = None
    added_travel: Callable[[Values, Values], Any] | None = None
    added_rate: Callable[[Values, Values], Any] | None = None
    of: tuple[str, ...] = ()
    remembered: Callable[[Values, Values, Any], Any] | None = None
    variable: Callable[[Values], Any] | None = None
    carried: str = ""
    like: FrameVariant | None = None
    of_baseline: tuple[str, ...] = ()
    rounds: int = 0
    in_series: bool = False
    each_run: Literal["", "zero", "gain", "place", "moment"] = ""
    from_the_first: bool = False

    def numbered(self, runs: Sequence[int]) -> Sequence[int]:
        """Those of the fitted runs that have a number of their own."""
        return runs[1:] if self.from_the_first else runs

    @property
    def adds_up(self) -> bool:
        """Whether it adds to moments or readings, and leaves the travel and their zeros alone."""
        return self.travel is None and self.added_travel is None and not self.each_run

    @property
    def of_the_force(self) -> bool:
        """Whether what it adds to the reading depends on the force of the model."""
        return bool({"force", "force_rate"} & set(self.of))


def law_effects(
    laws: Iterable[type[CrossingLaw]], meanings: Mapping[str, str] = MappingProxyType({})
) -> list[Effect]:
    """The effects in a picture frame that laws of a crossing are forms of.

    Args:
        laws: those with forms are taken.
        meanings: of effects in the order wanted, by their names; others come behind.
    """
    found: dict[str, list[tuple[type[CrossingLaw], Form]]] = {name: [] for name in meanings}
    for law in laws:
        for form in law.forms:
            found.setdefault(form.effect, []).append((law, form))
    effects = []
    for name, forms in found.items():
        meaning = meanings.get(name) or next(
            (form.meaning for _, form in forms if form.meaning), ""
        )
        variants = [
            FrameVariant(
                form.label,
                form.parameters,
                laws=partial(form.laws, law),
                carried=form.carried,
            )
            for law, form in sorted(forms, key=lambda pair: pair[1].rank)
        ]
        of_fabric = all(law.of_fabric for law, _ in forms)
        effects.append(Effect(name, "picture_frame", meaning, tuple(variants), of_fabric))
    return effects
