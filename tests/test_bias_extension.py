"""Bias extension: the trellis of a strip in closed form, and the net's own state against it."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from solve import matrix, random_rotation

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.axes import TowAxes, axes_shear
from fabric_fenicsx.fabric.bias_strip import BiasStrip
from fabric_fenicsx.fabric.gmsh_io import mesh_net
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.rigs import bias_extension
from fabric_fenicsx.rigs.bias_extension import BiasExtensionCase
from fabric_fenicsx.rigs.common import Session, fabric_model
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.solving.model import Support
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SMALL = {
    "test": "bias_extension",
    "length_mm": 100,
    "width_mm": 40,
    "warp_spacing_mm": 4.7,
    "weft_spacing_mm": 4.7,
    "travel_mm": 12,
    "rate_mm_min": 60,
    "tow": {"per_width_mm": 12},
    "crossover": {"dashpot_N_s_mm": 0},
    "solver": {"first_step_s": 3, "largest_step_s": 3, "force_tolerance_N": 1e-6},
}
# Tows that hardly bend in the plane, so that the crossings carry all.
SOFT = {
    "tow": {
        "per_width_mm": 12,
        "relaxation_time_s": 0,
        "stiffness": {"bending_in_plane_Nmm": 0.001},
    }
}


def session(folder, comm=MPI.COMM_SELF):
    return Session(folder, comm, folder, perf_counter(), pictures=False)


def pulled(folder, comm=MPI.COMM_SELF, **keys):
    """Last row of curve.csv, and the content of result.json."""
    case = BiasExtensionCase.model_validate({**SMALL, **keys})
    result = bias_extension.run(case, session(folder, comm))
    assert result["completed"]
    comm.barrier()
    return pd.read_csv(folder / "curve.csv").iloc[-1], result


# The trellis ---------------------------------------------------------------------------------


def test_formula_by_hand():
    """At γ = 30° in A tows are 60° apart: D + d = √2 D cos 30° with D = L − W = 100 mm."""
    strip = BiasStrip(200.0, 100.0)
    travel = 100.0 * (np.sqrt(2.0) * np.cos(np.pi / 6.0) - 1.0)
    assert strip.angle(travel) == pytest.approx(np.pi / 6.0)
    assert strip.angle(0.0) == pytest.approx(0.0)
    classical = np.pi / 2.0 - 2.0 * np.arccos((100.0 + 12.0) / (np.sqrt(2.0) * 100.0))
    assert strip.angle(12.0) == pytest.approx(classical)
    assert np.isnan(strip.angle(42.0))  # beyond (√2 − 1) D


def imposed(bias, travel=20.0):
    """A net of constant shear in each zone: strip, net, its places, angles [rad], zones.

    Angles are between chords; which crossings lie two spacings within a zone comes last.
    """
    strip = BiasStrip(250.0, 100.0, bias)
    net = mesh_net(strip.layout((2.5 * np.sqrt(2.0),) * 2))
    places = strip.places(net.points, travel)
    at = net.points[net.crossings[:, 0]]
    zone = strip.gripped(at)
    steps = (-8.0, -4.0, 4.0, 8.0)
    near = [strip.gripped(at + np.append(k * axis, 0.0)) for axis in strip.tows for k in steps]
    inner = (np.array(near) == zone).all(axis=0)
    gamma = axes_shear(TowAxes.of(net, reach=1).at(places - net.points))
    return strip, net, places, gamma, zone, inner


@pytest.mark.parametrize("bias", [45.0, 35.0])
def test_constant_shear_has_the_formulas_angle(bias):
    """Imposed on a net: tows keep their length, clamps turn none, and A has the formula's angle.

    In C the angle is zero, and in B the two families' turns, which add up to that of A and are
    halves of it at 45°.
    """
    travel = 20.0
    strip, net, places, gamma, zone, inner = imposed(bias, travel)
    exact = strip.angle(travel)
    assert inner[zone == 0].sum() > 50
    assert gamma[inner & (zone == 0)] == pytest.approx(exact, abs=1e-12)
    assert gamma[inner & (zone == 2)] == pytest.approx(0.0, abs=1e-12)
    turns = np.unique(gamma[inner & (zone == 1)].round(9))
    assert turns[[0, -1]].sum() == pytest.approx(exact, abs=1e-8)
    assert len(turns) == (1 if bias == 45.0 else 2)
    for side in (-1.0, 1.0):
        clamp = side * net.points[:, 1] > strip.length / 2.0 - 1e-9
        moved = (places - net.points)[clamp]
        assert moved == pytest.approx(np.tile([0.0, side * travel / 2.0, 0.0], (len(moved), 1)))
    lengths = np.linalg.norm(np.diff(places[net.cells], axis=1)[:, 0], axis=1)
    ends = strip.gripped(net.points)[net.cells]
    whole = ends[:, 0] == ends[:, 1]  # not across a border
    assert lengths[whole] == pytest.approx(net.lengths[whole])


def test_energy_of_the_zones():
    """F dd = Σ A m dγ: the formula against a difference quotient over areas counted on a net."""
    strip = BiasStrip(250.0, 100.0)
    spacings = strip.fitted(3.5, 3.5)
    net = mesh_net(strip.layout(spacings))
    at = net.points[net.crossings[:, 0]]
    area = strip.shares(at, spacings) * spacings[0] * spacings[1]
    # All of the strip but the gaps in its four corners, in which no tows cross.
    assert area.sum() == pytest.approx(strip.length * strip.width, rel=1e-3)
    # Crossings on the borders belong to both zones.
    inside, closed = (strip.gripped((1.0 + e) * at) for e in (1e-6, -1e-6))

    def energy(gamma):
        return 0.01 * gamma**2 + 0.02 * gamma**4

    def stored(travel):
        gamma = strip.angle(travel)
        of = np.array([energy(gamma), energy(gamma / 2.0), 0.0])
        return float(area @ (of[inside] + of[closed]) / 2.0)

    def moment(gamma):
        return 0.02 * gamma + 0.08 * gamma**3

    travel, step = np.array([5.0, 20.0, 40.0]), 1e-4
    work = [(stored(d + step) - stored(d - step)) / (2.0 * step) for d in travel]
    assert strip.force(moment, strip.angle(travel)) == pytest.approx(work, rel=5e-3)


@pytest.mark.parametrize("length", [200.0, 300.0])
def test_moment_of_a_curve(length):
    """The energy's balance solved for m gives back the m that the force was made of."""
    strip = BiasStrip(length, 100.0)
    gamma = np.linspace(0.0, 1.0, 2001)[1:]

    def moment(angle):
        return 0.02 * angle + 0.08 * angle**3

    back = strip.moment(gamma, strip.force(moment, gamma))
    assert back == pytest.approx(moment(gamma), rel=1e-5, abs=1e-8)


