"""A small net on however many ranks run this: norms, forces and a solved state as JSON on rank 0.

The state that the tangent is assembled at is given per node of the net, so that nothing depends on
how the net is distributed. Run by test_crossover under mpirun, and imported by it.
"""

import json

from mpi4py import MPI

import numpy as np
from solve import GivenSection, Statics, plain_net, set_loads, set_state

from fabric_fenicsx.fabric.chains import net_from_lines
from fabric_fenicsx.solving import discretisation
from fabric_fenicsx.solving.model import CrossoverLaw, Model, Support
from fabric_fenicsx.solving.remainder import ByFronts

SECTION = GivenSection((400.0, 150.0, 150.0, 60.0, 50.0, 90.0))
LAW = CrossoverLaw(translation=40.0, k1=5.0, k3=2.0, dashpot=3.0, alignment=8.0)


def small_model(comm):
    """A net of 3 x 4 tows, clamped at the warps' feet."""
    net = plain_net(3, 4, 4.0, 2)
    feet = net.ends[net.tow_family == 0, 0]
    supports = [Support(feet, (0, 1, 2, 3, 4, 5))]
    return Model(net, SECTION, crossovers=LAW, supports=supports, comm=comm)


def tangent_norm(comm, *, crossings=True):
    """Frobenius norm of the tangent at a bent state, and the norm of the residual there."""
    model = small_model(comm)
    disc, system = model.disc, model.system
    rng = np.random.default_rng(5)
    n = model.net.sizes["nodes"]
    u, q, w = rng.normal(size=(n, 3)), np.ones((n, 4)), 0.1 * rng.normal(size=(n, 6))
    q[:, 1:] = 0.2 * rng.normal(size=(n, 3))
    set_state(model, 0.3 * u, q / np.linalg.norm(q, axis=1)[:, None])
    model.set_time(0.0, 0.5)
    x, F = disc.vector(), disc.vector()
    x.array[:] = w[disc.local_nodes[: disc.owned]].ravel()
    # Twice: about x itself, so that the section forces are the current ones.
    for _ in range(2):
        system.set_increment(x, linearise_from="last")
    A = disc.matrix(crossings=crossings)
    system.tangent(A)
    system.residual(F)
    return A.norm(), F.norm()


def pulled_at_corners(model, *forces):
    """Statics of a net after three steps to a force at the end of its first and its last warp."""
    statics = Statics(model, force_tolerance=1e-10)
    top = model.net.numbers["nodes"][model.net.ends[model.net.tow_family == 0, 1]]

    def load(part):
        for node, force in zip((top[0], top[-1]), forces, strict=True):
            set_loads(model, node, part * np.array([*force, 0.0, 0.0, 0.0]))

    statics.run(3, load)
    return statics


def solved(comm):
    """Displacements and shear angles of the net under two corner forces."""
    model = small_model(comm)
    statics = pulled_at_corners(model, [0.1, 0.0, 0.3], [0.2, 0.1, -0.4])
    model.system.set_increment(model.disc.vector())
    return statics.displacements, model.shear_angles()


def cross_of_two_cells(comm):
    """Displacements of one warp and one weft cell joined at their ends, pulled at the weft's."""
    points = np.array([[-4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -4.0, 0.0]])
    net, _ = net_from_lines(points, np.array([[1, 2]]), np.array([[0, 1]]))
    foot, tip = net.ends[0, :1], int(net.ends[1, 0])
    supports = [Support(foot, (0, 1, 2, 3, 4, 5))]
    statics = Statics(
        Model(net, SECTION, crossovers=LAW, supports=supports, comm=comm), force_tolerance=1e-10
    )
    statics.run(2, lambda part: set_loads(statics.model, tip, part * 0.1 * np.eye(6)[2]))
    return statics.displacements


def by_fronts(comm):
    """A larger net under its corners' forces: condensed, factorised by fronts, kernels by lanes.

    Returns:
        Displacements, iterations, what factorised and unknowns of the ranks' edges.
    """
    discretisation.MANY_OFTEN = 1
    net = plain_net(8, 8, 4.0, 2)
    feet = net.ends[net.tow_family == 0, 0]
    supports = [Support(feet, (0, 1, 2, 3, 4, 5))]
    model = Model(net, SECTION, crossovers=LAW, supports=supports, comm=comm)
    assert model.system.in_blocks
    statics = pulled_at_corners(model, [0.02, 0.0, 0.05], [0.03, 0.02, -0.06])
    newton = statics.stepper.newton
    solver = newton._tangents[True]._solver
    edge = len(solver._dense) if isinstance(solver, ByFronts) else None
    return statics.displacements, newton.iterations, type(solver).__name__, edge


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    norm, residual = tangent_norm(world)
    displacements, gamma = solved(world)
    cross = cross_of_two_cells(world)
    fronts, iterations, solver, edge = by_fronts(world)
    if world.rank == 0:
        found = {
            "ranks": world.size,
            "tangent": norm,
            "residual": residual,
            "displacements": displacements.tolist(),
            "gamma": gamma.tolist(),
            "cross": cross.tolist(),
            "fronts": fronts.tolist(),
            "iterations": iterations,
            "solver": solver,
            "edge": edge,
        }
        print(json.dumps(found))
