"""Drapes traced to effects: a smooth field in place of finite elements, and, slow, with them."""

from functools import cache
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
import yaml
from scipy.optimize import least_squares
from test_demos import demo

from fabric_fenicsx.errors import InputError, SolveError
from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.drape.effects import DRAPE_EFFECTS
from fabric_fenicsx.loop.kinds.drape.model import OTHER_MESH, Drape, nearest_next
from fabric_fenicsx.loop.kinds.drape.shear_field import (
    ShearField,
    ShearLaw,
    drape_case,
    hermite_weights,
    solved_field,
)
from fabric_fenicsx.loop.report.content import test_report as report_of
from fabric_fenicsx.loop.synthesise import Hidden, synthesise, write_measurement
from fabric_fenicsx.rigs.common import Session, control
from fabric_fenicsx.rigs.drape import DrapeCase, build
from fabric_fenicsx.rigs.fabric_file import FabricFile, areal_density
from fabric_fenicsx.rigs.simulation import simulate
from fabric_fenicsx.solving.contacts import ContactLaw

RIG = {
    "punch_radius_mm": 76.2,
    "hole_radius_mm": 80,
    "punch_travel_mm": 65,
    "fabric_size_mm": 288,
    "duration_s": 60,
}
SIDE = np.arange(-138.0, 139.0, 12.0)
FORMS = {effect.name: effect.variants[0] for effect in DRAPE_EFFECTS}


def shear(x, y, mu=0.0, force=0.0):
    """A made-up shear angle [rad], odd in x and in y; friction brings it closer to the middle."""
    width = 90.0 - 25.0 * mu / (0.2 + mu) - 20.0 * force / (100.0 + force)
    return 1.8 * x * y / width**2 * np.exp(-(x**2 + y**2) / width**2)


def made_up(case):
    """In place of the finite elements: cases differ by their friction and by a ripple."""
    force = case.holder_force_N or 0.0
    gamma = shear(*np.meshgrid(SIDE, SIDE, indexing="ij"), case.contact.friction, force)
    ripple = 0.01 * np.sin(np.outer(SIDE, SIDE) / 900.0)
    return ShearField(SIDE, SIDE, gamma + ripple * (case.sheet.subdivisions == OTHER_MESH))


def angle(x, y, **changes):
    return 90.0 - np.degrees(np.abs(shear(x, y, **changes)))


def turned(x, y, degrees):
    phi = np.radians(degrees)
    return np.cos(phi) * x + np.sin(phi) * y, np.cos(phi) * y - np.sin(phi) * x


def marks(count=60, reach=125.0, seed=3):
    return np.random.default_rng(seed).uniform(-reach, reach, (2, count))


def written(folder, x, y, angles, *, noise=1.0, std=None, rig=RIG, held=0):
    """A measurement's folder; the last ``held`` readings are held out."""
    columns = {"x_mm": x, "y_mm": y, "angle_deg": angles} | (
        {} if std is None else {"std_deg": std}
    )
    table = np.column_stack(list(columns.values()))
    parts = {"fit": table[: len(x) - held], "holdout": table[len(x) - held :]}
    runs = []
    for role, rows in parts.items():
        if len(rows):
            header = ",".join(columns)
            np.savetxt(folder / f"{role}.csv", rows, "%.9g", ",", header=header, comments="")
            runs.append({"file": f"{role}.csv", "role": role})
    keys = {
        "schema": "fabric-measurement/1",
        "test": "drape",
        "fabric": {"areal_density_kg_m2": 0.21894, "tow_spacing_mm": 12},
        "rig": rig,
        "runs": runs,
    }
    keys |= {} if noise is None else {"noise": {"angle_deg": noise}}
    (folder / "measurement.yaml").write_text(yaml.safe_dump(keys))
    return read_measurement(folder)


def draped(folder, x, y, angles, **options):
    return Drape([written(folder, x, y, angles, **options)], solve=made_up, net=None)


