"""From what a diagnosis fitted to a case: every form's keys, the file, its mistakes, the way round.

A law that goes into a case's keys and comes back has the moments that it had; a frame diagnosed
from the model's own readings, run with the file that comes of it, has the diagnosis' own forces;
and the standard error of a force is the one that follows from those of the parameters by hand.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
import yaml
from test_rigs import SMALL
from test_shear_laws import moments

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.loop import fabric as fabric_of
from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.fabric import law_entries
from fabric_fenicsx.loop.kinds.drape.effects import DRAPE_EFFECTS
from fabric_fenicsx.loop.kinds.picture_frame.effects import PICTURE_FRAME_EFFECTS
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.measurement.schema import Run
from fabric_fenicsx.loop.own_effects import read_effects
from fabric_fenicsx.loop.synthesise import Hidden, synthesise, write_measurement
from fabric_fenicsx.rigs.cases import CrossoverKeys
from fabric_fenicsx.rigs.common import section
from fabric_fenicsx.rigs.fabric_file import moved, read_fabric, with_fabric
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.run import make_case, run
from fabric_fenicsx.rigs.uncertainty import spread, uncertain

DEMOS = Path(__file__).parents[1] / "demos"
AREA = 36.0

FORMS = [
    pytest.param(variant, id=f"{effect.name}, {variant.label}")
    for effect in PICTURE_FRAME_EFFECTS
    if effect.of_fabric
    for variant in effect.variants
]

#: A frame whose tows are a thousand times stiffer than real ones, which bend by half a per cent.
FRAME = {
    "travel_mm": 80.0,
    "hold_s": 20.0,
    "tow": {"C1_MPa": 6e7},
    "solver": {"first_step_s": 2.0, "largest_step_s": 4.0, "force_tolerance_N": 1e-5},
}


def test_every_law_of_the_fabric_is_there():
    assert len(FORMS) >= 20


@pytest.mark.parametrize("variant", FORMS)
def test_a_form_goes_through_the_keys_of_a_case(variant, tmp_path):
    """Its moments per area times the area of a crossing; and what each parameter does to keys."""
    rng = np.random.default_rng(3)
    values = {p.name: float(rng.uniform(0.2, 0.6)) for p in variant.parameters}
    entries, slopes = law_entries(variant, values, tmp_path)
    laws = CrossoverKeys.model_validate({"laws": entries}).laws
    path = np.array([0.1, 0.5, 0.9, 0.7, -0.6, -0.65])
    for length in (0.3, 30.0):
        expected = sum(moments(law, path, length) for law in variant.laws(values))
        got = sum(moments(keys.build(AREA), path, length) for keys in laws)
        assert got == pytest.approx(AREA * expected, rel=1e-9, abs=1e-12)
    # Twice a parameter: what the derivatives say is all, for keys are linear in it.
    for name, own in slopes.items():
        doubled, _ = law_entries(variant, values | {name: 2.0 * values[name]}, tmp_path)
        changed = [dict(entry) for entry in entries]
        for place, slope in own.items():
            i, _, key = place.partition(".")
            changed[int(i)][key] += slope * values[name]
        for one, other in zip(changed, doubled, strict=True):
            assert {k: v for k, v in one.items() if k != "law"} == pytest.approx(
                {k: v for k, v in other.items() if k != "law"}, rel=1e-9
            )


def test_a_law_of_ones_own_goes_by_its_file(tmp_path):
    """Also where the file has several, and from another folder."""
    source = tmp_path / "laws" / "mine.py"
    source.parent.mkdir()
    text = (DEMOS / "own_effects.py").read_text()
    source.write_text(text + "\n\nclass Other(Stitches):\n    pass\n")
    (effect,) = [e for e in read_effects(source) if e.name == "stitch_tightening"]
    values = {"m_s_N": 0.02, "tight_angle_rad": 0.05}
    out = tmp_path / "out"
    out.mkdir()
    entries, slopes = law_entries(effect.variants[0], values, out)
    assert entries[0]["file"] == "../laws/mine.py"
    assert slopes["tight_angle_rad"] == {"0.values.tight_angle_deg": pytest.approx(180.0 / np.pi)}
    file = written(out, fabric(crossover={"laws": entries}))
    (law,) = read_fabric(file).crossover.laws
    path = np.array([0.02, -0.3])
    expected = 0.02 * np.tanh(path / 0.05) * AREA
    assert moments(law.build(AREA), path) == pytest.approx(expected)


# The file -----------------------------------------------------------------------------------------


def fabric(**changes):
    """The content of a fabric.yaml."""
    crossover = {"k1_N_mm": 0.03, "k3_N_mm": 0.06, "dashpot_N_s_mm": 1.5, "laws": []}
    return {
        "schema": "fabric/1",
        "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 10.0},
        "tow": {"width_mm": 4.0, "height_mm": 0.05, "C1_MPa": 5e4},
        "parameters": [],
        "correlations": [],
        **changes,
        "crossover": crossover | changes.get("crossover", {}),
    }


def written(folder, content):
    path = folder / "fabric.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def parameter(name, std, **keys):
    return {"name": name, "test": "picture_frame", "value": 1.0, "std": std, "keys": keys}


@pytest.mark.parametrize("test", ["drape", "picture_frame", "cantilever"])
def test_a_case_with_a_fabric(test, tmp_path):
    """Section, weight and crossings are the file's, whatever the case had; the rest is the case's.

    B = 6 C1 a b³/12 per spacing and the mass of both families per area, at the case's own spacing.
    """
    laws = [{"law": "locking", "angle_deg": 45.0, "k_N_mm": 2.0}]
    file = written(tmp_path, fabric(crossover={"laws": laws}))
    stiffness = {"stretch_N_mm": 3000.0, "bending_out_of_plane_Nmm": 7.0}
    case = make_case(
        test,
        tow={"stiffness": stiffness, "relaxation_time_s": 0.5},
        crossover={
            "translation_N_mm": 50.0,
            "laws": [{"law": "maxwell", "k_N_mm": 1.0, "relaxation_time_s": 1.0}],
        },
    )
    found = with_fabric(case, read_fabric(file))
    warp, weft = (section(found.tow, s) for s in found.spacings)
    s = found.spacings[0]
    assert warp.stiffness()[4] / s == pytest.approx(6.0 * 5e4 * 4.0 * 0.05**3 / 12.0 / 10.0)
    mass = sum(one.mass()[0] / w for one, w in zip((warp, weft), found.spacings, strict=True))
    assert 1e9 * mass == pytest.approx(0.3)
    assert warp.stiffness()[0] / s == pytest.approx(3000.0)
    assert found.tow.relaxation_time_s == 0.5
    crossover = found.crossover
    assert (crossover.k1_N_mm, crossover.dashpot_N_s_mm) == (0.03, 1.5)
    assert [law.law for law in crossover.laws] == ["locking"]
    assert crossover.translation_N_mm == 50.0
    assert with_fabric(found, read_fabric(file)) == found


def test_what_the_file_lacks_is_the_cases(tmp_path):
    content = fabric()
    del content["tow"], content["crossover"]
    case = make_case("drape", tow={"C1_MPa": 1e4}, crossover={"k1_N_mm": 0.5})
    found = with_fabric(case, read_fabric(written(tmp_path, content)))
    assert (found.tow.C1_MPa, found.crossover.k1_N_mm) == (1e4, 0.5)
    assert found.tow.density_kg_mm3 != case.tow.density_kg_mm3


def test_a_case_names_its_fabric(tmp_path):
    """By a key, from the case's folder; the command's option is that key."""
    (tmp_path / "inner").mkdir()
    written(tmp_path / "inner", fabric())
    path = tmp_path / "case.yaml"
    path.write_text("test: drape\nfabric: inner/fabric.yaml\n")
    named = load_case(path)
    assert named.crossover.k1_N_mm == 0.03
    path.write_text("test: drape\n")
    given = load_case(path, fabric=tmp_path / "inner" / "fabric.yaml")
    assert given.crossover == named.crossover and given.tow == named.tow
    with pytest.raises(InputError, match=r"^--set: crossover\.k1_N_mm: the fabric's own"):
        load_case(path, ["crossover.k1_N_mm=1"], fabric=tmp_path / "inner" / "fabric.yaml")
    assert load_case(
        path, ["crossover.translation_N_mm=9"], fabric=tmp_path / "inner" / "fabric.yaml"
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"schema": "fabric/2"}, "schema: 'fabric/2', did you mean fabric/1?"),
        ({"tows": {}}, "tows: unknown key, did you mean tow?"),
        ({"tow": {"width_mm": 4.0, "height_mm": 0.05}}, "tow.C1_MPa: missing, allowed is a number"),
        ({"crossover": {"k1_N_mm": -1.0}}, "crossover.k1_N_mm: -1, allowed is a number of at"),
        (
            {"crossover": {"laws": [{"law": "lock"}]}},
            "crossover.laws.0.law: 'lock', allowed is",
        ),
        (
            {"crossover": {"laws": [{"law": "own", "file": "none.py"}]}},
            "none.py: no such file",
        ),
        (
            {"parameters": [parameter("a", 0.1)]},
            "correlations: allowed are 1 rows of 1",
        ),
        (
            {
                "parameters": [parameter("a", 0.1), parameter("b", 0.1)],
                "correlations": [[1.0, 0.5], [0.2, 1.0]],
            },
            "correlations: allowed is a symmetric matrix",
        ),
        (
            {"parameters": [parameter("a", 0.1, **{"tow.C9": 1.0})], "correlations": [[1.0]]},
            "parameters.0.keys: tow.C9, allowed is a number of this file",
        ),
        (
            {"specimens": [{"parameters": ["k9"], "test": "t", "share": 0.1, "std": 0.1}]},
            "specimens.0.parameters: k9 is none of t",
        ),
    ],
)
def test_a_bad_fabric_is_one_line_and_exit_code_2(change, says, tmp_path, capsys):
    file = written(tmp_path, fabric(**change))
    case = tmp_path / "case.yaml"
    case.write_text("test: drape\n")
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as end:
        main(["run", str(case), "--fabric", str(file), "--out", str(out)])
    line = capsys.readouterr().err.strip()
    assert end.value.code == 2 and "\n" not in line
    assert line.startswith(str(file)) and says in line
    assert not out.exists()


def test_uncertainty_needs_a_fabric(tmp_path):
    with pytest.raises(InputError, match="uncertainty: allowed is a case with a fabric"):
        run(make_case("picture_frame"), tmp_path / "out", uncertainty=True)


# How uncertain it is ------------------------------------------------------------------------------


def test_axes_of_fit_and_specimens(tmp_path):
    """W (W⁺ A) has the covariance of the fit, W (W⁺ S) that of the specimens; see the module."""
    r = np.array([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.3], [0.0, 0.3, 1.0]])
    names = ("crossover.k1_N_mm", "crossover.k3_N_mm", "tow.C1_MPa")
    std = np.array([1e-3, 4e-3, 900.0])
    content = fabric(
        parameters=[parameter(n, float(s), **{n: 1.0}) for n, s in zip(names, std, strict=True)],
        correlations=r.tolist(),
        specimens=[
            {"parameters": list(names[:2]), "test": "picture_frame", "share": 0.1, "std": 0.0}
        ],
    )
    found = read_fabric(written(tmp_path, content))
    known = spread(found)
    A = known.axes @ known.fit
    assert A @ A.T == pytest.approx(r * np.outer(std, std), rel=1e-9, abs=1e-15)
    S = known.axes @ known.specimens
    assert S[:, 0] == pytest.approx([0.1, 0.1, 0.0], abs=1e-12)
    assert np.linalg.norm(known.fit, 2) <= 1.0 + 1e-12
    assert known.axes.shape == (3, 3) and uncertain(found) == list(names)
    step = moved(found, np.array([1e-3, 0.0, 0.0]))
    assert step.crossover.k1_N_mm == pytest.approx(0.031)
    with pytest.raises(ValueError):
        moved(found, np.array([-1.0, 0.0, 0.0]))


@pytest.mark.mpi
def test_uncertainty_of_a_linear_frame(tmp_path):
    """F = (k1 γ + k3 γ³) L_fabric²/(L_frame sin θ): the errors of k1, k3 are those of F times that.

    The springs are correlated, and specimens differ in k1 by 8 %. k1 is as uncertain as it is
    large: the other way it would be negative.
    """
    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))
    k1, k3, std, r = 0.03, 0.06, np.array([0.03, 0.01]), -0.8
    parameters = [
        parameter("k1_N", float(std[0]), **{"crossover.k1_N_mm": 1.0}) | {"value": k1},
        parameter("k3_N", float(std[1]), **{"crossover.k3_N_mm": 1.0}) | {"value": k3},
    ]
    specimens = [{"parameters": ["k1_N"], "test": "picture_frame", "share": 0.08, "std": 0.02}]
    content = fabric(
        parameters=parameters,
        correlations=[[1.0, r], [r, 1.0]],
        specimens=specimens,
        tow={"width_mm": 4.57, "height_mm": 0.04, "C1_MPa": 6e7},
        crossover={"dashpot_N_s_mm": 0.0},
    )
    if MPI.COMM_WORLD.rank == 0:
        written(folder, content)
    MPI.COMM_WORLD.barrier()
    more = {"hold_s": 0.0, "unload": False, "fabric_length_mm": 48.0}
    case = make_case("picture_frame", **{**FRAME, **more})
    told = []
    result = run(
        case,
        folder / "out",
        fabric=folder / "fabric.yaml",
        uncertainty=True,
        pictures=False,
        progress=lambda done, *_: told.append(done),
    )
    found = result["uncertainty"]
    assert found["runs"] == 2 and found["left_out"] == [] and found["of"] == ["k1_N", "k3_N"]
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)
    table = pd.read_csv(folder / "out" / "uncertainty.csv")
    gamma = np.radians(table["shear_angle_deg"].to_numpy())
    lever = 192.0 * np.sin(np.pi / 4.0 - gamma / 2.0) / 48.0**2
    J = np.stack([gamma, gamma**3], axis=1) / lever[:, None]
    C = np.outer(std, std) * [[1.0, r], [r, 1.0]]
    exact = np.sqrt(np.einsum("ni,ij,nj->n", J, C, J))
    assert table["force_N"].to_numpy() == pytest.approx(J @ [k1, k3], rel=1e-3)
    assert table["force_N_fit"].to_numpy() == pytest.approx(exact, rel=2e-3)
    assert table["force_N_specimens"].to_numpy() == pytest.approx(0.08 * k1 * J[:, 0], rel=2e-3)
    peak = found["quantities"]["peak_force_N"]
    assert peak["fit"] == pytest.approx(exact[-1], rel=2e-3)
    assert "largest_shear_angle_deg" not in found["quantities"]
    rows = {row["key"]: row for row in result["fabric"]["taken"]}
    assert rows["crossover.k1_N_mm"]["std"] == pytest.approx(0.03)
    assert rows["tow.C1_MPa"]["source"] == "stated"
    again = yaml.safe_load((folder / "out" / "case.yaml").read_text())
    assert again["fabric"] is None and again["crossover"]["k3_N_mm"] == 0.06


@pytest.mark.slow
def test_a_drape_says_how_uncertain_it_is(tmp_path, capsys):
    """One spring with an error: each angle's is its change in a case that has the other spring."""
    keys = {"crossover.k1_N_mm": 1.0}
    content = fabric(
        parameters=[parameter("k1_N", 0.02, **keys) | {"value": 0.03}], correlations=[[1.0]]
    )
    file = written(tmp_path, content)
    path, out = tmp_path / "small.yaml", tmp_path / "out"
    path.write_text(json.dumps({**SMALL, "points": [{"x_mm": 30, "y_mm": 30}]}))
    arguments = ["run", str(path), "--out", str(out), "--no-pictures"]
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--fabric", str(file), "--uncertainty"])
    said = capsys.readouterr()
    assert not end.value.code
    assert "1 further runs, 2 times the time of one, for k1_N" in said.err
    assert "picture_frame: baseline" in said.out and "largest shear angle" in said.out
    assert "(fit) ± 0 (specimens)" in said.out
    table = pd.read_csv(out / "uncertainty.csv")
    angles = []
    for k1 in (0.03, 0.05):
        case = with_fabric(load_case(path), read_fabric(file))
        crossover = case.crossover.model_copy(update={"k1_N_mm": k1})
        place = tmp_path / f"{k1}"
        run(case.model_copy(update={"crossover": crossover}), place, pictures=False)
        angles.append(pd.read_csv(place / "crossings.csv")["angle_deg"].to_numpy())
    change = np.abs(angles[1] - angles[0])
    assert change.max() > 0.01
    assert table["angle_deg_fit"].to_numpy() == pytest.approx(change, abs=1e-4)
    found = json.loads((out / "result.json").read_text())["uncertainty"]
    every = next(row for row in found["regions"] if row["region"] == "all")
    assert every["fit_deg"] == pytest.approx(np.sqrt(np.mean(change**2)), abs=1e-4)
    assert {"punch_force_N", "points.0.angle_deg"} <= set(found["quantities"])
    assert any(name.startswith("wrinkles.") for name in found["quantities"])


