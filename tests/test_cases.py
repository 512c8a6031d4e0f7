"""Case files: what is read, and the one line that each mistake gets."""

import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.inputs.keys import documented, one_of, plain
from fabric_fenicsx.rigs.cantilever import CantileverCase
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.registry import RIGS, rig

DEMOS = Path(__file__).parents[1] / "demos"


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "case.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def message(path: Path, *settings: str) -> str:
    with pytest.raises(InputError) as caught:
        load_case(path, settings)
    text = str(caught.value)
    assert text and "\n" not in text
    assert "pydantic" not in text.lower() and "Input should" not in text
    return text


@pytest.mark.parametrize("path", sorted(DEMOS.glob("*.yaml")), ids=lambda path: path.stem)
def test_demos_are_valid(path):
    assert load_case(path).test in RIGS


def test_settings_lie_over_the_file(tmp_path):
    path = written(tmp_path, "test: drape\nsheet: {width_mm: 96}\npoints: [{x_mm: 1, y_mm: 2}]\n")
    settings = ["sheet.length_mm=48", "tow.C1_MPa=3e4", "points.0.x_mm=7", "title=x"]
    case = load_case(path, [*settings, "assumptions.sheet.width_mm=a guess"])
    assert isinstance(case, DrapeCase)
    assert (case.sheet.width_mm, case.sheet.length_mm) == (96.0, 48.0)
    assert case.tow.C1_MPa == 3e4
    assert (case.points[0].x_mm, case.points[0].y_mm) == (7.0, 2.0)
    assert case.assumptions == {"sheet.width_mm": "a guess"}


def test_numbers_without_a_dot_are_numbers(tmp_path):
    # YAML 1.1 reads 1e-4 as text.
    case = load_case(written(tmp_path, "test: drape\nsolver: {smallest_step_s: 1e-5}\n"))
    assert case.solver.smallest_step_s == 1e-5


def test_a_setting_leaves_an_anchor_alone(tmp_path):
    text = "test: drape\npoints:\n  - &a {x_mm: 1, y_mm: 2}\n  - *a\n"
    case = load_case(written(tmp_path, text), ["points.0.x_mm=9"])
    assert isinstance(case, DrapeCase)
    assert [point.x_mm for point in case.points] == [9.0, 1.0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sheet: {width_mm: -3.0}", "sheet.width_mm: -3, allowed is a number greater than 0"),
        ("sheet: {width_mm: wide}", "sheet.width_mm: 'wide', allowed is a number greater than 0"),
        ("sheet: {width_mm: [1, 2]}", "sheet.width_mm: [1, 2], allowed is a number greater than 0"),
        ("sheet: {width_mm: null}", "sheet.width_mm: null, allowed is a number greater than 0"),
        ("punch_travel_mm: .nan", "punch_travel_mm: nan, allowed is a number greater than 0"),
        ("punch_travel_mm: -.inf", "punch_travel_mm: -inf, allowed is a number greater than 0"),
        (
            "tow: {height_mm: 1.0e+300}",
            "tow.height_mm: 1e+300, allowed is a number greater than 0, ",
        ),
        (
            "tow: {height_mm: 1.0e-99}",
            "height_mm: 1e-99, allowed is a number greater than 0, 1e-30",
        ),
        ("holder_gap_mm: nan", "holder_gap_mm: 'nan', allowed is a number"),
        ("sheet: {subdivisions: 1.5}", "subdivisions: 1.5, allowed is a whole number from 1 to 64"),
        ("sheet: {subdivisions: 0}", "subdivisions: 0, allowed is a whole number from 1 to 64"),
        ("solver: {spectral_radius: 2}", "spectral_radius: 2, allowed is a number from 0 to 1"),
        ("gravity_mm_s2: -1", "gravity_mm_s2: -1, allowed is a number of at least 0"),
        ("symmetry: half", "symmetry: 'half', allowed is quarter or none"),
        ("title: 3", "title: 3, allowed is text"),
        ("mesh: 3", "mesh: 3, allowed is text or null"),
        ("sheet: 3", "sheet: 3, allowed is a group of keys"),
        ("sheet:", "sheet: null, allowed is a group of keys"),
        ("points: 3", "points: 3, allowed is a list, each entry a group of keys"),
        ("points: [{x_mm: 1}]", "points.0.y_mm: missing, allowed is a number"),
        ("points: [3]", "points.0: 3, allowed is a group of keys"),
        ("assumptions: {title: 3}", "assumptions.title: 3, allowed is text"),
        ("assumptions: {nothing: x}", "assumptions: nothing is no key of this case"),
        ("punch_travel_mm: 500", "punch_travel_mm: at most punch_radius_mm + edge_radius_mm"),
        ("solver: {first_step_s: 9}", "solver: smallest_step_s <= first_step_s <= largest_step_s"),
        ("sheet: {warp_spacing_mm: 200}", "sheet: warp_spacing is 200.0 mm"),
        ("1: 2", "1: a key that is no text"),
    ],
)
def test_what_is_allowed_is_said(tmp_path, text, expected):
    path = written(tmp_path, f"test: drape\n{text}\n")
    said = message(path)
    assert said.startswith(f"{path}: ")
    assert expected in said