def test_what_a_strip_cannot_be():
    with pytest.raises(ValueError, match="no tow runs from clamp to clamp"):
        BiasStrip(100.0, 100.0)
    with pytest.raises(ValueError, match="from twice the width on"):
        BiasStrip(150.0, 100.0).force(np.sin, np.array([0.1]))
    with pytest.raises(ValueError, match="must increase"):
        BiasStrip(200.0, 100.0).moment(np.array([0.2, 0.1]), np.ones(2))


# The net -------------------------------------------------------------------------------------


def refined(folder):
    """A strip of 40 x 100 mm pulled by 16 mm, with 4, 8 and 16 meshes' diagonals over its width.

    Returns:
        Forces [N], angles of A [°] and works [N mm], (3, 3), their limits, and the same of constant
        shear in each zone.
    """
    strip = BiasStrip(100.0, 40.0)
    found = []
    for diagonals in (4, 8, 16):
        spacing = 40.0 / diagonals / np.sqrt(2.0)
        own = folder / str(diagonals)
        own.mkdir()
        last, _ = pulled(
            own, warp_spacing_mm=spacing, weft_spacing_mm=spacing, travel_mm=16, **SOFT
        )
        work = pd.read_csv(own / "steps.csv")["stored_N_mm"].iloc[-1]
        found.append([last["force_N"], last["shear_angle_deg"], work])
    values = np.transpose(found)
    travel = np.linspace(0.0, 16.0, 1001)[1:]
    exact = strip.force(lambda gamma: 0.02 * gamma + 0.08 * gamma**3, strip.angle(travel))
    bounds = exact[-1], np.degrees(strip.angle(travel[-1])), np.sum(exact) * travel[0]
    return values, 2.0 * values[:, -1] - values[:, -2], bounds