# Round --------------------------------------------------------------------------------------------


def test_from_readings_to_the_frame_again(tmp_path):
    """A frame with friction, diagnosed, run with its fabric.yaml: the diagnosis' own forces.

    Within 0.1 % of the largest force.
    """
    hidden = Hidden("crossover_friction", "Dahl", {"m_c_N": 0.01, "slip_angle_rad": 0.05})
    case = make_case("picture_frame", **FRAME)
    made = synthesise(case, [hidden], 0.02, readings=80, rates=(35.0, 105.0, 60.0))
    write_measurement(tmp_path / "frame", made)
    out = tmp_path / "found"
    measurement = read_measurement(tmp_path / "frame")
    found = diagnose([measurement], out, effects=["crossover_friction", "load_drift"])
    (d,) = found.diagnoses
    assert [effect.name for effect in d.effects] == ["crossover_friction"]
    file = read_fabric(out / "fabric.yaml")
    assert file.model_dump(by_alias=True, exclude_unset=True).keys() == found.fabric.keys()
    # Errors and their correlations are those of the fit.
    errors = {p.name: p.std for p in file.parameters}
    assert errors == pytest.approx({n: e for n, e in d.final.errors.items() if n in errors})
    free = [n for n, p in errors.items() if p is not None]
    root = d.final.root[[list(d.final.values).index(n) for n in free]]
    place = [list(errors).index(n) for n in free]
    r = np.array(file.correlations)[np.ix_(place, place)]
    size = np.linalg.norm(root, axis=1)
    assert r == pytest.approx(root @ root.T / np.outer(size, size), abs=1e-9)
    assert_the_net_is_the_loops(
        tmp_path, measurement, d.final.variants, d.final.values, fabric=out / "fabric.yaml"
    )


