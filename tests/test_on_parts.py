"""What ranks write each for itself, pieces for ParaView and parts of steps, and how it is read.

Parts are made here without ranks, by dealing out a net; under mpirun each rank has its own.
"""

from dataclasses import fields, replace

from mpi4py import MPI

import numpy as np
import pytest
import pyvista as pv
from on_ranks import pulled_at_corners, small_model
from solve import plain_net
from test_output import noise

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.axes import TowAxes
from fabric_fenicsx.fabric.part import Part
from fabric_fenicsx.output.paraview import TimeSeries
from fabric_fenicsx.output.steps import StepFile, remove_step, remove_torn, step_path, write_step
from fabric_fenicsx.solving.exchange import Copies, Gather, Table
from fabric_fenicsx.solving.partition import partition
from fabric_fenicsx.solving.seen import PLACES
from fabric_fenicsx.solving.snapshot import Snapshot, at_rest

NET = plain_net(5, 6, 4.0, 2)
WHOLE = Part.all_of(NET)
NONE = np.zeros(0, dtype=np.int64)
PUNCH = {"punch": np.array([1.0, 2.0, 3.0])}


def parts(count):
    """The net dealt out: cells by place, crossings by their number, the last part empty."""
    own = partition(NET, count - 1)
    crossings = np.arange(len(NET.crossings)) % (count - 1)
    return [
        WHOLE.cut(np.flatnonzero(own == k), np.flatnonzero(crossings == k), NONE)
        for k in range(count)
    ]


def seen_by(part, snapshot):
    """What of a snapshot belongs to a part."""
    own = part.numbers
    return replace(
        snapshot, **{name: getattr(snapshot, name)[own[PLACES[name]]] for name in PLACES}
    )


def test_every_array_of_a_snapshot_has_its_place():
    assert set(PLACES) == {field.name for field in fields(Snapshot)} - {"time"}


def test_a_part_is_a_net_of_its_own():
    for part in parts(4):
        np.testing.assert_array_equal(part.points, NET.points[part.nodes])
        np.testing.assert_array_equal(part.nodes[part.cells], NET.cells[part.cell_numbers])
        np.testing.assert_array_equal(
            part.nodes[part.crossings], NET.crossings[part.crossing_numbers]
        )
        np.testing.assert_array_equal(part.cell_tow, NET.cell_tow[part.cell_numbers])
    again = WHOLE.cut(np.arange(len(NET.cells)), np.arange(len(NET.crossings)), NONE)
    for name in ("points", "cells", "crossings", "cell_tow", "ends", "normals"):
        for whole in (WHOLE, again):
            np.testing.assert_array_equal(getattr(whole, name), getattr(NET, name))


def test_directions_of_some_crossings_are_those_of_the_net():
    displacement = np.random.default_rng(2).normal(size=NET.points.shape)
    whole = TowAxes.of(NET, (0, 1)).at(displacement)
    for part in parts(4):
        some = TowAxes.of(NET, (0, 1), crossings=part.crossing_numbers)
        nodes = np.unique(some.nodes)
        found = some.at_nodes(nodes).at(displacement[nodes])
        np.testing.assert_array_equal(found, whole[part.crossing_numbers])


def series_of(folder, own, **more):
    """The series of all ranks, what each writes in a list; rank 0 is the last to write."""
    return [
        TimeSeries(folder, part, rank=k, ranks=len(own), crossings=True, **more)
        for k, part in enumerate(own)
    ]


def add(series, own, snapshot):
    for each, part in reversed(list(zip(series, own, strict=True))):
        each.last = series[0].last
        each.add(seen_by(part, snapshot), PUNCH)


def last_of(folder, name):
    reader = pv.PVDReader(folder / f"{name}.pvd")
    reader.set_active_time_value(reader.time_values[-1])
    return reader.read()[0]


def sorted_cells(mesh, name):
    """Centres of the cells, and an array of them or of their points' means, in one order."""
    cells = mesh if name in mesh.cell_data else mesh.point_data_to_cell_data()
    centres = mesh.cell_centers().points
    order = np.lexsort(np.round(np.column_stack([cells["family"], centres]), 6).T)
    return centres[order], np.asarray(cells[name])[order]


