"""The model's own error in a drape, and drapes made up by other models than the loop's."""

from functools import cache
from itertools import product

import numpy as np
import pytest
import yaml
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import chi2
from test_diagnose import command
from test_drape_loop import RIG, SIDE, angle, made_up, marks, shear, solved, turned, written

from fabric_fenicsx.errors import InputError, SolveError
from fabric_fenicsx.loop.kinds.drape.effects import DRAPE_EFFECTS
from fabric_fenicsx.loop.kinds.drape.model import Drape
from fabric_fenicsx.loop.kinds.drape.model_error import (
    MOST,
    OTHER_MESH,
    ModelError,
    error_of,
    matern,
)
from fabric_fenicsx.loop.kinds.drape.shear_field import ShearField, kinematic_field
from fabric_fenicsx.loop.synthesise import Hidden, synthesise
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.levels import same_fabric

X, Y = np.meshgrid(SIDE, SIDE, indexing="ij")
BASE = ShearField(SIDE, SIDE, shear(X, Y))


def case(spacing=12.0, **keys):
    sheet = {"width_mm": 288, "length_mm": 288}
    sheet |= {"warp_spacing_mm": spacing, "weft_spacing_mm": spacing}
    return DrapeCase(test="drape", sheet=sheet, **keys)


def wavy(*waves):
    """The baseline and errors with the sheet's symmetry [rad], by wave length [mm] and size."""
    fields = []
    for length, size in waves:
        k = 2.0 * np.pi / length
        fields.append(ShearField(SIDE, SIDE, BASE.gamma + size * np.sin(k * X) * np.sin(k * Y)))
    return fields


def read(field, x, y):
    return 90.0 - np.degrees(np.abs(field.at(x, y)[0]))


MESHES = wavy((200.0, 0.01), (120.0, 0.01), (90.0, 0.01))
ERROR = ModelError.of(BASE, MESHES, [(wavy((300.0, 0.02))[0], BASE)])


def test_the_models_error_has_the_symmetry_of_the_sheet():
    x, y = marks(count=200)
    columns = ERROR.columns(x, y)
    assert columns.shape == (200, MOST) and len(ERROR.modes) == MOST - 4
    for image in ((-x, y), (x, -y), (y, x)):
        assert ERROR.columns(*image) == pytest.approx(columns, abs=1e-9)


def test_the_first_columns_are_differences_between_models():
    x, y = marks()
    for column, other in zip(ERROR.columns(x, y).T, MESHES, strict=False):
        assert column == pytest.approx(read(other, x, y) - read(BASE, x, y), abs=1e-9)


def test_the_random_field_has_materns_covariance_under_the_symmetry():
    """At crossings Σ_k g_k(p) g_k(q) = s(p) s(q) Σ χ ρ(|p − image of q|), but for small modes."""
    side = SIDE[SIDE > 0.0]
    fields = [mode.gamma[12:, 12:].ravel() for mode in ERROR.modes]
    found = sum(np.outer(g, g) for g in fields)
    p = np.array(list(product(side, side)))
    expected = np.zeros_like(found)
    for a, b in product((1.0, -1.0), repeat=2):
        for image in (p * (a, b), p[:, ::-1] * (a, b)):
            expected += a * b * matern(np.linalg.norm(p[:, None] - image, axis=2), ERROR.length)
    s = ERROR.size.ravel()
    expected *= np.outer(s, s)
    left = expected - found
    assert np.linalg.eigvalsh(left).min() > -1e-9 * np.trace(expected)
    assert 0.0 <= np.trace(left) < 0.1 * np.trace(expected)


def test_size_and_length_are_those_of_the_differences():
    """Waves that no other mesh has: their size in the median, their likeness at one spacing."""
    half = 0.01 / 2.0  # root mean square of sin k x sin k y
    assert np.sqrt(np.mean(ERROR.size**2)) == pytest.approx(half, rel=0.5)
    likeness = np.mean([np.cos(2.0 * np.pi / length * 12.0) for length in (200.0, 120.0, 90.0)])
    assert float(matern(12.0, ERROR.length)) == pytest.approx(likeness, abs=0.05)
    twice = ModelError.of(BASE, wavy((200.0, 0.02), (120.0, 0.02), (90.0, 0.02)))
    once = ModelError.of(BASE, MESHES)
    assert twice.size == pytest.approx(2.0 * once.size)
    assert twice.length == pytest.approx(once.length)


def test_meshes_without_differences_leave_no_error():
    error = ModelError.of(BASE, [BASE, BASE])
    assert not error.modes
    assert not error.columns(*marks()).any()