def assert_the_net_is_the_loops(folder, measurement, variants, values, *, crossover=None, **more):
    """Forces of a whole net within 0.1 % of the largest of the loop's single crossing's."""
    # The net's rates are difference quotients: of small steps.
    finer = {"solver": {**FRAME["solver"], "first_step_s": 1.0, "largest_step_s": 1.0}}
    of_case = {**FRAME, **finer, "fabric_length_mm": 48.0, "crossover": crossover or {}}
    result = run(make_case("picture_frame", **of_case), folder / "run", pictures=False, **more)
    assert result["completed"]
    curve = pd.read_csv(folder / "run" / "curve.csv")
    read = {name: curve[name].to_numpy() for name in ("time_s", "displacement_mm", "force_N")}
    rig = measurement.rig.model_copy(update={"fabric_length_mm": 48.0})
    again = replace(measurement, rig=rig, runs=(Run("curve.csv", False, "", read),))
    expected, _ = PictureFrame([again]).predict(variants, values)
    # At the start and where the motion turns there are two rates.
    turns = [0.0, 60.0 * 80.0 / 35.0, 60.0 * 80.0 / 35.0 + 20.0]
    away = np.abs(read["time_s"][:, None] - turns).min(axis=1)
    compared = away > 1.5
    assert compared.sum() > 50
    np.testing.assert_allclose(
        read["force_N"][compared], expected[compared], atol=1e-3 * expected.max()
    )