def test_pieces_for_paraview_are_the_file_of_one_rank(tmp_path):
    """One of four has nothing at all."""
    own, snapshot = parts(4), noise(NET, 0.5)
    add(series_of(tmp_path / "four", own), own, snapshot)
    TimeSeries(tmp_path / "one", NET).add(snapshot, PUNCH)
    one, four = (last_of(tmp_path / n, "tows") for n in ("one", "four"))
    assert four.n_cells == one.n_cells == len(NET.cells)
    # Nodes of two pieces stand in both, other ends of crossings in none.
    assert one.n_points < four.n_points <= sum(len(np.unique(part.cells)) for part in own)
    assert set(one.array_names) == set(four.array_names)
    for name in ("section_moments", "tow", "displacement", "d2", "contact_pressure"):
        for a, b in zip(sorted_cells(four, name), sorted_cells(one, name), strict=True):
            np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-14, err_msg=name)
    one, four = (last_of(tmp_path / n, "crossings") for n in ("one", "four"))
    orders = [np.lexsort(np.round(mesh.points, 6).T) for mesh in (one, four)]
    for name in ("displacement", "shear_angle_deg", "moment"):
        a, b = (mesh[name][order] for mesh, order in zip((one, four), orders, strict=True))
        np.testing.assert_array_equal(b, a, err_msg=name)


def test_a_series_goes_on_with_other_pieces(tmp_path):
    """From four ranks to one and back, cut in between; what is cut leaves no piece."""
    own = parts(4)
    series = series_of(tmp_path, own)
    for time in (0.1, 0.2, 0.3):
        add(series, own, noise(NET, time))
    one = TimeSeries(tmp_path, NET, resume=True, until=0.2)
    assert not list(tmp_path.glob("*_00002.*"))
    one.add(at_rest(NET, 0.25))
    again = series_of(tmp_path, own, resume=True)
    assert again[0].times == [0.1, 0.2, 0.25]
    add(again, own, noise(NET, 0.4))
    names = [path.name for path in sorted(tmp_path.glob("tows_*")) if path.suffix != ".pvd"]
    pieces = [f"tows_{n:05d}.{k}.vtu" for n in (0, 1, 3) for k in range(4)]
    indices = [f"tows_{n:05d}.pvtu" for n in (0, 1, 3)]
    assert names == sorted([*pieces, *indices, "tows_00002.vtu"])
    reader = pv.PVDReader(tmp_path / "tows.pvd")
    assert reader.time_values == [0.1, 0.2, 0.25, 0.4]
    for time in reader.time_values:
        reader.set_active_time_value(time)
        assert reader.read()[0].n_cells == len(NET.cells)


def test_no_step_before_all_pieces_are_there(tmp_path):
    """Rank 0 of two ends while it waits for the other: the series opens without that step."""
    own = parts(2)
    series = series_of(tmp_path, own)
    add(series, own, noise(NET, 0.1))

    def ended():
        raise KeyboardInterrupt

    series[0]._wait = ended
    with pytest.raises(KeyboardInterrupt):
        series[0].add(seen_by(own[0], noise(NET, 0.2)))
    assert pv.PVDReader(tmp_path / "tows.pvd").time_values == [0.1]
    assert series_of(tmp_path, own, resume=True)[0].times == [0.1]
    assert not list(tmp_path.glob("*_00001*"))


def step_of(folder, own, number=1, wait=lambda: None):
    """A step of several ranks, of arrays that say whose they are; rank 0 comes last."""
    folder.mkdir(exist_ok=True)
    path = step_path(folder, number)
    for rank, part in reversed(list(enumerate(own))):
        before = [other.nodes for other in own[:rank]]
        owned = part.numbers | {"nodes": np.setdiff1d(part.nodes, np.concatenate([NONE, *before]))}
        rows = {
            where: {f"of {where}": np.column_stack([n, 10.0 * n]), f"more of {where}": -n}
            for where, n in owned.items()
        }
        alike = {"time": np.array(0.5)}
        write_step(path, alike, rows, owned, rank=rank, ranks=len(own), wait=wait)
    return path


