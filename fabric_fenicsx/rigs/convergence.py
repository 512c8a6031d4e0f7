"""A convergence study of a drape: its runs, what changes between them, the error of the case.

Shear angles of a finer run are interpolated to the crossings of the next coarser one; a change is
the root mean square over these crossings, all of them and by regions, which are told by where a
crossing of the coarser run ends: on the `flange` the die's flat face is the nearest tool, on the
`edge` its rounding or its wall, on the `dome` the punch.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import pandas as pd

from ..arrays import Array
from ..errors import InputError
from ..fabric.axes import axes_shear, shear_at
from ..fabric.net import Net
from ..output.convergence import draw_convergence
from ..output.fibres import nearest_tool
from ..output.files import write_text
from ..output.folder import prepare_folder
from ..output.record import write_result
from ..output.results import read_results
from ..output.steps import remove_step
from ..parallel import from_root
from ..solving.snapshot import Snapshot
from .cases import Case
from .discretisation_error import recovered_error, studied_error
from .drape import DrapeCase, mirrors
from .fabric_file import resolved
from .levels import FAMILIES, Family, Level, families
from .richardson import Estimate, estimate_error
from .run import run
from .write_case import case_text

__all__ = ["REGIONS", "SCHEMA", "converge", "region_of"]

SCHEMA = "fabric-convergence/1"

REGIONS = ("all", "dome", "edge", "flange")

RESOLUTION_DEG = 1e-3
"""Change of angles that runs on one and two ranks may have between them."""

COMBINATION = (
    "sum over the families, which bounds the root mean square of their sum; without cells where "
    "the spacing is refined, since cells shrink with it"
)


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What is compared of a completed run.

    Attributes:
        net: the undeformed net.
        flat: place of its crossings on the flat sheet [mm], (n, 2).
        shear: at these [degrees], (n,).
        region: of these, one of REGIONS beside "all", (n,).
        numbers: the punch's force [N] and the shear at the case's points [degrees], by name.
        estimate: of its error by the run alone [degrees].
    """

    net: Net
    flat: Array
    shear: Array
    region: npt.NDArray[np.str_]
    numbers: dict[str, float]
    estimate: float