#: Name and label of a term, its coefficients and what else its shape has.
TERMS = {
    "spring": ("elastic_moment_of_largest_angle", "largest angle, step", (-0.7,), {"place": 0.4}),
    "dashpot": ("viscous_moment_of_path", "path, 3 coefficients", (3.0, -9.0, 8.0), {}),
    "friction": ("dissipative_moment_of_time", "time, saturation", (0.02,), {"0": 0.01}),
    "memory": ("elastic_moment_of_history", "recent angle, linear", (-0.6,), {}),
}


@pytest.mark.parametrize(
    "term",
    ["spring", *(pytest.param(term, marks=pytest.mark.slow) for term in list(TERMS)[1:])],
)
def test_a_term_is_in_a_net_what_it_is_in_the_loop(term, tmp_path):
    """A term without a formula, by its keys in a case: out, a hold and back.

    The dashpot beside it is weak: a net's rate is a difference quotient, off by γ̈ Δt/2.
    """
    case = make_case("picture_frame", **FRAME)
    write_measurement(tmp_path / "frame", synthesise(case, [], 0.02, readings=60))
    measurement = read_measurement(tmp_path / "frame")
    name, label, coefficients, others = TERMS[term]
    effect = next(t for t in PictureFrame([measurement]).terms if t.name == name)
    variant = next(v for v in effect.variants if v.label == label)
    values = {"k1_N": 0.03, "k3_N": 0.06, "c1_N_s": 0.2}
    values |= {p.name: p.starts[0] for p in variant.shapes}
    values |= {f"{name}_{k}": c for k, c in enumerate(coefficients, start=1)}
    values |= {f"{name}_{k}": value for k, value in others.items()}
    entries, _ = law_entries(variant, values, tmp_path)
    crossover = {"k1_N_mm": 0.03, "k3_N_mm": 0.06, "dashpot_N_s_mm": 0.2, "laws": entries}
    assert_the_net_is_the_loops(tmp_path, measurement, (variant,), values, crossover=crossover)