def test_other_models_are_other_cells_spacing_contact_and_nets():
    cases, nets = [], []

    def solve(asked):
        cases.append(asked)
        if asked.contact.layer_mm < 1.0:
            raise SolveError("the step length fell to nothing")
        return made_up(asked)

    def net(asked, spacing):
        nets.append(spacing)
        return BASE

    error = error_of(case(), solve, net)
    assert [c.sheet.subdivisions for c in cases] == [2, OTHER_MESH, 2, 2]
    assert [c.sheet.warp_spacing_mm for c in cases] == [12.0, 12.0, 8.0, 12.0]
    # The same pressure half as deep.
    soft, hard = cases[0].contact, cases[3].contact
    assert hard.layer_mm * hard.stiffness_N_mm2 == soft.layer_mm * soft.stiffness_N_mm2
    assert nets == [None, 6.0, 12.0]
    assert len(error.differences) == 2 + 3
    error_of(case(6.0), solve, None)
    assert cases[6].sheet.warp_spacing_mm == 9.0


def test_sheets_of_one_rig_have_their_errors_in_common(tmp_path):
    x, y = marks()
    measurements = []
    for number, rig in enumerate((RIG, RIG, RIG | {"punch_travel_mm": 50})):
        folder = tmp_path / str(number)
        folder.mkdir()
        measurements.append(written(folder, x, y, angle(x, y), rig=rig))
    drape = Drape(measurements, solve=made_up, net=lambda *_: wavy((300.0, 0.02))[0])
    columns = drape.readings.model_error
    first, second, third = np.split(columns, 3)
    half = columns.shape[1] // 2
    assert (first == second).all()
    assert not first[:, half:].any() and not third[:, :half].any()
    assert (third[:, half:] == first[:, :half]).all()
    assert first.any()
    assert Drape(measurements, solve=made_up, exact=True).readings.model_error is None


def test_a_kinematic_net_beyond_its_sheet_is_the_same_net():
    small, large = case(), case()
    large = large.model_copy(
        update={"sheet": large.sheet.model_copy(update={"width_mm": 432, "length_mm": 432})}
    )
    x, y = marks()
    one, other = (kinematic_field(c, 4.0).at(x, y)[0] for c in (small, large))
    assert one == pytest.approx(other, abs=1e-6)


# Scores by generalised least squares ----------------------------------------------------------

#: Chance of a score over all effects below which it is an alarm.
ALARM = 0.01


def scores(drape, observed):
    """Probability by chance of each effect's score with the covariance σ² + B Bᵀ, corrected.

    One-sided where the amplitude is: friction is not below zero.
    """
    n = len(observed)
    B = drape.readings.model_error
    root = cholesky(drape.noise**2 * np.eye(n) + B @ B.T, lower=True)

    def white(v):
        return solve_triangular(root, v, lower=True)

    r = white(observed - drape.predict((), {})[0])
    found = {}
    for effect in DRAPE_EFFECTS:
        (form,) = effect.variants
        slopes = drape.predict((form,), {p.name: 1e-9 for p in form.parameters})[1]
        J = white(np.column_stack([slopes[p.name] for p in form.parameters]))
        part = np.linalg.lstsq(J, r, rcond=None)[0]
        score = float(np.sum((J @ part) ** 2))
        if form.parameters[0].one_sided and part[0] < 0.0:
            score = 0.0
        found[effect.name] = min(1.0, len(DRAPE_EFFECTS) * float(chi2.sf(score, len(part))))
    return found


MOVES = {
    "none": lambda x, y: (x, y),
    "punch_offset": lambda x, y: (x - 4.0, y + 3.0),
    "ply_rotation": lambda x, y: turned(x, y, 3.0),
}


@cache
def stand_in(cells, friction, force):
    """In place of the elements: a coarse net that is wrong by its spacing and by its cells."""
    net = kinematic_field(case(), 10.0)
    gamma = net.at(X.ravel(), Y.ravel())[0].reshape(X.shape)
    r = np.hypot(X, Y)
    rub = 1.0 - 0.3 * (friction + force / 1000.0) * np.exp(-(((r - 100.0) / 20.0) ** 2))
    return ShearField(SIDE, SIDE, gamma * rub * (1.0 + 0.02 / cells**2))


def solve_stand_in(asked):
    return stand_in(asked.sheet.subdivisions, asked.contact.friction, asked.holder_force_N or 0.0)


@pytest.fixture(scope="module")
def of_stand_in(tmp_path_factory):
    x, y = marks(count=300)
    folder = tmp_path_factory.mktemp("stand_in")
    return Drape([written(folder, x, y, 80.0 + 0.0 * x, noise=0.5)], solve=solve_stand_in)


@pytest.mark.parametrize("name", MOVES)
def test_an_independent_net_shows_what_is_in_it_and_nothing_else(of_stand_in, name):
    x, y = (of_stand_in.readings.covariates[f"{axis} [mm]"] for axis in "xy")
    truth = read(kinematic_field(case(), 3.0), *MOVES[name](x, y))
    for seed in (1, 2, 3):
        noise = np.random.default_rng(seed).normal(0.0, 0.5, len(x))
        found = scores(of_stand_in, truth + noise)
        if name == "none":
            assert min(found.values()) > ALARM
        else:
            assert min(found, key=found.get) == name
            assert found[name] < 1e-10