@pytest.mark.parametrize("count", [1, 4])
def test_rows_of_a_step_are_found_whoever_wrote_them(tmp_path, count):
    path = step_of(tmp_path, [WHOLE] if count == 1 else parts(count))
    sizes = {"nodes": NET.points, "cells": NET.cells, "crossings": NET.crossings}
    with StepFile(path) as file:
        assert float(file["time"]) == 0.5
        assert len(file.names) == 7
        for where, size in ((where, len(all_of)) for where, all_of in sizes.items()):
            np.testing.assert_array_equal(file[f"more of {where}"], -np.arange(size))
            some = np.random.default_rng(1).permutation(size)[: size // 2]
            rows, _ = file.rows(f"of {where}", some, size)
            np.testing.assert_array_equal(rows, np.column_stack([some, 10.0 * some]))
            assert len(file[f"of {where}"]) == size
            with pytest.raises(IndexError):
                file.rows(f"of {where}", np.array([0, size]), size)
            rows, shape = file.rows(f"of {where}", some, size + 1)
            assert (len(rows), shape) == (0, (size, 2))


def test_a_step_is_there_when_all_ranks_have_written_it(tmp_path):
    own = parts(4)

    def ended():
        raise KeyboardInterrupt

    step_of(tmp_path, own, 1)
    with pytest.raises(KeyboardInterrupt):
        step_of(tmp_path, own, 2, wait=ended)
    assert [path.name for path in tmp_path.glob("*.npz")] == ["step_00001.npz"]
    remove_torn(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["step_00001", "step_00001.npz"]
    remove_step(tmp_path / "step_00001.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.mpi
def test_rows_travel_between_ranks():
    """Copies at any nodes and gathered rows are those of the net; also a number that all have."""
    comm = MPI.COMM_WORLD
    model = small_model(comm)
    disc, points = model.disc, plain_net(3, 4, 4.0, 2).points
    np.testing.assert_array_equal(model.net.points, points[model.net.nodes])
    own = points[disc.numbers["nodes"]]
    found = Copies(comm, disc.owned, disc.node_block, 3)(own)
    np.testing.assert_array_equal(found, model.net.points)
    nodes = np.random.default_rng(comm.rank).permutation(len(points))[:7]
    table = Table(comm, len(points), disc.numbers["nodes"], own)
    np.testing.assert_array_equal(table.at(nodes), points[nodes])
    assert len(table.share) <= len(points) // comm.size + 1
    part = disc.part
    gather = Gather(comm, part.nodes)
    np.testing.assert_array_equal(gather(part.points), points)
    last = comm.size - 1
    there = gather(part.points, to=last)
    np.testing.assert_array_equal(there, points if comm.rank == last else points[:0])


@pytest.mark.mpi
def test_a_rank_sees_its_part_of_the_whole():
    """Own snapshots are what one rank sees at the same numbers, to the solver's tolerance."""
    comm = MPI.COMM_WORLD
    states = {}
    for name, on in (("alone", MPI.COMM_SELF), ("together", comm)):
        model = small_model(on)
        pulled_at_corners(model, [0.1, 0.0, 0.3], [0.2, 0.1, -0.4])
        states[name] = model, model.own_snapshot(1.0)
    alone = states["alone"][1]
    model, own = states["together"]
    whole = model.whole(own)
    own.check(model.disc.part)
    wanted = seen_by(model.disc.part, alone)
    for name in PLACES:
        size = np.abs(getattr(alone, name)).max()
        for found, expected in ((own, wanted), (whole, alone)):
            np.testing.assert_allclose(
                getattr(found, name), getattr(expected, name), atol=1e-6 * size, err_msg=name
            )
    np.testing.assert_array_equal(model.axes_angles(), whole.shear_angle)


@pytest.mark.mpi
def test_a_folder_that_a_rank_does_not_see_is_refused(tmp_path, monkeypatch):
    from fabric_fenicsx.output import record

    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    is_dir = type(folder).is_dir
    last = comm.rank == comm.size - 1
    monkeypatch.setattr(
        type(folder), "is_dir", lambda path: is_dir(path) and not (last and path.name == "steps")
    )
    with pytest.raises(InputError, match="shared folder"):
        record.Record(folder, small_model(comm))