def test_the_filter_takes_waves_of_two_spacings_and_leaves_cubics():
    x, y = np.meshgrid(SIDE, SIDE, indexing="ij")
    cubic = 1e-6 * (x**3 - 2.0 * x * y**2) + 1e-3 * y
    waves = 0.1 * np.where(np.add.outer(np.arange(24), np.arange(24)) % 2, 1.0, -1.0)
    filtered = ShearField(SIDE, SIDE, cubic + waves).filtered().gamma
    inside = (slice(2, -2), slice(2, -2))
    assert filtered[inside] == pytest.approx(cubic[inside], abs=1e-12)
    four = ShearField(SIDE, SIDE, np.sin(np.pi / 2 * np.arange(24))[:, None] * np.ones(24))
    assert four.filtered().gamma[inside] == pytest.approx(0.75 * four.gamma[inside], abs=1e-12)


def test_a_quarter_is_mirrored_with_changes_of_sign():
    places = np.array([(x, y) for y in SIDE[12:] for x in SIDE[12:]])
    field = ShearField.of_quarter(places, shear(*places.T))
    x, y = marks()
    gamma, along_x, along_y = field.at(x, y)
    # A spline of third order on 12 mm.
    assert gamma == pytest.approx(shear(x, y), abs=2e-4)
    h = 1e-5
    assert along_x == pytest.approx(
        (field.at(x + h, y)[0] - field.at(x - h, y)[0]) / 2 / h, abs=1e-8
    )
    assert along_y == pytest.approx(
        (field.at(x, y + h)[0] - field.at(x, y - h)[0]) / 2 / h, abs=1e-8
    )


def test_beyond_the_outer_crossings_the_field_is_constant():
    field = made_up(DrapeCase(test="drape"))
    gamma, along_x, along_y = field.at(np.array([150.0, 138.0]), np.array([40.0, 40.0]))
    assert gamma[0] == gamma[1]
    assert along_x[0] == 0.0
    assert along_y[0] == along_y[1] != 0.0


@pytest.mark.parametrize("value", [0.0, 0.07, 0.1, 0.15, 0.33, 0.8])
def test_interpolation_between_amplitudes_is_smooth_and_exact_for_quadratics(value):
    solved_at = (0.1, 0.2, 0.4, 0.8)
    nodes, weights, slopes = map(np.array, hermite_weights(solved_at, value))
    assert weights @ (1.0 + 3.0 * nodes - 5.0 * nodes**2) == pytest.approx(
        1.0 + 3.0 * value - 5.0 * value**2
    )
    assert slopes @ (1.0 + 3.0 * nodes - 5.0 * nodes**2) == pytest.approx(3.0 - 10.0 * value)
    if 0.0 < value < 0.8:
        before, after = (
            dict(zip(*hermite_weights(solved_at, value + d)[::2], strict=True))
            for d in (-1e-9, 1e-9)
        )
        for node in before.keys() | after.keys():
            assert before.get(node, 0.0) == pytest.approx(after.get(node, 0.0), abs=1e-6)


def test_an_interval_asks_for_its_ends_and_their_neighbours_only():
    assert hermite_weights((0.1, 0.2, 0.4, 0.8), 1e-9)[0] == [0.0, 0.1, 0.2]
    assert hermite_weights((0.1, 0.2, 0.4, 0.8), 0.25)[0] == [0.1, 0.2, 0.4, 0.8]
    assert hermite_weights((-1.0, 2.0), 5.0)[0] == [-1.0, 0.0, 2.0]


def test_derivatives_in_all_parameters_together(tmp_path):
    x, y = marks()
    drape = draped(tmp_path, x, y, angle(x, y))
    values = {"mu": 0.13, "holder_force_N": 70.0, "dx_mm": 5.0, "dy_mm": -3.0, "rotation_deg": 6.0}
    variants = tuple(FORMS.values())
    _, slopes = drape.predict(variants, values)
    for name, value in values.items():
        h = 1e-6 * abs(value)
        up, down = (drape.predict(variants, values | {name: value + d})[0] for d in (h, -h))
        assert slopes[name] == pytest.approx((up - down) / (2.0 * h), rel=1e-5, abs=1e-6)


