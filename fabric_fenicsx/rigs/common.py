"""What the rigs share: from the keys of a case to the objects of the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Integers
from ..errors import InputError
from ..fabric.crossings import tow_numbers
from ..fabric.gmsh_io import mesh_net, read_msh
from ..fabric.net import WARP, WEFT, Net
from ..fabric.part import Part
from ..fabric.paths import TowPaths
from ..fabric.section import BundleSection, FabricSection, RectangularSection, Section
from ..mechanics.laws.law import CrossingLaw
from ..mechanics.stretch_laws import Uncrimping
from ..output.files import write_text
from ..parallel import from_root
from ..solving.model import Model
from ..solving.partition import handed_out
from ..solving.parts import CrossoverLaw
from ..solving.sections import Bending
from ..solving.snapshot import Snapshot
from ..solving.stepping import StepControl
from .cases import BundleKeys, Case, CrossoverKeys, SolverKeys, StiffnessKeys, TowKeys
from .registry import rig
from .simulation import Run, simulate

__all__ = [
    "Session",
    "control",
    "crossover_law",
    "extend",
    "mesh",
    "of_whole",
    "section",
    "simulated",
    "tow_net",
    "tow_sections",
    "write_table",
]


TONNE = 1e-3
"""Of a kilogram, in which the keys have densities as the paper's Table 3 does."""

KG_M2 = 1e9
"""Of a tonne per mm²."""


@dataclass(slots=True)
class Session:
    """Where and how a case is run.

    Attributes:
        folder: for the results; exists.
        comm: communicator.
        base: folder that relative paths in the case count from.
        started: perf_counter() when the command began.
        progress: told (fraction done, accepted steps, iterations of the last one).
        resume: go on from the last step in the folder.
        pictures: draw them.
        case_text: the case as it is run, kept beside the records.
        laws: of the crossings, beside those of the case, from the area of a crossing [mm²].
    """

    folder: Path
    comm: MPI.Comm
    base: Path
    started: float
    progress: Callable[[float, int, int], None] = field(default=lambda *_: None)
    resume: bool = False
    pictures: bool = True
    case_text: str | None = None
    laws: tuple[Callable[[float], CrossingLaw], ...] = ()

    @property
    def root(self) -> bool:
        """Whether this rank writes."""
        return bool(self.comm.rank == 0)


def section(keys: TowKeys, spacing: float) -> Section:
    """Section of the tows of a family, which stand for ``spacing`` [mm] of fabric each."""
    base: Section
    if keys.bundle is not None:
        base, base_width = _bundle(keys.bundle, keys.shear_correction), keys.bundle.tow_spacing_mm
    else:
        base = RectangularSection(
            width=keys.width_mm,
            height=keys.height_mm,
            density=keys.density_kg_mm3 * TONNE,
            C1=keys.C1_MPa,
            D1=keys.D1_per_MPa,
            shear_correction=keys.shear_correction,
        )
        base_width = spacing if keys.per_width_mm is None else keys.per_width_mm
    own = keys.stiffness or StiffnessKeys()
    given = (
        own.stretch_N_mm,
        own.shear_N_mm,
        own.twist_Nmm,
        own.bending_out_of_plane_Nmm,
        own.bending_in_plane_Nmm,
    )
    if base_width == spacing and given == (None,) * 5:
        return base
    return FabricSection(base, spacing, base_width, given)


def _bundle(keys: BundleKeys, shear_correction: float) -> BundleSection:
    return BundleSection(
        filaments=keys.filaments,
        diameter=keys.filament_diameter_mm,
        modulus=keys.filament_modulus_MPa,
        shear_modulus=keys.filament_shear_modulus_MPa,
        density=keys.filament_density_kg_mm3 * TONNE,
        width=keys.tow_width_mm,
        height=keys.tow_height_mm,
        coupling=(keys.coupling_in_plane, keys.coupling_out_of_plane, keys.coupling_twist),
        shear_correction=shear_correction,
    )