@pytest.mark.slow
def test_readings_on_one_curve_are_a_table(tmp_path):
    """Monotone at one rate: m = 0.02 γ + 2 γ⁵, which no spring of the baseline is."""
    out = tmp_path / "found"
    D = np.linspace(1.0, 90.0, 60)
    theta = np.arccos((np.sqrt(2.0) + D / 192.0) / 2.0)
    gamma = np.pi / 2.0 - 2.0 * theta
    m = 0.02 * gamma + 2.0 * gamma**9
    F = m * 96.0**2 / (192.0 * np.sin(theta))
    F += np.random.default_rng(5).normal(0.0, 0.01, len(F))
    folder = tmp_path / "frame"
    folder.mkdir()
    rows = {"time_s": D, "displacement_mm": D, "force_N": F}
    pd.DataFrame(rows).to_csv(folder / "run.csv", index=False)
    content = {
        "schema": "fabric-measurement/1",
        "test": "picture_frame",
        "title": "one way",
        "fabric": {"areal_density_kg_m2": 0.2},
        "rig": {"frame_length_mm": 192, "fabric_length_mm": 96},
        "noise": {"force_N": 0.01},
        "runs": [{"file": "run.csv", "role": "fit"}],
    }
    (folder / "measurement.yaml").write_text(yaml.safe_dump(content))
    found = diagnose([read_measurement(folder)], out, effects=["crossover_friction"])
    assert found.diagnoses[0].curve is not None
    file = read_fabric(out / "fabric.yaml")
    assert file.tow is None and "as a table" in file.tests[0].known
    (law,) = file.crossover.laws
    assert law.law == "tabulated_spring"
    own = moments(law.build(1.0), gamma[5:])
    assert own == pytest.approx(m[5:], abs=0.03 * m.max())
    (band,) = file.parameters
    assert uncertain(file) == ["curve_band"]
    above = moved(file, np.array([band.std]))
    assert np.all(
        np.array(above.crossover.laws[0].moments_N_mm[1:]) > np.array(law.moments_N_mm[1:])
    )


