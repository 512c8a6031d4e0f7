"""Exports of testing machines and cameras become folders that a diagnosis reads."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from test_diagnose import command

from fabric_fenicsx.inputs.exports.units import factor, split_unit
from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.importing.thinning import thinned

KNOWN = [
    *("--set", "fabric.areal_density_kg_m2=0.2"),
    *("--set", "rig.frame_length_mm=192"),
    *("--set", "rig.fabric_length_mm=96"),
]
POUND = 0.45359237 * 9.80665
"""Newtons, by the definitions of the pound and of standard gravity."""

TIME = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5])
TRAVEL = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.25])
FORCE = np.array([0.0, 1.5, 3.25, 1234.5, 6.0, 7.75])
RECORD = list(zip(TIME, TRAVEL, FORCE, strict=True))


def imported(tmp_path, text, *options, test="picture_frame", encoding="utf-8", known=KNOWN):
    """The folder that became of an export."""
    path = tmp_path / "export.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    out = tmp_path / "out"
    assert command("import", path, "--as", test, "--out", out, "--quiet", *known, *options) == 0
    return out


def runs(folder):
    content = yaml.safe_load((folder / "measurement.yaml").read_text(encoding="utf-8"))
    return [pd.read_csv(folder / run["file"]) for run in content["runs"]]


def is_the_record(table, time=TIME, travel=TRAVEL, force=FORCE):
    np.testing.assert_allclose(table["time_s"], time, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(table["displacement_mm"], travel, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(table["force_N"], force, rtol=1e-11, atol=1e-12)


def lines(separator, *columns, form="{:.6f}", decimal="."):
    """Rows of numbers as a machine writes them."""
    cells = [
        [form.format(x).replace(".", decimal) for x in row] for row in zip(*columns, strict=True)
    ]
    return "".join(separator.join(row) + "\n" for row in cells)


BLUEHILL = (
    "Specimen properties : Anvil height,3.11,mm\n"
    'Specimen properties : Specimen label,""\n\n'
    "Time,Extension,Load,Tensile strain (Extension),Tensile stress\n"
    "(s),(mm),(kN),(%),(MPa)\n"
)
TESTXPERT = "Prüfer;Müller\nDatum;12.05.2024\n\nPrüfzeit;Traverse;Standardkraft\ns;mm;N\n"
STYLES = {
    "Bluehill": (
        BLUEHILL
        + "".join(f'"{t}","{d}","{f / 1e3:.7f}","{d:.3f}","{f:.3f}"\n' for t, d, f in RECORD),
        "utf-8",
    ),
    "Bluehill, decimal commas": (
        BLUEHILL
        + "".join(
            f'"{t}","{d}","{f / 1e3:.7f}","{d:.3f}","{f:.3f}"\n'.replace(".", ",")
            for t, d, f in RECORD
        ),
        "utf-8-sig",
    ),
    "testXpert": (TESTXPERT + lines(";", TIME, TRAVEL, FORCE, decimal=",") + ";;\n\n", "cp1252"),
    "testXpert, tabs": (
        TESTXPERT.replace(";", "\t") + lines("\t", TIME, TRAVEL, FORCE, decimal=","),
        "utf-16",
    ),
    "TestSuite": (
        "MTS793|MPT|ENU|1|0|.|/|:|1|0|0|A\n\nData Header:\tTime: 12.3\tSec\t11.05.2024 10:15:00\n"
        "Axial Displacement\tAxial Force\tRunning Time\nmm\tkN\tSec\n"
        + lines("\t", TRAVEL, FORCE / 1e3, TIME, form="{:.8e}"),
        "utf-8",
    ),
    "Trapezium": (
        '"1 _ 1",,\n"Time","Force","Stroke"\n"min","N","mm"\n'
        + "".join(
            f'"{t / 60:.14f}","{f}","{d}"\n' for t, f, d in zip(TIME, FORCE, TRAVEL, strict=True)
        ),
        "utf-8",
    ),
    "units in the headings": (
        "Zeit in ms;Kraft in daN;Weg cm\n"
        + lines(";", TIME * 1e3, FORCE / 10, TRAVEL / 10, form="{:.7f}"),
        "utf-16-le",
    ),
    "single blanks": (
        "Time [s] Crosshead travel [mm] Load cell [N]\n" + lines(" ", TIME, TRAVEL, FORCE),
        "utf-8",
    ),
    "results above, headings on each page": (
        "Nr;Fmax;dL\n;N;mm\n1;12,5;33,1\n2;12,5;33,1\n3;12,5;33,1\n4;12,5;33,1\n5;12,5;33,1\n"
        "6;12,5;33,1\n7;12,5;33,1\n\nt;s;F\ns;mm;N\n"
        + lines(";", TIME[:3], TRAVEL[:3], FORCE[:3], decimal=",")
        + "\nt;s;F\ns;mm;N\n"
        + lines(";", TIME[3:], TRAVEL[3:], FORCE[3:], decimal=","),
        "utf-8",
    ),
    "blanks": (
        "# a comment\nTime [s]   Crosshead [um]   Load [mN]\n"
        + lines("     ", TIME, TRAVEL * 1e3, FORCE * 1e3),
        "latin-1",
    ),
    "thousands": (
        "Time (s)|Extension(mm)|Load (N)\n"
        + "".join(f"{t}|{d}|{f:,.2f}\n".replace(",", " ") for t, d, f in RECORD),
        "utf-8",
    ),
    "thousands with points": (
        "Zeit [s];Weg [mm];Kraft [N]\n"
        + "".join(f"{t};{d};{f:,.2f}\n".translate(str.maketrans(".,", ",.")) for t, d, f in RECORD),
        "utf-8",
    ),
    "a clock": (
        "Elapsed;Position [mm];Force [N]\n"
        + "".join(f"0:00:{t:04.1f};{d};{f}\n" for t, d, f in RECORD),
        "utf-8",
    ),
}


@pytest.mark.parametrize("style", STYLES)
def test_every_style_gives_the_same_record(style, tmp_path):
    text, encoding = STYLES[style]
    (table,) = runs(imported(tmp_path, text, encoding=encoding))
    is_the_record(table)
    assert read_measurement(tmp_path / "out").runs[0].count == 6


def test_units_are_what_they_are_defined_as():
    for unit, quantity, value in (
        ("lbf", "force", POUND),
        ("kgf", "force", 9.80665),
        ("gf", "force", 0.00980665),
        ("cN", "force", 0.01),
        ("KN", "force", 1000.0),
        ("mN", "force", 1e-3),
        ("MN", "force", 1e6),
        ("[in]", "length", 25.4),
        ("µm", "length", 1e-3),
        ("ft", "length", 12 * 25.4),
        ("h", "time", 3600.0),
        ("rad", "angle", 180.0 / np.pi),
        ("gon", "angle", 90.0 / 100.0),
        ("(%)", "strain", 0.01),
    ):
        assert factor(unit, quantity) == pytest.approx(value, rel=1e-14), unit
    assert factor("furlong", "length") is None and factor("s", "force") is None


def test_headings_are_parted():
    for heading, parts in {
        "Force [kN]": ("Force", "kN"),
        "Kraft in N": ("Kraft", "N"),
        "Standardkraft": ("Standardkraft", ""),
        "Traverse mm": ("Traverse", "mm"),
        "Extension(mm)": ("Extension", "mm"),
        "Load (lbf)": ("Load", "lbf"),
        "t/min": ("t", "min"),
        "force_N": ("force", "N"),
        "Tensile strain (Extension) (%)": ("Tensile strain (Extension)", "%"),
        "s": ("s", ""),
    }.items():
        assert split_unit(heading) == parts, heading


def test_what_a_strain_is_of_and_pounds(tmp_path):
    text = "time s;Dehnung [%];Load (lbf)\n" + lines(";", TIME, TRAVEL / 2, FORCE)
    (table,) = runs(imported(tmp_path, text, "--gauge", 200))
    is_the_record(table, force=FORCE * POUND)


SIDE = (
    '"1 _ 1",,,"1 _ 2",,\n'
    '"Time","Force","Stroke","Time","Force","Stroke"\n"sec","N","mm","sec","N","mm"\n'
)


def test_specimens_side_by_side(tmp_path):
    """The first one broke sooner."""
    text = SIDE + "".join(
        (f"{t},{f},{d}" if k < 4 else ",,") + f",{t},{2 * f},{d}\n"
        for k, (t, f, d) in enumerate(zip(TIME, FORCE, TRAVEL, strict=True))
    )
    out = imported(tmp_path, text, "--specimen", "A", "--specimen", "B", "--role", "fit")
    first, second = runs(out)
    is_the_record(first, TIME[:4], TRAVEL[:4], FORCE[:4])
    is_the_record(second, force=2 * FORCE)
    found = read_measurement(out).runs
    assert [(r.specimen, r.label) for r in found] == [("A", "export 1 _ 1"), ("B", "export 1 _ 2")]


def test_specimens_with_one_time(tmp_path):
    text = "Time [s];Force 1 [N];Travel 1 [mm];Force 2 [N];Travel 2 [mm]\n"
    text += lines(";", TIME, FORCE, TRAVEL, 2 * FORCE, TRAVEL)
    first, second = runs(imported(tmp_path, text))
    is_the_record(first)
    is_the_record(second, force=2 * FORCE)


@pytest.mark.parametrize(
    "between",
    [
        "Specimen 2\n",
        "t [s];F [N];s [mm]\n",
        "Specimen 2\nt [s];F [N];s [mm]\n",
        "\nend\n",
        "Probe 2\n\nt;F;s\ns;kN;mm\n",
    ],
)
def test_specimens_below_each_other(between, tmp_path):
    force = FORCE / 1e3 if "kN" in between else FORCE
    text = "t [s];F [N];s [mm]\n" + lines(";", TIME, FORCE, TRAVEL) + between
    out = imported(tmp_path, text + lines(";", TIME, force, TRAVEL, form="{:.7f}"))
    for table in runs(out):
        is_the_record(table)
    assert len(runs(out)) == 2


def test_rows_that_are_no_readings_are_told(tmp_path):
    rows = lines(";", TIME, FORCE, TRAVEL).splitlines()
    rows[2:2] = ["0.7;n/a;0.3", "pause by the operator", "---;---;---", "Hold;on;please"]
    text = "t [s];F [N];s [mm]\n" + "\n".join(rows) + "\nend of the test\n\n"
    out = imported(tmp_path, text)
    is_the_record(*runs(out))
    said = (out / "import.txt").read_text(encoding="utf-8")
    assert "1 row left out, not a number: line 4" in said
    assert "lines between or after the readings that are none: 5, 6, 7, 12" in said


def test_a_table_that_is_left_out_is_told(tmp_path):
    """Results stand above the readings, with a number of a force and no time."""
    text, _ = STYLES["results above, headings on each page"]
    out = imported(tmp_path, text)
    said = (out / "import.txt").read_text(encoding="utf-8")
    assert "a table left out, line 3 to 9: line 1: no column for time_s" in said


def test_signs_zeros_start_and_break(tmp_path):
    force = -np.array([1.0, 2.0, 5.0, 9.0, 6.0, 3.0]) - 0.5
    text = "t [s];F [N];s [mm]\n" + lines(";", TIME, force, TRAVEL + 3)
    options = ["--turn", "force_N", "--preload", 2, "--break", 50]
    (table,) = runs(imported(tmp_path, text, *options, "--zero", "displacement_mm"))
    np.testing.assert_allclose(table["force_N"], [2.5, 5.5, 9.5, 6.5], rtol=1e-12)
    np.testing.assert_allclose(table["displacement_mm"], [0.0, 0.25, 0.5, 0.75], atol=1e-12)
    np.testing.assert_allclose(table["time_s"], TIME[1:5])
    said = (tmp_path / "out" / "import.txt").read_text(encoding="utf-8")
    for words in ("sign turned", "zero taken off: 3.25", "before the start", "after the break"):
        assert words in said


def test_opposite_signs_are_noted_and_left(tmp_path):
    out = imported(tmp_path, "t [s];F [N];s [mm]\n" + lines(";", TIME, -FORCE, TRAVEL))
    is_the_record(*runs(out), force=-FORCE)
    assert "opposite signs: --turn" in (out / "import.txt").read_text(encoding="utf-8")


def test_time_from_the_rate(tmp_path):
    """Up and back at 30 mm/min: half a millimetre a second on the way."""
    travel = np.array([0.0, 1.0, 3.0, 2.0, 0.5])
    text = "Force [N];Travel [mm]\n" + lines(";", travel + 0.5, travel)
    (table,) = runs(imported(tmp_path, text, "--rate", 30))
    np.testing.assert_allclose(table["time_s"], [0.0, 2.0, 6.0, 8.0, 11.0])


def test_thinning_keeps_corners_and_moves_no_reading():
    """Up, a hold, back; ten times as many readings on the way back, which counts by its travel."""
    time = np.concatenate([np.arange(0, 100), np.arange(100, 200), np.arange(200, 300, 0.1)])
    travel = np.interp(time, [0, 100, 200, 300], [0, 20, 20, 0])
    kept = thinned(time, travel, 60)
    assert {0.0, 100.0, 200.0} <= set(time[kept].round(6)) and kept[-1] == len(time) - 1
    assert len(kept) == pytest.approx(60, abs=4)
    moving = travel[kept][time[kept] <= 100.0]
    # A hold takes a third of the time; its share is 1/3 of 4/3, a leg's 1/2 of 4/3.
    for first, last, share in ((0, 100, 0.375), (100, 200, 0.25), (200, 300, 0.375)):
        count = ((time[kept] > first) & (time[kept] <= last)).sum()
        assert count == pytest.approx(60 * share, abs=2)
    # Readings are a fifth of a millimetre apart.
    assert np.ptp(np.diff(moving)) < 0.41
    assert (thinned(time, travel, 5000) == np.arange(len(time))).all()


def test_thinning_of_an_import(tmp_path):
    time = np.arange(0.0, 60.0, 0.05)
    travel = 35.0 - np.abs(35.0 - time * 70.0 / 60.0)
    text = "t [s];s [mm];F [N]\n" + lines(";", time, travel, travel**2, form="{:.9f}")
    (table,) = runs(imported(tmp_path, text, "--thin", 100))
    assert 90 <= len(table) <= 110
    top = table["displacement_mm"].idxmax()
    assert table["time_s"][top] == pytest.approx(30.0, abs=0.05)
    np.testing.assert_allclose(table["force_N"], table["displacement_mm"] ** 2, atol=1e-6)


@pytest.mark.parametrize("shear", [False, True])
def test_a_drape_from_the_last_frame_of_a_camera(shear, tmp_path):
    name = "Shear angle [rad]" if shear else "Angle [deg]"
    angle = np.array([60.0, 70.0, 80.0, 90.0])
    values = np.radians(90.0 - angle) if shear else angle
    text = f"Frame,X [m],Y [m],{name}\n"
    for frame in (1, 2):
        text += lines(
            ",", np.full(4, frame), [0, 0.01, 0.02, 0.03], [0, 0.02, 0.02, 0.02],
            values if frame == 2 else values * 0 + 1, form="{:.12f}",
        )  # fmt: skip
    rig = {"punch_radius": 76.2, "hole_radius": 80, "punch_travel": 65, "fabric_size": 260}
    known = ["--set", "rig.duration_s=60", "--set", "fabric.areal_density_kg_m2=0.2"]
    known += [word for k, v in rig.items() for word in ("--set", f"rig.{k}_mm={v}")]
    (table,) = runs(imported(tmp_path, text, test="drape", known=known))
    np.testing.assert_allclose(table["x_mm"], [0, 10, 20, 30], atol=1e-9)
    np.testing.assert_allclose(table["angle_deg"], angle, rtol=1e-9)


def test_a_strip_that_sags(tmp_path):
    text = "X (cm);Sag (mm)\n" + lines(";", [0.0, 5.0, 10.0], [0.0, 2.5, 9.0])
    known = ["--set", "fabric.areal_density_kg_m2=0.2", "--set", "rig.width_mm=50"]
    out = imported(tmp_path, text, "--constant", "length_mm=120", test="cantilever", known=known)
    (run,) = read_measurement(out).runs
    np.testing.assert_allclose(run.columns["x_mm"], [0, 50, 100])
    np.testing.assert_allclose(run.columns["z_mm"], [0, -2.5, -9])
    np.testing.assert_allclose(run.columns["length_mm"], 120)
    assert np.isnan(run.columns["s_mm"]).all()


BIAS = ["--set", "fabric.areal_density_kg_m2=0.2", "--set", "runs.length_mm=200"]
BIAS += ["--set", "runs.width_mm=100"]


def points(frame, angle, first=""):
    """Nine points of a frame; those outside the middle say something else."""
    text = ""
    for x in (-30, 0, 30):
        for y in (-60, 0, 60):
            value = angle if x == y == 0 else 99.0
            text += f"{first}{x:.1f};{y:.1f};{value:.6f}\n"
    return text


@pytest.mark.parametrize("way", ["time", "rate", "frame", "files"])
def test_angles_of_the_middle_stand_beside_the_force(way, tmp_path):
    """Frames at 0.2, 1.2 and 2.2 s whose middle shears by 10 degrees a second."""
    at = np.array([0.2, 1.2, 2.2])
    record, options, paths = "t [s];F [N];s [mm]\n", [], [tmp_path / "dic.csv"]
    columns = [TIME, FORCE, TRAVEL]
    head = "x [mm];y [mm];gamma [deg]\n"
    if way == "files":
        paths = [tmp_path / f"frame_{k}.csv" for k in (10, 9, 11)]
        for path, k in zip(paths, (1, 0, 2), strict=True):
            path.write_text(head + points(k, 10 * at[k]))
    else:
        first = "t [s];" if way == "time" else "Frame;"
        rows = [points(k, 10 * at[k], f"{at[k] if way == 'time' else k + 1};") for k in range(3)]
        paths[0].write_text(first + head + "".join(rows))
    if way == "rate":
        options = ["--dic-rate", 1, "--dic-start", -0.8]
    elif way in ("frame", "files"):
        record = "t [s];F [N];s [mm];Image\n"
        columns.append(TIME + 0.8 + (8 if way == "files" else 0))
    text = record + lines(";", *columns)
    for path in paths:
        options += ["--dic", path]
    out = imported(tmp_path, text, *options, test="bias_extension", known=BIAS)
    (table,) = runs(out)
    is_the_record(table)
    expected = np.where((TIME < 0.2) | (TIME > 2.2), np.nan, 10 * TIME)
    np.testing.assert_allclose(table["shear_angle_deg"], expected, rtol=1e-9)
    said = (out / "import.txt").read_text(encoding="utf-8")
    assert "linear in the" in said and "2 readings without a frame: empty" in said


def test_a_synthetic_folder_comes_back(tmp_path):
    """Made-up runs in an ugly export of three specimens, with other units and commas."""
    made, out = tmp_path / "made", tmp_path / "out"
    case = Path(__file__).parents[1] / "demos" / "picture_frame.yaml"
    options = ["--noise", 0.02, "--readings", 40, "--quiet"]
    assert command("synthesise", case, "--out", made, *options) == 0
    content = yaml.safe_load((made / "measurement.yaml").read_text())
    text = "Prüfer;Müller\nF max;12,5;N\n\n"
    for k, run in enumerate(content["runs"]):
        table = pd.read_csv(made / run["file"])
        text += f"Probe {k + 1}\nPrüfzeit;Traversenweg;Standardkraft;Bemerkung\nmin;µm;kN;\n"
        for t, d, f in table.to_numpy():
            text += f'"{t / 60:.12f}";"{1e3 * d:.6f}";"{f / 1e3:.10f}";ok\n'.replace(".", ",")
    path = tmp_path / "export.txt"
    path.write_bytes(text.encode("utf-16"))
    settings = []
    for group in ("fabric", "rig"):
        for key, value in content[group].items():
            settings += ["--set", f"{group}.{key}={json.dumps(value)}"]
    roles = [word for run in content["runs"] for word in ("--role", run["role"])]
    assert command("import", path, "--as", "picture_frame", "--out", out, *settings, *roles) == 0
    before, after = read_measurement(made), read_measurement(out)
    assert after.fabric == before.fabric and after.rig == before.rig
    for one, other in zip(before.runs, after.runs, strict=True):
        assert one.holdout == other.holdout
        for name, values in one.columns.items():
            np.testing.assert_allclose(other.columns[name], values, rtol=0, atol=5e-9)


def test_what_is_not_known_is_marked_and_named(tmp_path, capsys):
    text, _ = STYLES["testXpert"]
    out = imported(tmp_path, text, known=KNOWN[:4])
    written = (out / "measurement.yaml").read_text(encoding="utf-8")
    assert "fabric_length_mm: # FILL IN a number greater than 0" in written
    capsys.readouterr()
    assert command("diagnose", out) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "rig.fabric_length_mm: null, allowed is a number greater than 0" in line


def test_the_account_says_what_was_taken(tmp_path, capsys):
    path = tmp_path / "export.txt"
    path.write_text("t [min];Standardkraft [kN];Weg mm\n" + lines(";", TIME, FORCE, TRAVEL))
    out = tmp_path / "out"
    assert command("import", path, "--as", "picture_frame", "--out", out) == 0
    said = capsys.readouterr().out
    for words in (
        "Standardkraft",
        "kN",
        "1000",
        "60",
        "line 2 to 7",
        "semicolon",
        "to be filled in: fabric",
    ):
        assert words in said


HEAD = "t [s];F [N];s [mm]\n"
ROWS = lines(";", TIME, FORCE, TRAVEL)
BAD = {
    "two forces": (
        "t [s];Load [N];Force 2 [N];s [mm]\n" + lines(";", TIME, FORCE, 2 * FORCE, TRAVEL),
        [],
        ["line 1: 'Load [N]' or 'Force 2 [N]' may be force_N", '--column force_N="Load [N]"'],
    ),
    "unknown unit": (
        "t [s];Load [furlong];s [mm]\n" + ROWS,
        [],
        ["force_N: unit 'furlong' in 'Load [furlong]'", "lbf", "--unit force_N=UNIT"],
    ),
    "no unit": ("t [s];Load;s [mm]\n" + ROWS, [], ["force_N: no unit in 'Load'", "--unit"]),
    "no headings": (ROWS, [], ["time_s among no headings", "--column time_s=1, a number"]),
    "fabric": (HEAD + ROWS, ["--set", "fabric=3"], ["--set: fabric, allowed are its keys"]),
    "no run": (HEAD + ROWS, ["--set", "runs.3.role=fit"], ["--set: runs.3.role, allowed is"]),
    "no time": (
        "F [N];s [mm]\n" + lines(";", FORCE, TRAVEL),
        [],
        ["line 1: no column for time_s among 'F [N]' or 's [mm]'", "--rate"],
    ),
    "a rate and a time": (HEAD + ROWS, ["--rate", 20], ["line 1: --rate with a time, 't [s]'"]),
    "both ways": (
        HEAD + lines(";", TIME + 1, FORCE % 9 + 1, TRAVEL + 1, form="{:.3f}", decimal=","),
        [],
        ["line 2: '1,000' is 1.000 or 1000", "--decimal , or --decimal ."],
    ),
    "both marks": (HEAD + ROWS + "3,5;1.25;2.25\n", [], ["with a comma in '3,5'", "--decimal"]),
    "time goes back": (
        HEAD + ROWS + "0.9;1.0;1.0\n", [], ["line 8: time_s: 0.9 after 2.5", "increases"],
    ),
    "time stands": (
        HEAD + lines(";", TIME // 2, FORCE, TRAVEL),
        [],
        ["time_s stands still in", "more digits"],
    ),
    "commas in commas": (
        "Time s,Force N,Travel mm\n" + lines(",", TIME, FORCE, TRAVEL, decimal=","),
        [],
        ["line 2: 6 cells below 3 headings in line 1 (comma between them)"],
    ),
    "minutes or hours": (
        HEAD.replace(" [s]", "") + "".join(f"00:0{k};{k};{k}\n" for k in range(5)),
        [],
        ["time_s: '00:00' may be hours or minutes", "--unit time_s=mm:ss"],
    ),
    "a strain": (
        "t [s];F [N];Dehnung [%]\n" + ROWS, [], ["no column for displacement_mm", "--gauge MM"],
    ),
    "no numbers": ("a letter\nto a friend\n", [], ["no table with two columns of numbers"]),
    "too few": (HEAD + "0;0;0\n1;1;1\n", [], ["2 readings, allowed are 4 or more"]),
    "no such heading": (
        HEAD + ROWS, ["--column", "force_N=Krafft"], ["--column force_N=Krafft: no such column"],
    ),
    "no such column of ours": (
        HEAD + ROWS, ["--column", "force_kN=F [N]"], ["--column: force_kN, allowed is time_s"],
    ),
    "no such key": (
        HEAD + ROWS, ["--set", "rig.frame_lenght_mm=3"], ["did you mean frame_length_mm?"],
    ),
    "a closed frame": (
        HEAD + lines(";", TIME, FORCE, 200 * TRAVEL), [], ["export.txt: displacement_mm:"],
    ),
    "roles": (HEAD + ROWS, ["--role", "test"], ["runs.0.role: 'test', allowed is fit or holdout"]),
    "a workbook": (b"PK\x03\x04abc", [], ["is an Excel or OpenDocument workbook", "CSV"]),
    "a frame": (HEAD + ROWS, ["--frame", 3], ["--frame: not of picture_frame"]),
    "a zone": (HEAD + ROWS, ["--zone", "0,1,0,1"], ["--zone: not of picture_frame without --dic"]),
    "never reached": (HEAD + ROWS, ["--preload", 1e6], ["--preload 1e+06 N is never reached"]),
    "signs": (HEAD + ROWS, ["--separator", ";;"], ["--separator: ;;, allowed is a sign"]),
    "encoding": (HEAD + ROWS, ["--encoding", "morse"], ["--encoding: morse, allowed"]),
    "separator": (HEAD + ROWS, ["--separator", "tab"], ["no table with two columns of numbers"]),
    "decimal": (HEAD + ROWS, ["--decimal", ","], ["most rows are no numbers with ','"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_told_is_one_line(name, tmp_path, capsys):
    text, options, says = BAD[name]
    path, out = tmp_path / "export.txt", tmp_path / "out"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert command("import", path, "--as", "picture_frame", "--out", out, *KNOWN, *options) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert [words for words in says if words not in line] == [], line
    assert captured.out == "" and list(tmp_path.iterdir()) == [path]


def test_by_hand(tmp_path):
    """What cannot be told is told by hand."""
    text = "top line\n1,000;2,000;3,000\n1,500;2,125;3,500\n2,000;2,250;4,000\n2,500;2,375;5,000\n"
    options = ["--decimal", ",", "--separator", ";", "--skip", 1]
    for k, (name, unit) in enumerate(
        (("time_s", "min"), ("displacement_mm", "mm"), ("force_N", "N"))
    ):
        options += ["--column", f"{name}={k + 1}", "--unit", f"{name}={unit}"]
    (table,) = runs(imported(tmp_path, text, *options))
    is_the_record(table, [60, 90, 120, 150], [2, 2.125, 2.25, 2.375], [3, 3.5, 4, 5])


def test_equal_columns_are_one(tmp_path):
    text = "t [s];F [N];Extension [mm];Tensile extension [mm]\n"
    is_the_record(*runs(imported(tmp_path, text + lines(";", TIME, FORCE, TRAVEL, TRAVEL))))


def test_nothing_is_overwritten(tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine").write_text("mine")
    path = tmp_path / "export.txt"
    path.write_text(HEAD + ROWS)
    assert command("import", path, "--as", "picture_frame", "--out", out) == 2
    assert "exists, allowed is a new or an empty folder" in capsys.readouterr().err
    assert [p.name for p in out.iterdir()] == ["mine"]