def test_offset_and_rotation_move_the_pattern(tmp_path):
    x, y = marks(reach=100.0)
    drape = draped(tmp_path, x, y, angle(x, y))
    values = {"dx_mm": 6.0, "dy_mm": -4.0, "rotation_deg": 5.0}
    moves = (FORMS["punch_offset"], FORMS["ply_rotation"])
    expected, _ = drape.predict(moves, values)
    x, y = x[drape.readings.row], y[drape.readings.row]
    # The field is filtered and interpolated: by a tenth of a degree it is another.
    assert expected == pytest.approx(angle(*turned(x - 6.0, y + 4.0, 5.0)), abs=0.15)
    other_order, _ = drape.predict(moves[::-1], values)
    assert (other_order == expected).all()


HIDDEN = {
    "punch_offset": (lambda x, y: angle(x - 6.0, y + 4.0), {"dx_mm": 6.0, "dy_mm": -4.0}),
    "ply_rotation": (lambda x, y: angle(*turned(x, y, 4.0)), {"rotation_deg": 4.0}),
    "tool_friction": (lambda x, y: angle(x, y, mu=0.3), {"mu": 0.3}),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_effect_is_named_with_its_size(tmp_path, name):
    truth, parameters = HIDDEN[name]
    x, y = marks()
    angles = truth(x, y) + np.random.default_rng(1).normal(0.0, 1.0, len(x))
    drape = draped(tmp_path, x, y, angles, held=15)
    diagnosis = diagnose_test(drape)
    report = report_of(diagnosis, drape.measurements)
    assert report["verdict"] == "effect_found"
    effect = report["effects"][0]
    assert [e["name"] for e in report["effects"]] == [name]
    for key, value in parameters.items():
        assert abs(effect["parameters"][key] - value) < 4.0 * effect["std"][key]
        assert abs(effect["parameters"][key] - value) < 0.5 * abs(value)
    assert report["error"]["after"]["holdout"] < 1.3 < report["error"]["before"]["holdout"]
    assert len(report["notes"]) == 3
    assert "assumed" in report["notes"][0]


def test_without_an_effect_the_baseline_explains_the_data(tmp_path):
    x, y = marks()
    angles = angle(x, y) + np.random.default_rng(2).normal(0.0, 1.0, len(x))
    drape = draped(tmp_path, x, y, angles)
    diagnosis = diagnose_test(drape)
    assert diagnosis.verdict == "no_effect"
    assert diagnosis.baseline.values == {}
    row = drape.readings.row
    assert diagnosis.baseline.residual == pytest.approx((angles - angle(x, y))[row], abs=0.15)


def test_a_model_without_parameters_has_nothing_to_fit(tmp_path):
    x, y = marks()
    drape = draped(tmp_path, x, y, angle(x, y))
    model = fit(drape, (), {}, drape.readings.fit, Variances(Noise(1.0)))
    assert model.values == model.std == {}
    assert model.freedom == len(x)
    assert model.slopes.shape[1] == 0


def test_readings_are_weighed_by_their_sigma_and_the_models_own_scatter(tmp_path):
    x, y = marks()
    std = np.where(x > 0.0, 2.0, 0.5)
    drape = draped(tmp_path, x, y, angle(x, y), noise=None, std=std)
    assert drape.noise == pytest.approx(np.sqrt(np.mean(std**2)))
    scatter = drape.model_scatter
    sigma = np.hypot(std[drape.readings.row], scatter)
    assert drape.readings.weight == pytest.approx(drape.noise / sigma)
    # What the filter takes from a field without waves.
    assert 0.0 < scatter.min() < scatter.max() < np.degrees(0.01)


def test_obtuse_angles_are_made_acute_all_or_none(tmp_path):
    x, y = marks()
    signed = np.where(x * y > 0.0, angle(x, y), 180.0 - angle(x, y))
    assert signed.max() > 100.0
    drape = draped(tmp_path, x, y, signed)
    row = drape.readings.row
    assert drape.readings.observed == pytest.approx(angle(x, y)[row], abs=1e-6)
    near = np.minimum(angle(x, y) + 3.0, 95.0)
    assert draped(tmp_path, x, y, near).readings.observed == pytest.approx(near[row], abs=1e-6)


def test_noise_that_is_not_given_is_estimated_from_places_side_by_side(tmp_path):
    x, y = marks(count=200)
    angles = angle(x - 8.0, y) + np.random.default_rng(5).normal(0.0, 1.0, len(x))
    diagnosis = diagnose_test(draped(tmp_path, x, y, angles, noise=None), ["punch_offset"])
    assert diagnosis.noise == pytest.approx(1.0, rel=0.25)
    assert diagnosis.noise_source.startswith("estimated")
    assert diagnosis.verdict == "effect_found"


def test_readings_are_put_in_an_order_of_neighbours():
    x = np.array([0.0, 5.0, 1.0, 6.0, 2.0])
    assert nearest_next(x, np.zeros(5)).tolist() == [3, 1, 4, 2, 0]


def test_an_outlier_is_told_by_its_row_in_the_file(tmp_path):
    x, y = marks()
    angles = angle(x, y) + np.random.default_rng(2).normal(0.0, 1.0, len(x))
    angles[17] -= 40.0
    drape = draped(tmp_path, x, y, angles)
    report = report_of(diagnose_test(drape, ["ply_rotation"]), drape.measurements)
    assert [entry["reading"] for entry in report["left_out"]["outliers"]] == [18]


def test_an_amplitude_without_a_solution_ends_the_range_and_is_told(tmp_path):
    def solve(case):
        if case.contact.friction > 0.3:
            raise SolveError("the step length fell to nothing")
        return made_up(case)

    x, y = marks()
    measurement = written(tmp_path, x, y, angle(x, y))
    drape = Drape([measurement], solve=solve, net=None)
    at_last, _ = drape.predict((FORMS["tool_friction"],), {"mu": 0.2})
    beyond, slopes = drape.predict((FORMS["tool_friction"],), {"mu": 0.6})
    assert (beyond == at_last).all()
    assert (slopes["mu"] == 0.0).all()
    assert any("mu = 0.4: the step length" in note for note in drape.notes)


def test_the_law_of_other_tests_is_taken(tmp_path):
    cases = []
    x, y = marks()
    measurement = written(tmp_path, x, y, angle(x, y))
    drape = Drape([measurement], solve=lambda c: cases.append(c) or made_up(c), net=None)
    friction = {"law": "dahl_friction", "limit_N_mm": 0.01, "stick_angle_deg": 2.0}
    fabric = {
        "schema": "fabric/1",
        "fabric": {"areal_density_kg_m2": 0.5, "tow_spacing_mm": 6.0},
        "tow": {"width_mm": 3.0, "height_mm": 0.1, "C1_MPa": 2000.0},
        "crossover": {
            "k1_N_mm": 0.0,
            "k3_N_mm": 0.05,
            "dashpot_N_s_mm": 1.0,
            "laws": [friction],
        },
        "tests": [{"test": "picture_frame", "titles": [""], "verdict": "effect_found"}],
    }
    drape.take(FabricFile.model_validate(fabric))
    drape.predict((), {})
    crossover = cases[0].crossover
    assert (crossover.k1_N_mm, crossover.k3_N_mm, crossover.dashpot_N_s_mm) == (0.0, 0.05, 1.0)
    assert [law.law for law in crossover.laws] == ["dahl_friction"]
    assert "and dahl_friction (fitted to the other tests)" in drape.notes[0]
    # Without a strip the tow stays the drape's own.
    assert cases[0].tow.C1_MPa == measurement.fabric.tow.C1_MPa
    fabric["tests"] += [{"test": "cantilever", "titles": [""], "verdict": "no_effect"}]
    drape.take(FabricFile.model_validate(fabric))
    case = drape._case(measurement, {})
    assert (case.tow.C1_MPa, case.tow.per_width_mm) == (2000.0, 6.0)
    assert "fitted to the other tests" in drape.notes[1]
    # The sheet weighs what was draped.
    assert areal_density(case) == pytest.approx(measurement.fabric.areal_density_kg_m2)


def test_the_case_weighs_what_the_fabric_does(tmp_path):
    measurement = written(tmp_path, *marks(), 80.0 * np.ones(60))
    case = drape_case(measurement, ShearLaw(0.01, 0.05, 1.0), 30000.0, {"contact.friction": 0.3})
    tow = case.tow
    per_area = 2.0 * tow.width_mm * tow.height_mm * tow.density_kg_mm3 / 12.0
    assert per_area * 1e6 == pytest.approx(0.21894)
    assert (case.crossover.k1_N_mm, case.crossover.k3_N_mm) == (0.01, 0.05)
    assert case.crossover.dashpot_N_s_mm == 1.0
    assert (tow.C1_MPa, case.contact.friction, case.symmetry) == (30000.0, 0.3, "quarter")


def test_what_cannot_be_draped_is_told_with_its_key(tmp_path):
    x, y = np.zeros((2, 1))
    small = written(tmp_path, x, y, x + 80.0, rig=RIG | {"fabric_size_mm": 40})
    with pytest.raises(InputError, match=r"fabric_size_mm: 40, allowed is .* 48"):
        Drape([small])
    drape = draped(tmp_path, x, y, x + 80.0)
    with pytest.raises(InputError, match=r"k1_N_mm.*greater than or equal to 0"):
        drape.use(ShearLaw(k1=-0.01), None, "picture frame")


def test_a_tool_without_friction_does_not_rub():
    case = DrapeCase(
        test="drape",
        sheet={"width_mm": 96, "length_mm": 96, "warp_spacing_mm": 24, "weft_spacing_mm": 24},
        contact={"friction": 0.2, "frictionless": ["punch"]},
    )
    model = build(case, Session(None, MPI.COMM_SELF, None, 0.0))
    assert model.contacts.frictional == {"die", "holder"}
    names = {term.name for term in model.contacts.terms}
    assert names == {"punch", "die", "die friction", "holder", "holder friction"}
    assert not ContactLaw(0.5, 0.5).rubs("die")


def test_a_made_up_drape_hides_what_a_diagnosis_finds(tmp_path):
    case = DrapeCase(test="drape", sheet={"width_mm": 288, "length_mm": 288})
    hidden = Hidden("punch_offset", "", {"dx_mm": 7.0, "dy_mm": -3.0})
    made = synthesise(case, [hidden], 1.0, seed=4, readings=80, solve=made_up)
    write_measurement(tmp_path / "made", made)
    measurement = read_measurement(tmp_path / "made")
    assert [run.count for run in measurement.runs] == [60, 20]
    assert [run.holdout for run in measurement.runs] == [False, True]
    diagnosis = diagnose_test(Drape([measurement], solve=made_up, net=None))
    (effect,) = report_of(diagnosis, [measurement])["effects"]
    assert effect["name"] == "punch_offset"
    for name, value in hidden.values.items():
        assert abs(effect["parameters"][name] - value) < 4.0 * effect["std"][name]
    visible = synthesise(case, [Hidden("ply_rotation", "", {})], 1.0, readings=80, solve=made_up)
    assert 3.0 < abs(visible.effects[0].values["rotation_deg"]) < 30.0


def test_a_drape_that_no_measurement_can_tell_is_not_made_up():
    oiled = DrapeCase(test="drape", contact={"friction": 0.1})
    with pytest.raises(InputError, match=r"contact: .* put effects in as --effect"):
        synthesise(oiled, [], 1.0, solve=made_up)
    message = "--rates: allowed with test: picture_frame or bias_extension only"
    with pytest.raises(InputError, match=message):
        synthesise(DrapeCase(test="drape"), [], 1.0, rates=[1.0], solve=made_up)


def test_table_4_is_written_as_a_page(tmp_path):
    """The page that is kept has the same parts; its numbers are those of the finite elements."""
    results = demo("table_4").main(tmp_path, solve=made_up, net=None)
    assert results["report"]["test"] == "drape"
    assert (tmp_path / "report.html").is_file()
    kept = (Path(__file__).parents[1] / "docs" / "table4.md").read_text()
    headings = [line for line in results["page"].splitlines() if line.startswith(("#", "| point"))]
    assert headings == [line for line in kept.splitlines() if line.startswith(("#", "| point"))]
    assert "| 3 | 6, 116 mm | 87.2 ± 0.9 |" in results["page"]
    assert "| 3 | 6, 116 mm | 87.2 ± 0.9 |" in kept


@cache
def _solved(text):
    return solved_field(DrapeCase.model_validate_json(text))


def solved(case):
    """The finite elements, once for each case."""
    return _solved(case.model_dump_json(exclude_unset=True))


def changed(measurement, **changes):
    """The field of the measured drape with other keys, as it is read: waves and all."""
    dotted = {name.replace("__", "."): value for name, value in changes.items()}
    return solved(drape_case(measurement, ShearLaw(), 60000.0, dotted))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "parameter", "size"),
    [
        ("tool_friction", {"contact__friction": 0.3}, "mu", 0.3),
        (
            "holder_pressure",
            {
                "holder_force_N": 100.0,
                "contact__friction": 0.2,
                "contact__frictionless": ["punch"],
            },
            "holder_force_N",
            100.0,
        ),
    ],
)
def test_friction_in_the_whole_model_is_found(tmp_path, name, changes, parameter, size):
    """Either is the other's rival: both stretch the tows, and more of it soon changes little.

    Angles change by 0.2° rms only, where tows bend as bundles do.
    """
    x, y = marks(count=400)
    folder = tmp_path / "empty"
    folder.mkdir()
    truth = changed(written(folder, x, y, x * 0.0 + 80.0), **changes)
    angles = 90.0 - np.degrees(np.abs(truth.at(x, y)[0]))
    angles += np.random.default_rng(1).normal(0.0, 0.3, len(x))
    drape = Drape([written(tmp_path, x, y, angles, noise=0.3, held=80)], solve=solved)
    report = report_of(diagnose_test(drape), drape.measurements)
    assert report["verdict"] == "effect_found"
    (effect,) = report["effects"]
    assert name in (effect["name"], *effect["rivals"])
    assert report["error"]["after"]["holdout"] < report["error"]["before"]["holdout"]
    if effect["name"] == name:
        assert abs(effect["parameters"][parameter] - size) < 4.0 * effect["std"][parameter]