def tow_sections(
    case: Case, net: Net, spacings: tuple[float, float]
) -> tuple[tuple[Section, ...], Integers]:
    """The sections of a case's tows, and which of them each tow of the net has, (n_tows,).

    Args:
        case: the case.
        net: its net.
        spacings: of the warp and of the weft tows [mm].

    Raises:
        InputError: two types claim the same tow.
    """
    sections = [section(case.tow, spacing) for spacing in spacings]
    kind = net.tow_family.astype(np.int64)
    if not case.tow_types:
        return tuple(sections), kind
    numbers = tow_numbers(net)
    for i, keys in enumerate(case.tow_types):
        family = WARP if keys.family == "warp" else WEFT
        own = (net.tow_family == family) & np.isin(numbers % keys.repeat, keys.tows)
        if (kind[own] > WEFT).any():
            number = int(numbers[own & (kind > WEFT)].min())
            raise InputError(
                f"tow_types.{i}: {keys.family} tow {number} has a type already, allowed is one"
            )
        kind[own] = len(sections)
        sections.append(section(keys.of(case.tow), spacings[family]))
    return tuple(sections), kind


def crossover_law(
    keys: CrossoverKeys, area: float, more: Sequence[Callable[[float], CrossingLaw]] = ()
) -> CrossoverLaw:
    """Laws per crossing from laws per area: M = m · area of a crossing [mm²]."""
    return CrossoverLaw(
        translation=keys.translation_N_mm,
        k1=keys.k1_N_mm * area,
        k3=keys.k3_N_mm * area,
        dashpot=keys.dashpot_N_s_mm * area,
        alignment=keys.alignment_N_mm,
        laws=(*(law.build(area) for law in keys.laws), *(law(area) for law in more)),
        slip_limit=keys.slip_limit_N,
        slip_drag=keys.slip_drag_s_mm or 0.0,
    )


def fabric_model(
    case: Case, net: Net, spacings: tuple[float, float], session: Session, **rig: Any
) -> Model:
    """The model of a case's tows and crossings on its net. Collective.

    Args:
        case: the case.
        net: its net.
        spacings: of the warp and of the weft tows [mm].
        session: where and how it runs.
        rig: what the rig adds; further arguments of Model.
    """
    sections, kind = tow_sections(case, net, spacings)
    families = [WARP, WEFT, *(WARP if t.family == "warp" else WEFT for t in case.tow_types)]
    laws = tuple(keys.build() for keys in case.tow.bending)
    crimp = case.tow.crimp_strain, case.tow.crimp_stiffness_share
    return Model(
        net,
        sections,
        tow_section=kind,
        bending=Bending(laws, tuple(spacings[family] for family in families)),
        uncrimping=Uncrimping(*crimp) if crimp[0] else None,
        section_law="linear" if case.tow.section_law == "bundle" else case.tow.section_law,
        crossovers=crossover_law(case.crossover, spacings[0] * spacings[1], session.laws),
        comm=session.comm,
        **rig,
    )


def control(keys: SolverKeys, largest_move: float = math.inf) -> StepControl:
    """Step control of a case; ``largest_move`` [mm] holds where the case does not say."""
    return StepControl(
        first=keys.first_step_s,
        smallest=keys.smallest_step_s,
        largest=keys.largest_step_s,
        largest_move=largest_move if keys.largest_move_mm is None else keys.largest_move_mm,
    )