def converge(
    case: Case,
    folder: Path | str,
    *,
    only: Sequence[str] = tuple(FAMILIES),
    base: Path = Path(),
    resume: bool = False,
    progress: Callable[[float, str], None] = lambda share, what: None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Run the families of runs around a drape case and estimate its error. Collective.

    Each run has a sub-folder, of whose steps the last is kept; `converge.json`, `converge.csv` and
    `converge.png` are written beside them.

    Args:
        case: a drape.
        folder: for the results; is made.
        only: names of the families that are wanted, of levels.FAMILIES.
        base: folder that relative paths in the case count from.
        resume: keep the runs that have ended, go on with one that has not.
        progress: told the share that is done, and what is being run.
        comm: communicator.

    Returns:
        The content of converge.json; ``completed`` is false where the case itself stopped.

    Raises:
        InputError: no drape, no such families of this case, or the folder holds another's runs.
    """
    folder = Path(folder)
    case, _ = from_root(comm, partial(resolved, case, base))
    case = case.model_copy(update={"fabric": None})
    if not isinstance(case, DrapeCase):
        raise InputError(f"test: {case.test}, allowed is drape")
    wanted = families(case, only)
    levels = {level.folder: level for family in wanted for level in family.levels}
    order = sorted(levels, key=lambda name: name != "case")
    prepare_folder(folder, comm)
    results: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(order):

        def told(done: float, steps: int, its: int, number: int = number, name: str = name) -> None:
            progress((number + done) / len(order), name)

        results[name] = _run(levels[name], folder / name, base, resume, told, comm)
    study: dict[str, Any] = from_root(comm, lambda: _study(case, wanted, results, folder))
    return study


def _run(
    level: Level,
    folder: Path,
    base: Path,
    resume: bool,
    progress: Callable[[float, int, int], None],
    comm: MPI.Comm,
) -> dict[str, Any]:
    """result.json of a level, which is run as far as that has not been done."""

    def state() -> tuple[dict[str, Any] | None, bool]:
        if not resume or not (folder / "case.yaml").exists():
            return None, False
        if (folder / "case.yaml").read_text(encoding="utf-8") != case_text(level.case, base):
            raise InputError(f"{folder}: of another case, allowed is a folder of this one, or none")
        if (folder / "result.json").exists():
            return json.loads((folder / "result.json").read_text(encoding="utf-8")), False
        steps = sorted((folder / "steps").glob("step_*.npz"))
        # One that was ended before it wrote its result has nothing to go on with.
        return None, bool(steps) and float(np.load(steps[-1])["time"]) < level.case.duration_s

    result, begun = from_root(comm, state)
    if result is not None:
        progress(1.0, 0, 0)
        return dict(result)
    result = run(
        level.case, folder, base=base, resume=begun, pictures=False, progress=progress, comm=comm
    )
    if comm.rank == 0:
        for step in sorted((folder / "steps").glob("step_*.npz"))[:-1]:
            remove_step(step)
        shutil.rmtree(folder / "paraview", ignore_errors=True)
    return result


def region_of(folder: Path) -> npt.NDArray[np.str_]:
    """Where each crossing of a drape's last step is, one of REGIONS beside "all", (n,)."""
    return _regions(*_last(folder))


def _last(folder: Path) -> tuple[Net, Snapshot, list[Any]]:
    """Net, last step and tools of a run."""
    results = read_results(folder)
    return results.at(results.nearest(None))


def _regions(net: Net, snapshot: Snapshot, tools: Sequence[Any]) -> npt.NDArray[np.str_]:
    place = net.points[net.crossings].mean(axis=1)
    place = place + snapshot.displacement[net.crossings].mean(axis=1)
    tools = [tool for tool in tools if tool.name != "holder"]
    which, on_tool, _ = nearest_tool(tools, place)
    punch = np.array([tool.name == "punch" for tool in tools])[which]
    # The die's face lies in z = 0.
    on_die = np.where(on_tool[:, 2] > -1e-3, "flange", "edge")
    return np.where(punch, "dome", on_die)


def _outcome(case: DrapeCase, folder: Path, result: dict[str, Any]) -> Outcome:
    net, snapshot, tools = _last(folder)
    flat = net.points[net.crossings].mean(axis=1)
    shear = np.degrees(axes_shear(snapshot.axes))
    numbers = {"punch_force_N": result["quantities"]["punch_force_N"]}
    if case.points:
        at = np.array([[point.x_mm, point.y_mm] for point in case.points])
        values = shear_at(net, shear, at, quarter=case.symmetry == "quarter")
        names = [f"shear at {x:g}, {y:g} [°]" for x, y in at]
        numbers |= dict(zip(names, values.tolist(), strict=True))
    return Outcome(
        net,
        flat[:, :2],
        shear,
        _regions(net, snapshot, tools),
        numbers,
        recovered_error(net, snapshot, mirrors(case))["estimate_deg"],
    )


def _study(
    case: DrapeCase, wanted: list[Family], results: dict[str, dict[str, Any]], folder: Path
) -> dict[str, Any]:
    """Compare the runs and write what comes out; one rank calls it."""
    outcomes = {
        name: _outcome(case, folder / name, result)
        for name, result in results.items()
        if result["completed"]
    }
    compared = [_family(case, family, results, outcomes) for family in wanted]
    study = {
        "schema": SCHEMA,
        "title": case.title,
        "completed": results["case"]["completed"],
        "families": compared,
        "total": _total(compared),
    }
    write_text(folder / "converge.json", json.dumps(study, indent=2) + "\n")
    write_text(folder / "converge.csv", pd.DataFrame(_rows(compared)).to_csv(index=False))
    draw_convergence(folder / "converge.png", study)
    error = studied_error(study["total"])
    if error is not None:
        write_result(folder / "case", {**results["case"], "discretisation_error": error})
    return study


def _family(
    case: DrapeCase,
    family: Family,
    results: dict[str, dict[str, Any]],
    outcomes: dict[str, Outcome],
) -> dict[str, Any]:
    levels = [
        {
            "folder": level.folder,
            "value": level.value,
            "size": level.size,
            "completed": results[level.folder]["completed"],
            "stopped_because": results[level.folder]["stopped_because"],
            "estimate_deg": outcomes[level.folder].estimate if level.folder in outcomes else None,
        }
        for level in family.levels
    ]
    stopped = [level["folder"] for level in levels if not level["completed"]]
    own = family.levels[family.own]
    told = {
        "name": family.name,
        "varied": family.varied,
        "size": family.sized,
        "formal_order": family.formal_order,
        "own_size": own.size,
        "stopped": stopped,
        "levels": levels,
    }
    done = [level for level in family.levels if level.folder in outcomes]
    if own not in done:
        return {**told, "regions": [], "quantities": []}
    compared = [outcomes[level.folder] for level in done]
    sizes = [level.size for level in done]

    def error(changes: Sequence[float], resolution: float) -> Estimate:
        return estimate_error(
            sizes, changes, own.size, formal=family.formal_order, resolution=resolution
        )

    differences = [
        shear_at(fine.net, fine.shear, coarse.flat, quarter=case.symmetry == "quarter")
        - coarse.shear
        for coarse, fine in pairwise(compared)
    ]
    regions = []
    for region in REGIONS:
        own_places = [
            np.flatnonzero((region == "all") | (coarse.region == region))
            for coarse in compared[:-1]
        ]
        if not all(len(places) for places in own_places):
            continue
        pairs = list(zip(differences, own_places, compared, strict=False))
        changes = [float(np.sqrt(np.mean(d[at] ** 2))) for d, at, _ in pairs]
        worst = [at[np.abs(d[at]).argmax()] for d, at, _ in pairs]
        regions.append(
            {
                "region": region,
                "changes_deg": changes,
                "largest_deg": [float(d[i]) for (d, _, _), i in zip(pairs, worst, strict=True)],
                "largest_at_mm": [
                    outcome.flat[i].tolist()
                    for (_, _, outcome), i in zip(pairs, worst, strict=True)
                ],
                **_told(error(changes, RESOLUTION_DEG)),
            }
        )
    quantities = []
    for name in compared[0].numbers:
        values = [outcome.numbers[name] for outcome in compared]
        resolution = RESOLUTION_DEG if name.endswith("[°]") else 1e-4 * abs(values[-1])
        found = error(np.diff(values).tolist(), resolution)
        extrapolated = values[-1] + found.limit
        quantities.append(
            {"name": name, "values": values, "extrapolated": extrapolated, **_told(found)}
        )
    return {**told, "regions": regions, "quantities": quantities}


def _told(found: Estimate) -> dict[str, Any]:
    told = asdict(found) | {"uncertainty": found.uncertainty}
    return {key: told[key] for key in ("order", "basis", "error", "safety", "uncertainty")}


def _total(compared: list[dict[str, Any]]) -> dict[str, Any]:
    """Errors of the families added up, for each region and each number."""
    names = {family["name"] for family in compared if family["regions"]}
    counted = [
        family
        for family in compared
        if family["name"] in names - ({"cells"} if "spacing" in names else set())
    ]

    def added(group: str, key: str, name: str) -> dict[str, Any] | None:
        rows = [row for family in counted for row in family[group] if row[key] == name]
        if not rows or any(row["error"] is None for row in rows):
            return None
        return {part: sum(row[part] for row in rows) for part in ("error", "uncertainty")}

    quantities = counted[0]["quantities"] if counted else []
    return {
        "combination": COMBINATION,
        "of": [family["name"] for family in counted],
        "stopped": [name for family in compared for name in family["stopped"]],
        "regions": {name: added("regions", "region", name) for name in REGIONS},
        "quantities": {row["name"]: added("quantities", "name", row["name"]) for row in quantities},
    }


def _rows(compared: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """converge.csv: a row for each change of a region and each value of a number."""
    rows = []
    for family in compared:
        done = [level for level in family["levels"] if level["completed"]]
        for entry in (*family["regions"], *family["quantities"]):
            name = entry.get("region", entry.get("name"))
            for i, level in enumerate(done):
                finer = i < len(done) - 1
                rows.append(
                    {
                        "family": family["name"],
                        "of": name,
                        "level": level["value"],
                        "size": level["size"],
                        "value": entry["values"][i] if "values" in entry else None,
                        "change_to_next": entry["changes_deg"][i]
                        if "changes_deg" in entry and finer
                        else None,
                        "largest_change_deg": entry["largest_deg"][i]
                        if "largest_deg" in entry and finer
                        else None,
                        "order": entry["order"],
                        "basis": entry["basis"],
                        "error_of_the_case": entry["error"],
                        "uncertainty_of_the_case": entry["uncertainty"],
                    }
                )
    return rows