@pytest.mark.parametrize(
    "text",
    ["sheet: {width_mm: true}", "sheet: {subdivisions: yes}", "points: [{x_mm: on, y_mm: 1}]"],
)
def test_true_is_no_number(tmp_path, text):
    said = message(written(tmp_path, f"test: drape\n{text}\n"))
    assert "true, allowed is a" in said and "number" in said


def test_true_is_no_number_in_a_list(tmp_path):
    said = message(written(tmp_path, "test: cantilever\nlengths_mm: [50, true]\n"))
    assert "lengths_mm.1: true, allowed is a number greater than 0" in said


def test_an_unknown_key_gets_the_allowed_ones(tmp_path):
    said = message(written(tmp_path, "test: drape\nsheet: {widht_mm: 3}\n"))
    assert "sheet.widht_mm: unknown key, did you mean width_mm?, allowed are width_mm, " in said
    assert "weft_spacing_mm" in said
    said = message(written(tmp_path, "test: drape\nqqq: 3\n"))
    assert "qqq: unknown key, allowed are title" in said and "did you mean" not in said


def test_several_mistakes_are_counted(tmp_path):
    said = message(written(tmp_path, "test: drape\nq: 1\nsheet: {width_mm: -1, z: 2}\n"))
    assert said.endswith("(and 2 more)")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "empty, allowed is a mapping of keys"),
        ("- 1\n", "[1], allowed is a mapping of keys"),
        ("sheet: {}\n", f"test: missing, allowed is {one_of(RIGS)}"),
        ("test: drap\n", "test: 'drap', did you mean drape?"),
        ("test: [drape]\n", "test: ['drape'], allowed is drape"),
        ("test: drape\nsheet: {width_mm: 3\n", "line 3, column 1: "),
        ("test: drape\n\tsheet: 3\n", "line 2, column 1: "),
        ("test: drape\ntitle: a\ntitle: b\n", "line 3, column 1: the key title stands twice"),
        ("test: drape\nsheet: {width_mm: 3, width_mm: 4}\n", "the key width_mm stands twice"),
        ("test: !!python/object/apply:os.getcwd []\n", "could not determine a constructor"),
        ("test: drape\ntitle: 2021-13-45\n", "month must be in 1..12"),
        ("test: drape\n---\ntest: drape\n", "expected a single document"),
        ("test: drape\ntitle: \x01\n", "special characters are not allowed"),
        (b"test: drape\ntitle: \xff\n", "not UTF-8 text at byte 19"),
        ("[" * 3000, "nested too deep"),
    ],
)
def test_what_is_no_case_file(tmp_path, text, expected):
    path = written(tmp_path, text)
    said = message(path)
    assert said.startswith(f"{path}: ")
    assert expected in said


def test_missing_and_folder(tmp_path):
    assert "no such file" in message(tmp_path / "nothing.yaml")
    assert "is a folder" in message(tmp_path)
    file = written(tmp_path, "test: drape")
    assert "cannot be read (Not a directory)" in message(file / "below.yaml")


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("sheet.widht_mm=3", "--set: sheet.widht_mm: unknown key, did you mean width_mm?"),
        ("nothing.at.all=3", "--set: nothing: unknown key"),
        ("sheet.width_mm", "--set: 'sheet.width_mm', allowed is dotted.key=value"),
        ("=3", "allowed is dotted.key=value"),
        ("sheet..width_mm=3", "allowed is dotted.key=value"),
        ("sheet.width_mm=-3", "--set: sheet.width_mm: -3, allowed is a number greater than 0"),
        ("sheet.width_mm=", "--set: sheet.width_mm: null, allowed is a number greater than 0"),
        ("sheet.width_mm=true", "--set: sheet.width_mm: true, allowed is a number greater than 0"),
        ("title=[", "--set: title: "),
        ("title.more=3", "--set: title.more: title is 'text', no group of keys"),
        ("points.4.x_mm=3", "--set: points.4.x_mm: 4 after points, allowed is no number"),
        ("test=dripe", "--set: test: 'dripe', did you mean drape?"),
    ],
)
def test_a_bad_setting_names_the_option(tmp_path, setting, expected):
    path = written(tmp_path, "test: drape\ntitle: text\npoints: []\n")
    assert expected in message(path, setting)