# Made up by other models ----------------------------------------------------------------------


def test_a_made_up_drape_may_have_another_mesh():
    cases = []
    synthesise(case(), [], 1.0, cells=4, spacing=8.0, solve=lambda c: cases.append(c) or made_up(c))
    (asked,) = cases
    assert asked.sheet.subdivisions == 4
    assert asked.sheet.warp_spacing_mm == asked.sheet.weft_spacing_mm == 8.0
    # The same fabric: as same_fabric makes it.
    assert asked.tow.per_width_mm == 12.0
    assert asked.contact.stiffness_N_mm2 == same_fabric(case(), 2 / 3).contact.stiffness_N_mm2


def test_a_made_up_drape_may_be_a_kinematic_net():
    hidden = [
        Hidden("punch_offset", "", {"dx_mm": 7.0, "dy_mm": -3.0}),
        Hidden("ply_rotation", "", {"rotation_deg": 10.0}),
    ]
    made = synthesise(case(), hidden, 1e-9, readings=40, model="kinematic", spacing=3.0)
    net = kinematic_field(case(), 3.0).filtered()
    for table in made.tables.values():
        x, y = turned(table["x_mm"] - 7.0, table["y_mm"] + 3.0, 10.0)
        assert table["angle_deg"] == pytest.approx(read(net, x, y), abs=1e-6)
    assert made.content["fabric"]["tow_spacing_mm"] == 12.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ["--model", "kinematic", "--effect", "tool_friction"],
            "--effect: 'tool_friction', allowed is punch_offset or ply_rotation",
        ),
        (["--model", "kinematic", "--cells", 3], "--cells: not allowed with --model kinematic"),
        (["--model", "net"], "--model: 'net', allowed is elements or kinematic"),
        (["--spacing", 80], "--spacing: 80, allowed is more than 0 and at most .* 72 mm"),
        (["--spacing", -1], "--spacing: -1, allowed is more than 0"),
    ],
)
def test_what_another_model_cannot_do_is_told_in_one_line(options, message, tmp_path, capsys):
    file = tmp_path / "case.yaml"
    keys = {"width_mm": 288, "length_mm": 288}
    file.write_text(yaml.safe_dump({"test": "drape", "sheet": keys}))
    out = tmp_path / "made"
    assert command("synthesise", file, "--noise", 1, "--out", out, *options) == 2
    error = capsys.readouterr().err
    assert len(error.strip().splitlines()) == 1 and not out.exists()
    with pytest.raises(InputError, match=message):
        raise InputError(error)


def test_other_rigs_have_no_other_mesh(tmp_path, capsys):
    file = tmp_path / "frame.yaml"
    file.write_text("test: picture_frame\n")
    for option, value in (("cells", 4), ("spacing", 8), ("model", "kinematic")):
        out = tmp_path / option
        assert command("synthesise", file, "--noise", 1, "--out", out, f"--{option}", value) == 2
        assert f"--{option}: allowed with test: drape only" in capsys.readouterr().err


# With the finite elements ---------------------------------------------------------------------

OTHERS = {"4 cells": (4, 1.0), "8 mm": (2, 2 / 3)}
HELD = {"contact__friction": 0.2, "contact__frictionless": ["punch"]}
CHANGES = {
    "none": {},
    "tool_friction": {"contact__friction": 0.4},
    "holder_pressure": {"holder_force_N": 300.0} | HELD,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("other", OTHERS)
def test_another_mesh_shows_what_is_in_it_and_nothing_else(tmp_path, other, name):
    """Friction of either kind: their shapes are alike to some hundredths, either is found."""
    x, y = marks(count=400)
    drape = Drape([written(tmp_path, x, y, 80.0 + 0.0 * x, noise=0.3)], solve=solved)
    x, y = (drape.readings.covariates[f"{axis} [mm]"] for axis in "xy")
    cells, factor = OTHERS[other]
    dotted = {key.replace("__", "."): value for key, value in CHANGES[name].items()}
    asked = drape._case(drape.measurements[0], dotted)
    mesh = asked.sheet.model_copy(update={"subdivisions": cells})
    truth = solved(same_fabric(asked.model_copy(update={"sheet": mesh}), factor)).filtered()
    for seed in (1, 2, 3):
        noise = np.random.default_rng(seed).normal(0.0, 0.3, len(x))
        found = scores(drape, read(truth, x, y) + noise)
        if name == "none":
            assert min(found.values()) > ALARM
        else:
            assert min(found, key=found.get) in CHANGES
            assert found[name] < ALARM
