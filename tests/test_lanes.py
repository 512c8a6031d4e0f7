"""Kernels for several cells at a time: against those of dolfinx for one."""

import logging

from mpi4py import MPI

import numpy as np
import pytest
import ufl
from on_ranks import small_model
from test_rigs import SMALL, session

from fabric_fenicsx import _dolfinx
from fabric_fenicsx._dolfinx import forms, lanes
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.solving import discretisation
from fabric_fenicsx.solving.condensation import Blocks
from fabric_fenicsx.solving.tangent import _pattern, _places, _stored_blocks

NODES = {"quadrature_rule": "GLL", "quadrature_degree": 1}
MIDDLE = {"quadrature_degree": 0}


@pytest.fixture
def wide(monkeypatch):
    """Kernels of each iteration are compiled for several cells at a time in every net."""
    monkeypatch.setattr(discretisation, "MANY_OFTEN", 1)


def chain(cells):
    """A crooked chain of cells with random fields on it, and the fields."""
    rng = np.random.default_rng(cells)
    nodes = np.arange(cells)
    mesh = _dolfinx.interval_mesh(
        MPI.COMM_SELF, rng.random((cells + 1, 3)), np.column_stack([nodes, nodes + 1])
    )
    space = _dolfinx.lagrange(mesh, 6)
    fields = [_dolfinx.Function(s) for s in (space, _dolfinx.constants_per_cell(mesh, 3))]
    for field in fields:
        field.x.array[:] = rng.normal(size=len(field.x.array))
    return mesh, space, fields


def integrands(mesh, space, fields):
    """What kernels are made of: choices within choices, roots, powers, functions, constants."""
    f, g = fields
    c = _dolfinx.constant(mesh, (1.0, -2.0, 0.5))
    v = ufl.TestFunction(space)
    inner_choice = ufl.conditional(ufl.lt(f[0], f[2]), ufl.sqrt(abs(f[1])), 2.0)
    choice = ufl.conditional(
        ufl.And(ufl.gt(f[0], 0.0), ufl.Not(ufl.gt(f[1], 0.5))), f[3] ** 2, inner_choice
    )
    first = choice * v[0] + ufl.max_value(f[4], g[0]) * v[1] + ufl.min_value(f[4], c[1]) * v[2]
    second = _dolfinx.atan2(f[2], f[3]) * v[3] + ufl.sin(f[0]) * ufl.exp(g[1]) * v[4]
    third = ufl.dot(g, c) ** 3 / ufl.CellVolume(mesh) * v[5]
    return (first + second) * ufl.dx(metadata=NODES) + third * ufl.dx(metadata=MIDDLE)


# Fewer cells than lanes, as many, and some left over.
@pytest.mark.parametrize("cells", [1, 4, 11])
def test_a_linear_form_is_the_same_by_lanes(cells):
    mesh, space, fields = chain(cells)
    form = integrands(mesh, space, fields)
    found = []
    for wide in (False, True):
        compiled = _dolfinx.compile_form(form, MPI.COMM_SELF, wide=wide)
        assert [part.lanes is not None for part in compiled] == [wide, wide]
        values = np.ones(len(fields[0].x.array))
        _dolfinx.add_vector(values, compiled)
        found.append(values)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-13, atol=1e-13)
    assert np.abs(found[0] - 1.0).max() > 0.1


def test_values_are_those_of_the_moment():
    mesh, space, fields = chain(5)
    compiled = _dolfinx.compile_form(integrands(mesh, space, fields), MPI.COMM_SELF, wide=True)
    before, after = np.zeros((2, len(fields[0].x.array)))
    _dolfinx.add_vector(before, compiled)
    fields[0].x.array[:] += 0.1
    _dolfinx.add_vector(after, compiled)
    assert np.abs(after - before).max() > 0.01


def test_a_sum_over_cells_is_the_same_by_lanes():
    mesh, _, fields = chain(7)
    space = _dolfinx.constants_per_cell(mesh, 2)
    v = ufl.TestFunction(space)
    form = (fields[0][0] ** 2 * v[0] + fields[1][2] * v[1]) * ufl.dx(metadata=NODES)
    sums = [
        _dolfinx.cell_sums(compiled, space, _dolfinx.pack(compiled))
        for compiled in (
            _dolfinx.compile_form(form, MPI.COMM_SELF, wide=wide) for wide in (False, True)
        )
    ]
    np.testing.assert_allclose(sums[1], sums[0], rtol=1e-13)


def test_a_source_of_another_kind_is_refused():
    with pytest.raises(ValueError, match="no kernel"):
        lanes.wide_source("void other(double* A)\n{\n}\n", "wanted", [], [(2, 6)])
    with pytest.raises(ValueError, match="choice"):
        lanes.wide_source("void wanted(double* A)\n{\na ? b\n}\n", "wanted", [], [(2, 6)])


def test_without_a_compiler_for_cpp_kernels_take_one_cell(monkeypatch, caplog):
    mesh, space, fields = chain(3)
    monkeypatch.setattr(lanes, "built", lambda *_, **__: None)
    forms._say_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        compiled = _dolfinx.compile_form(integrands(mesh, space, fields), MPI.COMM_SELF, wide=True)
    assert ["one cell" in record.message for record in caplog.records] == [True]
    values = np.zeros(len(fields[0].x.array))
    _dolfinx.add_vector(values, compiled)
    assert all(part.lanes is None for part in compiled)
    assert not _dolfinx.has_blocks(compiled)
    assert values.any()


@pytest.mark.mpi
@pytest.mark.parametrize("symmetric", [True, False], ids=["symmetric", "unsymmetric"])
def test_a_tangent_by_blocks_is_the_one_by_petsc(wide, symmetric):
    model = small_model(MPI.COMM_WORLD)
    disc, system = model.disc, model.system
    x = disc.vector()
    x.array[:] = 1e-3 * np.random.default_rng(disc.comm.rank).normal(size=len(x.array))
    system.set_increment(x)
    A = disc.own_matrix(symmetric=symmetric)
    system.tangent(A)
    wanted = _stored_blocks(A).copy().reshape(-1, 6, 6)
    assert system.in_blocks
    found = np.ones_like(wanted)
    system.tangent_blocks(found, _places(disc, A, symmetric))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert len(Blocks(*_pattern(A), symmetric).pairs[0]) == len(wanted)


def test_a_moment_on_a_node_is_petscs(wide):
    system = small_model(MPI.COMM_SELF).system
    assert system.in_blocks
    system.nodal_loads[0, 4] = 1.0
    assert not system.in_blocks


@pytest.mark.mpi
def test_a_drape_takes_the_same_iterations_by_lanes(wide, monkeypatch, tmp_path):
    case = DrapeCase.model_validate(
        SMALL | {"symmetry": "quarter", "contact": {"friction": 0.2}, "holder_force_N": 20,
                 "punch_travel_mm": 4, "duration_s": 4}
    )  # fmt: skip
    one = drape.run(case, session(tmp_path))
    monkeypatch.setattr(discretisation, "MANY_OFTEN", 10**9)
    other = drape.run(case, session(tmp_path))
    assert one["newton_iterations"] == other["newton_iterations"]
    for name in ("punch_force_N", "holder_height_mm", "lowest_point_mm"):
        assert one["quantities"][name] == pytest.approx(other["quantities"][name], rel=1e-8)