def test_converges_with_spacing_to_less_than_constant_shear(tmp_path):
    """Force and angle are of first order in the spacing: each halving halves the change.

    The ratio is 2 up to terms of second order, here a tenth of it. Tows could take the motion of
    constant shear in each zone, so by the theorem of least energy their own costs less work, by
    some per cent; and its zone A shears less.
    """
    found, limit, bounds = refined(tmp_path)
    for values in found[:2]:
        change = np.diff(values)
        assert change[0] / change[1] == pytest.approx(2.0, rel=0.15)
    assert (limit < bounds).all()
    assert limit == pytest.approx(bounds, rel=0.05)


def test_mirrored_strip(tmp_path):
    """A strip at 35° with its mirror image, at 55° with warp and weft exchanged."""
    rows = []
    for bias, spacings in ((35.0, (4.4, 5.0)), (55.0, (5.0, 4.4))):
        folder = tmp_path / str(bias)
        folder.mkdir()
        keys = {"bias_deg": bias, "length_mm": 110}
        row, _ = pulled(folder, warp_spacing_mm=spacings[0], weft_spacing_mm=spacings[1], **keys)
        rows.append(row)
    assert rows[1].to_numpy() == pytest.approx(rows[0].to_numpy(), rel=1e-6, abs=1e-8)
    assert rows[0]["shear_angle_deg"] > 20.0


def clamped_and_pulled(net, upper, lower, direction):
    """Force on the clamp along the pull [N], in three steps of 4 mm."""
    case = BiasExtensionCase.model_validate(SMALL)
    every = (0, 1, 2, 3, 4, 5)

    def move(time):
        return np.tile(time * direction, (len(upper), 1))

    held = [Support(lower, every), Support(upper, every, move)]
    model = fabric_model(case, net, case.spacings, session(Path(), MPI.COMM_SELF), supports=held)
    forces = []

    def observe(step):
        forces.append(model.reactions()[upper, :3].sum(axis=0) @ direction)

    newton = model.newton(force_tolerance=1e-8, limit=15)
    Stepper(model, newton, StepControl(4.0, 1e-3, 4.0), observe=observe).run(12.0)
    return np.array(forces)


def test_turned_and_renumbered():
    """A rigid turn in space and tows that run the other way change no force."""
    case = BiasExtensionCase.model_validate(SMALL)
    net = mesh_net(case.strip.layout(case.spacings))
    lower, upper = bias_extension.clamps(net, case)
    pull = np.array([0.0, 1.0, 0.0])
    force = clamped_and_pulled(net, upper, lower, pull)
    assert len(force) == 3
    R = matrix(random_rotation(np.random.default_rng(3))[1])
    turned = replace(net, points=net.points @ R.T, normals=net.normals @ R.T)
    assert clamped_and_pulled(turned, upper, lower, R @ pull) == pytest.approx(force, rel=1e-7)
    last = len(net.points) - 1
    back = Net(
        points=net.points[::-1].copy(),
        cells=last - net.cells[::-1, ::-1],
        cell_tow=net.cell_tow[::-1].copy(),
        tow_family=net.tow_family,
        crossings=last - net.crossings,
        ends=last - net.ends[:, ::-1],
        normals=net.normals[::-1].copy(),
    )
    again = clamped_and_pulled(back, last - upper, last - lower, pull)
    assert again == pytest.approx(force, rel=1e-7)