def simulated(
    case: Case,
    model: Model,
    session: Session,
    *,
    end: float,
    control: StepControl,
    stops: Sequence[float] = (),
    measure: Callable[[Snapshot], dict[str, float]] | None = None,
    measure_own: Callable[[Snapshot], dict[str, float]] | None = None,
) -> Run:
    """Run the model of a case to its end, or as far as it goes. Collective.

    Args:
        case: the case.
        model: its model.
        session: where and how it runs.
        end: final time [s].
        control: step lengths.
        stops: times that steps must not jump over [s].
        measure: further columns for each step's row, from the snapshot of the whole net.
        measure_own: see ``simulate``.

    Raises:
        InputError: there is nothing to resume.
    """
    return simulate(
        model,
        session.folder,
        test=case.test,
        end=end,
        stops=stops,
        control=control,
        force_tolerance=case.solver.force_tolerance_N,
        iteration_limit=case.solver.iteration_limit,
        measure=measure,
        measure_own=measure_own,
        progress=lambda time, step, its: session.progress(time / end, step, its),
        resume=session.resume,
        case_text=session.case_text,
        started=session.started,
        quarter=rig(case.test).quarter(case),
        everywhere=False,
    )


def of_whole(
    model: Model, looking: Callable[[Net], Callable[[Snapshot], dict[str, float]]]
) -> Callable[[Snapshot], dict[str, float]]:
    """A ``measure_own`` of what only the whole net shows; rank 0 alone looks at it. Collective.

    Args:
        model: the model.
        looking: from the net to what gives a step's columns from the snapshot of it.

    Raises:
        InputError: that of ``looking`` (on every rank).
    """
    net = model.disc.whole_net(to=0)
    looks: list[Callable[[Snapshot], dict[str, float]]] = []
    from_root(model.comm, lambda: looks.extend([] if net is None else [looking(net)]))

    def measure(own: Snapshot) -> dict[str, float]:
        snapshot = model.whole(own, to=0)
        columns: dict[str, float] = model.comm.bcast(looks[0](snapshot) if looks else None)
        return columns

    return measure


def mesh(fabric: TowPaths, *, comm: MPI.Comm = MPI.COMM_WORLD) -> Net:
    """The net of tows in the plane, by gmsh; the same on every rank. Collective.

    Args:
        fabric: its tows, as a Sheet or a TowLayout.
        comm: communicator.

    Raises:
        InputError: there is no such net (on every rank).
    """
    net: Net = from_root(comm, lambda: mesh_net(fabric))
    return net


def tow_net(case: Case, sheet: TowPaths, session: Session, *, crossing_gap: float = 0.0) -> Part:
    """The net of a case: from its .msh, or from the sheet by gmsh. Collective.

    Rank 0 makes it, and each rank keeps its part: see ``partition.handed_out``.

    Args:
        case: the case.
        sheet: its tows, where it names no .msh.
        session: where it is run.
        crossing_gap: largest distance of the two nodes of a crossing along the normal [mm].

    Raises:
        InputError: the mesh cannot be read (on every rank).
    """

    def load() -> Net:
        if case.mesh is not None:
            return read_msh(session.base / case.mesh, crossing_gap=crossing_gap)
        return mesh_net(sheet, crossing_gap=crossing_gap)

    made: list[Net] = []
    from_root(session.comm, lambda: made.append(load()))
    return handed_out(made[0] if made else None, session.comm)


def write_table(
    session: Session, name: str, columns: Mapping[str, Sequence[float] | npt.NDArray[Any]]
) -> None:
    """Write a CSV into the results, on rank 0."""
    if session.root:
        values = [np.asarray(column).tolist() for column in columns.values()]
        lines = [",".join(columns)]
        lines += [",".join(map(_written, row)) for row in zip(*values, strict=True)]
        write_text(session.folder / name, "\n".join(lines) + "\n")


def _written(value: float) -> str:
    """A number as tables have it; nothing for what is not known."""
    return "" if value != value else f"{value:.9g}"


def extend(summary: dict[str, Any], quantities: dict[str, Any], session: Session) -> dict[str, Any]:
    """result.json: a run's summary with its quantities, and the seconds up to now as the total."""
    seconds = summary["seconds"] | {"total": round(perf_counter() - session.started, 3)}
    return {**summary, "seconds": seconds, "quantities": quantities}


def lowest(net: Net, u: Array) -> float:
    """Lowest point of the deformed net [mm]."""
    return float((net.points + u)[:, 2].min())
