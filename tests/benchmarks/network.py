"""Two problems on an n x n network, for timing solvers side by side; one line of JSON each.

    python tests/benchmarks/network.py {frame,sheet} --n 17 --sub 4

n warp tows at X = 12 i and n weft tows at Y = 12 j in the square 0..12 (n + 1), every 12 mm in
``sub`` cells. Section 4.57 x 0.04 mm, E 360000, G 120000; crossings with 100 N/mm in x, y, z and
50 N mm/rad in the plane.

frame: all ends move affinely, e1 = (cos g/2, sin g/2), e2 = (sin g/2, cos g/2), g from 0 to 55
    degrees in 20 steps. Result: dW/dg [N mm], n² 50 g for tows that do not bend between crossings.
sheet: warp ends at Y = 0 clamped, a dead weight of 2.147e-6 N/mm² spread equally over the nodes in
    20 steps. Result: z of the corner (X = 12, Y = L) and of the middle of the free edge [mm].

``solve_seconds`` is the loading loop alone: no import, mesh or compilation. ``loop_cpu_seconds`` is
its processor time, of all ranks together; ranks that wait for each other spin, and that counts.
"""

from __future__ import annotations

import argparse
import json
import resource
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from fabric_fenicsx.fabric.gmsh_io import read_msh, write_msh
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.fabric.sheet import Sheet
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SPACING, STEPS = 12.0, 20
SECTION = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0)
CROSSINGS = CrossoverLaw(translation=100.0, k1=50.0, k3=0.0, dashpot=0.0, alignment=1000.0)
END_ANGLE = np.radians(55.0)
AREAL_WEIGHT = 2.147e-6


def network(n: int, sub: int) -> Net:
    """The net, meshed by gmsh on rank 0."""
    comm = MPI.COMM_WORLD
    side = SPACING * (n + 1)
    positions = tuple(SPACING * i for i in range(1, n + 1))
    net = None
    if comm.rank == 0:
        import tempfile
        from pathlib import Path

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "net.msh"
            write_msh(Sheet((0.0, side), (0.0, side), positions, positions, sub), path)
            net = read_msh(path)
    whole: Net = comm.bcast(net)
    return whole


def run(model: Model, tolerance: float, before: Any, after: Any) -> dict[str, Any]:
    """Twenty equal steps to time 1; returns what they cost."""
    set_time = model.set_time

    def moved(start: float, end: float) -> None:
        set_time(start, end)
        before(end)

    model.set_time = moved  # type: ignore[method-assign]
    newton = model.newton(force_tolerance=tolerance, limit=40)
    control = StepControl(first=1.0 / STEPS, smallest=1e-4, largest=1.0 / STEPS)
    stepper = Stepper(model, newton, control, observe=after)
    model.comm.barrier()
    start, started = perf_counter(), process_time()
    stepper.run(1.0)
    seconds, processor = perf_counter() - start, process_time() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {
        "ranks": model.comm.size,
        "dofs": model.net.sizes["nodes"] * 6,
        "unknowns": newton.unknowns,
        "steps": stepper.number,
        "newton_iterations": newton.iterations,
        "factorisations": newton.factorisations,
        "residuals": model.system.assemblies["residual"],
        "tangents": model.system.assemblies["tangent"],
        "solve_seconds": round(seconds, 3),
        "loop_cpu_seconds": round(model.comm.allreduce(processor), 3),
        "peak_mb": round(model.comm.allreduce(peak), 1),
        "converged": True,
    }


def frame(n: int, sub: int) -> dict[str, Any]:
    """The sheared network."""
    net = network(n, sub)
    ends = net.ends.ravel()
    X = net.points[ends]

    def directions(g: float) -> tuple[np.ndarray, np.ndarray]:
        c, s = np.cos(g / 2.0), np.sin(g / 2.0)
        return np.array([c, s, 0.0]), np.array([s, c, 0.0])

    def displacement(time: float) -> np.ndarray:
        e1, e2 = directions(END_ANGLE * time)
        return X[:, :1] * e1 + X[:, 1:2] * e2 - X

    model = Model(
        net, SECTION, crossovers=CROSSINGS, supports=[Support(ends, (0, 1, 2), displacement)]
    )
    forces = []

    def work_rate(step: Any) -> None:
        g = END_ANGLE * step.time
        c, s = np.cos(g / 2.0) / 2.0, np.sin(g / 2.0) / 2.0
        rate = X[:, :1] * [-s, c, 0.0] + X[:, 1:2] * [c, -s, 0.0]
        forces.append(float(np.sum(model.reactions()[ends, :3] * rate)))

    cost = run(model, 1e-6, lambda time: None, work_rate)
    return {
        **cost,
        "force": forces[-1],
        "rigid_tows": n**2 * 50.0 * END_ANGLE,
    }


def sheet(n: int, sub: int) -> dict[str, Any]:
    """The hanging network."""
    net = network(n, sub)
    side = SPACING * (n + 1)
    clamped = np.flatnonzero((net.points[:, 1] < 1e-9) & (net.node_family == 0))
    model = Model(
        net, SECTION, crossovers=CROSSINGS, supports=[Support(clamped, (0, 1, 2, 3, 4, 5))]
    )
    weight = AREAL_WEIGHT * side**2 / len(net.points)
    loads = model.system.nodal_loads

    def load(time: float) -> None:
        loads[:, 2] = -weight * time

    # Round-off of the places, L times EA/h each and summed over n² crossings, stays below this.
    tolerance = 1e-7 * max(1.0, (n / 33) ** 2)
    cost = run(model, tolerance, load, lambda step: None)
    u = model.disc.gather_nodes(model.fields.u_n.x.array.reshape(-1, 3)[: model.disc.owned])

    def at(x: float) -> float:
        place = np.abs(net.points[:, 0] - x) + np.abs(net.points[:, 1] - side)
        place[net.node_family == 1] = np.inf
        return float(u[int(np.argmin(place)), 2])

    return {
        **cost,
        "z_corner": at(SPACING),
        "z_middle": at(SPACING * ((n + 1) // 2)),
    }


def main() -> None:
    """Run one problem and print its line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("problem", choices=["frame", "sheet"])
    parser.add_argument("--n", type=int, default=9)
    parser.add_argument("--sub", type=int, default=4)
    wanted = parser.parse_args()
    result = {"frame": frame, "sheet": sheet}[wanted.problem](wanted.n, wanted.sub)
    head = {
        "peer": "fabric_fenicsx",
        "problem": wanted.problem,
        "n": wanted.n,
        "sub": wanted.sub,
    }
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(head | result))


if __name__ == "__main__":
    main()