@pytest.mark.mpi
def test_two_ranks_equal_one(tmp_path):
    """Under mpirun on two: every column of the curve, with slip, which remembers."""
    world = MPI.COMM_WORLD
    folder = Path(world.bcast(str(tmp_path)))
    keys = {"crossover": {**SMALL["crossover"], "translation_N_mm": 10, "slip_limit_N": 0.05}}
    if world.rank == 0:
        (folder / "one").mkdir()
        (folder / "all").mkdir()
        pulled(folder / "one", **keys)
    world.barrier()
    pulled(folder / "all", world, **keys)
    if world.rank == 0:
        one, other = (pd.read_csv(folder / name / "curve.csv") for name in ("one", "all"))
        assert one["largest_slip_mm"].iloc[-1] > 0.1
        assert other.to_numpy() == pytest.approx(one.to_numpy(), rel=1e-6, abs=1e-6)


def test_a_mesh_of_another_strip_is_refused():
    case = BiasExtensionCase.model_validate(SMALL | {"mesh": "own.msh"})
    shorter = mesh_net(BiasStrip(90.0, 40.0).layout(case.spacings))
    with pytest.raises(InputError, match=r"^mesh: no node in a clamp, allowed is .* -50 and 50$"):
        bias_extension.clamps(shorter, case)
    sides = shorter.points[shorter.crossings[:, 0], 0] > 0.4 * 40.0
    beside = replace(shorter, crossings=shorter.crossings[sides])
    with pytest.raises(InputError, match=r"^mesh: no crossing about the origin"):
        bias_extension.middle_zone(beside, case)
    # Of a strip of its own keys they say what to change.
    narrow = {"bias_deg": 30, "length_mm": 300, "width_mm": 20}
    meshes = {"warp_spacing_mm": 40, "weft_spacing_mm": 40}
    case = BiasExtensionCase.model_validate(SMALL | narrow | meshes)
    with pytest.raises(InputError, match=r"^width_mm: 20 with tows 40 and 40 mm apart \(warp_spa"):
        bias_extension.clamps(mesh_net(case.strip.layout(case.spacings)), case)


def test_bending_in_the_plane_by_default():
    """That of loose fibres, also where another stiffness is given; null asks for the section's."""
    for stiffness, bending in (({}, 0.1), ({"stretch_N_mm": 500}, 0.1), (None, None)):
        case = BiasExtensionCase.model_validate(SMALL | {"tow": {"stiffness": stiffness}})
        assert case.tow.stiffness.bending_in_plane_Nmm == bending


def test_goes_on_where_it_stopped(tmp_path):
    """Cut at half its travel and resumed, a run with slip ends as the whole one."""
    keys = {"crossover": {**SMALL["crossover"], "translation_N_mm": 10, "slip_limit_N": 0.05}}
    whole, _ = pulled(tmp_path, **keys)
    files = sorted((tmp_path / "steps").glob("*.npz"))
    for file in files[len(files) // 2 :]:
        file.unlink()
    case = BiasExtensionCase.model_validate({**SMALL, **keys})
    again = bias_extension.run(case, replace(session(tmp_path), resume=True))
    assert again["completed"]
    end = pd.read_csv(tmp_path / "curve.csv").iloc[-1]
    assert end.to_numpy() == pytest.approx(whole.to_numpy(), rel=1e-6)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("length_mm: 105", "length_mm: at least 107.35, so that two tows of each family end in no"),
        (
            "length_mm: 30\nwidth_mm: 20",
            "length_mm: 30, allowed is at least 33.333 where the strip is 20 mm wide and tows are "
            "4.71 mm apart (warp_spacing_mm, weft_spacing_mm): no crossing would lie about its",
        ),
        (
            "width_mm: 20\nwarp_spacing_mm: 40\nweft_spacing_mm: 40",
            "width_mm: 20, allowed is at least 28.3 with tows 40 mm apart (warp_spacing_mm, ",
        ),
        ("bias_deg: 90", "bias_deg: 90, allowed is a number greater than 0"),
        ("warp_spacing_mm: 1.0e-5", "at most 4000000 are allowed"),
        ("slip: 1", "slip: unknown key"),
        ("travel_mm: -1", "travel_mm: -1, allowed is a number greater than 0"),
    ],
)
def test_bad_input_is_one_line(tmp_path, keys, said):
    path = tmp_path / "case.yaml"
    path.write_text(f"test: bias_extension\n{keys}\n")
    with pytest.raises(InputError) as caught:
        load_case(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