@pytest.mark.slow
def test_an_offset_in_the_whole_model_is_a_shift_if_friction_holds_the_sheet(tmp_path):
    """Without friction it is not one, see loop/drape_effects.py."""
    case = DrapeCase(
        test="drape",
        sheet={"width_mm": 288, "length_mm": 288},
        contact={"friction": 0.1},
        symmetry="none",
        punch_offset_x_mm=6.0,
        punch_offset_y_mm=-4.0,
    )
    session = Session(tmp_path, MPI.COMM_SELF, Path(), 0.0)
    model = build(case, session)
    outcome = simulate(
        model,
        tmp_path,
        test="drape",
        end=case.duration_s,
        control=control(case.solver, case.edge_radius_mm / 2.0),
        force_tolerance=case.solver.force_tolerance_N,
        iteration_limit=case.solver.iteration_limit,
    )
    assert outcome.completed
    x, y = model.net.points[model.net.crossings].mean(axis=1)[:, :2].T
    gamma = np.zeros((24, 24))
    place = np.searchsorted(SIDE, np.round(x, 6)), np.searchsorted(SIDE, np.round(y, 6))
    gamma[place] = outcome.last.shear_angle
    moved = np.abs(ShearField(SIDE, SIDE, gamma).filtered().gamma[place])
    centred = case.model_copy(
        update={"symmetry": "quarter", "punch_offset_x_mm": 0.0, "punch_offset_y_mm": 0.0}
    )
    field = solved(centred).filtered()

    def off(dx, dy):
        return np.degrees(np.abs(field.at(x - dx, y - dy)[0]) - moved)

    def rms(values):
        return float(np.sqrt(np.mean(values**2)))

    assert rms(off(6.0, -4.0)) < 1.3 < 2.0 < rms(off(0.0, 0.0))
    best = least_squares(lambda p: off(*p), [0.0, 0.0]).x
    assert best == pytest.approx([6.0, -4.0], abs=1.0)