def test_what_is_of_the_rig_is_named_and_left_out(tmp_path):
    hidden = Hidden("load_drift", "drift", {"drift_N_s": 0.01})
    case = make_case("picture_frame", **FRAME)
    made = synthesise(case, [hidden], 0.02, readings=60)
    write_measurement(tmp_path / "frame", made)
    found = diagnose(
        [read_measurement(tmp_path / "frame")], tmp_path / "out", effects=["load_drift"]
    )
    file = read_fabric(tmp_path / "out" / "fabric.yaml")
    (other,) = file.not_of_the_fabric
    assert other.effect == "load_drift"
    assert other.values["drift_N_s"] == pytest.approx(0.01, rel=0.2)
    assert file.crossover.laws == []
    assert file.crossover.k1_N_mm == pytest.approx(found.diagnoses[0].final.values["k1_N"])
    assert json.loads((tmp_path / "out" / "report.json").read_text())["verdict"] == "effect_found"


def test_what_changes_a_drape_s_rig_is_no_key_of_the_fabric(monkeypatch):
    """A holder that is pushed and rubs: its force is the effect's, as friction is the tools'."""
    monkeypatch.setattr(fabric_of, "correlation_of", lambda model, names: np.zeros((0, 0)))
    monkeypatch.setattr(fabric_of, "scatter", lambda model: {})
    (effect,) = (e for e in DRAPE_EFFECTS if e.name == "holder_pressure")
    part = fabric_of._Part("drape")
    model = SimpleNamespace(values={"holder_force_N": 300.0}, at_bound=())
    fabric_of._add_fitted(part, model, [(effect, effect.variants[0])], Path())
    assert (part.tow, part.crossover, part.parameters) == ({}, {}, [])