def test_every_key_is_documented():
    for name in RIGS:
        rows = {row.name: row for row in documented(rig(name).case)}
        assert len(rows) > 20
        for row in rows.values():
            assert row.description and row.allowed and row.default
    rows = {row.name: row for row in documented(rig("drape").case)}
    assert rows["crossover.alignment_N_mm"].unit == "N mm"
    assert rows["crossover.k1_N_mm"].unit == "N/mm"
    assert rows["tow.density_kg_mm3"].unit == "kg/mm³"
    assert rows["points[].x_mm"].default == "needed"
    assert rows["sheet.subdivisions"].allowed == "a whole number from 1 to 64"
    assert rig("cantilever").case is CantileverCase


def test_long_values_are_shortened():
    assert len(plain("x" * 500)) == 60


@pytest.mark.parametrize(
    ("laws", "expected"),
    [
        (
            "[{law: dahl, limit_N_mm: 1}]",
            "crossover.laws.0.law: 'dahl', allowed is compaction",
        ),
        ("[{limit_N_mm: 1}]", "crossover.laws.0.law: missing, allowed is compaction"),
        (
            "[{law: locking, angle_deg: -1, k_N_mm: 1}]",
            "angle_deg: -1, allowed is a number greater than 0",
        ),
        ("[{law: maxwell, k_N_mm: 1}]", "relaxation_time_s: missing"),
        (
            "[{law: maxwell, k_N_m: 1, k_N_mm: 1, relaxation_time_s: 1}]",
            "unknown key, did you mean k_N_mm?",
        ),
        (
            "[{law: tabulated_spring, angles_deg: [0, 9], moments_N_mm: [1, 2]}]",
            "the table starts at",
        ),
    ],
)
def test_shear_laws_in_a_case(tmp_path, laws, expected):
    """Laws that a key tells apart: the line names the law's own key."""
    path = tmp_path / "case.yaml"
    path.write_text(f"test: picture_frame\ncrossover: {{laws: {laws}}}\n")
    with pytest.raises(InputError) as error:
        load_case(path)
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


def test_shear_laws_become_laws_of_a_crossing(tmp_path):
    """Per area times the area of a crossing: 0.01 N/mm on 144 mm² is 1.44 N mm."""
    path = tmp_path / "case.yaml"
    path.write_text(
        "test: picture_frame\n"
        "crossover: {laws: [{law: dahl_friction, limit_N_mm: 0.01, stick_angle_deg: 1}]}\n"
    )
    (law,) = load_case(path).crossover.laws
    friction = law.build(144.0)
    assert friction.limit == pytest.approx(1.44)
    assert friction.stiffness == pytest.approx(1.44 / np.radians(1.0))


def test_a_rig_is_called_like_its_file_and_an_unknown_one_is_told_the_names():
    for name in RIGS:
        assert get_args(rig(name).case.model_fields["test"].annotation) == (name,)
    with pytest.raises(InputError, match=f"^test: nothing, allowed is {one_of(RIGS)}$"):
        rig("nothing")


def test_a_case_is_read_and_laid_out_without_dolfinx(tmp_path):
    """Reading must not wait for what only a run needs."""
    code = """
import sys
from pathlib import Path
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.registry import RIGS, rig
for name in RIGS:
    path = Path(sys.argv[1]) / "case.yaml"
    path.write_text(f"test: {name}")
    case = load_case(path)
    assert rig(name).fabrics(case, Path())
heavy = {"dolfinx", "petsc4py", "mpi4py", "pyvista", "gmsh", "matplotlib"} & set(sys.modules)
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True, timeout=60)


def test_a_sheet_is_checked_with_its_own_weave(tmp_path):
    """Its own spacings and outline; the file of a pattern is not read."""
    sheet = "test: drape\nsymmetry: none\nsheet: {width_mm: 20, length_mm: 20}\n"
    small = "weave: {pattern: nothing.txt, warp_spacings_mm: [4], weft_spacings_mm: [4]}\n"
    assert load_case(written(tmp_path, sheet + small)).weave is not None
    said = message(written(tmp_path, sheet + small.replace("[4]", "[24]")))
    assert "warp spacing is [24.0] mm; the outline is 20 mm wide" in said


def test_a_punch_that_meets_the_edge_of_the_hole_is_refused():
    """A ball of 85 mm over a hole of 80 with an edge of 10: (95² − 90²)^½ of height are left."""
    keys = {"test": "drape", "punch_radius_mm": 85.0}
    deepest = 95.0 - np.sqrt(95.0**2 - 90.0**2)
    assert DrapeCase.model_validate(keys | {"punch_travel_mm": deepest - 0.01})
    with pytest.raises(ValueError, match=r"punch_travel_mm: at most 64\.59"):
        DrapeCase.model_validate(keys | {"punch_travel_mm": deepest + 0.01})
