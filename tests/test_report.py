"""The page on a drape: comparisons of known outcome, and the page itself."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_draped import NET, laid, pure_shear
from test_output import square
from test_views import command, write_step

import fabric_fenicsx as ff
from fabric_fenicsx.fabric.axes import axes_shear, tow_axes
from fabric_fenicsx.output.comparison import (
    compared_angles,
    differing_keys,
    line_distance,
    repeat_scatter,
)
from fabric_fenicsx.output.draped import draped_sheet
from fabric_fenicsx.output.draw_in import draw_in
from fabric_fenicsx.output.pattern import (
    circle,
    to_line,
)
from fabric_fenicsx.output.report.analysis import Drape, Settings, analysed
from fabric_fenicsx.output.report.content import content
from fabric_fenicsx.output.results import write_setup
from fabric_fenicsx.output.surfaces import RevolvedSurface
from fabric_fenicsx.output.thickness import flat_fabric
from fabric_fenicsx.solving.snapshot import at_rest

ROOT = Path(__file__).parents[1]


# Thickness.


def test_flat_fabric_from_what_is_known():
    """200 g/m² of fibres of 2 g/cm³ are 0.1 mm thick: V = 0.5 at 0.2 mm."""
    assert flat_fabric(
        thickness=0.2, areal_weight=200.0, fibre_density=2.0
    ).fibre_fraction == pytest.approx(0.5)
    assert flat_fabric(
        fibre_fraction=0.5, areal_weight=200.0, fibre_density=2.0
    ).thickness == pytest.approx(0.2)
    assert flat_fabric(areal_weight=200.0).thickness is None


def test_density_of_a_sheet_in_pure_shear():
    gamma = np.radians(40.0)
    drape = Drape(Path(), "", laid(NET, pure_shear(gamma)), [], 1.0, pd.DataFrame())
    found = analysed(drape, Settings(locking=35.0, thickness=0.2))
    assert found.density == pytest.approx(1.0 / np.cos(gamma))
    numbers = content(found)
    assert numbers["shear"]["smallest_margin_deg"] == pytest.approx(-5.0)
    assert numbers["shear"]["beyond_locking_percent"] == 100.0
    assert numbers["thickness"]["thickness_mm"] == pytest.approx([0.2 / np.cos(gamma)] * 3)


# Comparisons.


def test_measured_map_of_known_shares():
    """Off by 1, 3 and 7 degrees on a half, a quarter and a quarter of the places."""
    gamma = np.radians(25.0)
    sheet = laid(NET, pure_shear(gamma))
    x, y = (v.ravel() for v in np.meshgrid([-30.0, -11.0, 11.0, 30.0], [-20.0, 20.0]))
    off = np.array([1.0, -1.0, 1.0, -1.0, 3.0, -3.0, 7.0, -7.0])
    table = {"x_mm": x, "y_mm": y, "angle_deg": 65.0 - off}
    numbers = compared_angles(sheet, table).numbers()
    assert numbers["within_2_deg_percent"] == 50.0
    assert numbers["within_6_deg_percent"] == 75.0
    assert numbers["rms_deg"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert numbers["mean_deg"] == pytest.approx(0.0, abs=1e-9)
    # Two repeats that are the same in the mean.
    twice = {k: np.tile(v, 2) for k, v in table.items()}
    twice["angle_deg"] += np.repeat([0.5, -0.5], len(x))
    assert compared_angles(sheet, twice).numbers() == pytest.approx(numbers, abs=1e-9)
    # The same places of the draped sheet, and one beyond it.
    place = pure_shear(gamma)(x, y)
    draped = {"x_mm": place[:, 0], "y_mm": place[:, 1], "z_mm": place[:, 2]}
    draped = {k: np.append(v, 500.0) for k, v in draped.items()}
    again = compared_angles(sheet, {**draped, "angle_deg": np.append(65.0 - off, 60.0)}).numbers()
    assert again.pop("places_beyond_the_sheet") == 1
    numbers.pop("places_beyond_the_sheet")
    assert again == pytest.approx(numbers, abs=1e-9)


def test_scatter_of_repeats():
    """Two places, three and two repeats: 2 + 0.5 over 3 degrees of freedom."""
    table = {
        "x_mm": np.array([0.0, 0.0, 0.0, 5.0, 5.0]),
        "y_mm": np.zeros(5),
        "angle_deg": np.array([50.0, 51.0, 52.0, 60.0, 61.0]),
        "repeat": np.array([1.0, 2.0, 3.0, 1.0, 2.0]),
    }
    assert repeat_scatter(table) == pytest.approx(np.sqrt(2.5 / 3.0))
    assert repeat_scatter({"std_deg": np.array([1.0, np.nan, 7.0])}) == pytest.approx(5.0)
    assert repeat_scatter({}) is None


def test_outlines_apart_and_keys_that_differ():
    assert line_distance(circle(40.0), circle(37.0))["largest_mm"] == pytest.approx(3.0, abs=0.02)
    mine = {"title": "a", "contact": {"friction": 0.1, "layer_mm": 0.5}, "points": []}
    other = {"title": "b", "contact": {"friction": 0.3, "layer_mm": 0.5}, "mesh": "x.msh"}
    assert differing_keys(mine, other) == [
        {"key": "contact.friction", "this": 0.1, "other": 0.3},
        {"key": "points", "this": [], "other": None},
        {"key": "mesh", "this": None, "other": "x.msh"},
    ]


# The page.

QUARTER = square(0.0, 144.0, 12.0)
BALL = RevolvedSurface(
    "punch",
    60.0
    * np.column_stack(
        [np.sin(np.linspace(0.0, np.pi / 2, 46)), -np.cos(np.linspace(0.0, np.pi / 2, 46))]
    ),
    np.zeros(3),
)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A quarter pushed into a smooth hill, as `run` leaves it, with a case and half a table."""
    folder = tmp_path_factory.mktemp("rün") / "drape"
    folder.mkdir()
    write_setup(folder, QUARTER, [BALL])
    x, y = QUARTER.points[:, 0], QUARTER.points[:, 1]
    rest = at_rest(QUARTER, 30.0)
    rest.displacement[:, 2] = -30.0 * np.exp(-(x**2 + y**2) / 60.0**2)
    axes = tow_axes(QUARTER, rest.displacement, symmetry=(0, 1))
    state = replace(rest, axes=axes, shear_angle=axes_shear(axes))
    write_step(folder, 1, state, {"punch": np.array([0.0, 0.0, 30.2])})
    (folder / "case.yaml").write_text("test: drape\ntitle: hill <b> & more\n", encoding="utf-8")
    rows = {"time_s": [15.0, 30.0], "punch_force_z_N": [-1.0, -2.0]}
    for name in ("external_work", "stored", "kinetic", "lost", "remainder"):
        rows[f"{name}_N_mm"] = [1.0, 2.0]
    pd.DataFrame(rows).to_csv(folder / "steps.csv", index=False)
    (folder / "result.json").write_text(
        json.dumps({"completed": False, "stopped_because": "Newton <failed> at 31 s"})
    )
    return folder


class Page(HTMLParser):
    """Tags that are left open, and all references."""

    EMPTY = frozenset({"meta", "img", "br", "link"})

    def __init__(self):
        super().__init__()
        self.open, self.references, self.wrong = [], [], []

    def handle_starttag(self, tag, attributes):
        self.references += [v for k, v in attributes if k in ("src", "href")]
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


def test_the_page_is_one_valid_file(run_folder, tmp_path):
    """Against itself: no difference. Stopped early: it says so, and why. All inside one file."""
    measured = tmp_path / "angles.csv"
    measured.write_text("x_mm,y_mm,angle_deg,std_deg\n60,60,88,1\n-60,30,89,1\n30,-20,90,\n")
    outline = tmp_path / "outline.csv"
    outline.write_text("x_mm,y_mm\n-145,-145\n145,-145\n145,145\n-145,145\n")
    out = tmp_path / "page"
    options = ["--measured", measured, "--measured-outline", outline, "--against", run_folder]
    options += ["--locking-deg", "50", "--thickness-mm", "0.2", "--fibre-density-g-cm3", "1.8"]
    assert command("report", run_folder, "--out", out, "--trim", "70", *options) == 0
    text = (out / "report.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    assert text.lstrip().startswith("<!DOCTYPE html>")
    assert page.open == [] and page.wrong == []
    assert len(page.references) == 9 and all(r.startswith("data:image/") for r in page.references)
    assert "hill &lt;b&gt; &amp; more" in text
    assert "stopped early: Newton &lt;failed&gt; at 31 s" in text
    assert "Health: not assessed" in text
    assert "http" not in re.sub(r'src="[^"]*"', "", text)

    numbers = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert numbers["schema"] == "fabric-drape-report/1"
    against = numbers["against"]
    assert against["shear"]["largest_deg"] == pytest.approx(0.0, abs=1e-9)
    assert against["outline"]["largest_mm"] == pytest.approx(0.0, abs=1e-9)
    assert against["keys"] == [] and against["crossings_compared"] == 25 * 25
    assert numbers["measured"]["angles"]["places"] == 3
    assert numbers["measured"]["outline"]["largest_mm"] == pytest.approx(1.0)
    assert numbers["pattern"]["closed"] and numbers["pattern"]["mapped_again_off_by_mm"] < 1e-6
    assert numbers["shear"]["smallest_margin_deg"] == pytest.approx(
        50.0 - numbers["shear"]["largest_deg"]
    )
    t = numbers["thickness"]
    # Of the case: 7e-6 kg/mm³ · 4.57 · 0.04 mm² each 12 mm, twice.
    weight = 7e-6 * 4.57 * 0.04 / 12.0 * 2.0 * 1e9
    assert t["areal_weight_g_m2"] == pytest.approx(weight)
    assert t["flat_fibre_volume_fraction"] == pytest.approx(weight / (1000.0 * 1.8 * 0.2))
    for name in ("pattern.svg", "pattern.dxf", "pattern.csv", "shear.png", "wrinkles.png"):
        assert (out / name).stat().st_size > 0


def test_health_and_what_is_missing_are_said(run_folder, tmp_path):
    result = run_folder / "result.json"
    before = result.read_text()
    try:
        health = {"tilt_rms_deg": 12.5, "warnings": ["a tow stands on edge"]}
        result.write_text(json.dumps({"completed": True, "health": health}))
        assert command("report", run_folder, "--out", tmp_path / "a") == 0
        text = (tmp_path / "a" / "report.html").read_text(encoding="utf-8")
        assert "a tow stands on edge" in text and ">12.5<" in text and "The run completed" in text
        assert "no locking angle is known" in text
        result.unlink()
        assert command("report", run_folder, "--out", tmp_path / "b") == 0
        assert "left no result" in (tmp_path / "b" / "report.html").read_text(encoding="utf-8")
    finally:
        result.write_text(before)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--trim", "-3"], "trim: -3, allowed is a radius in mm or a CSV file"),
        (["--trim", "none.csv"], "none.csv: no such file"),
        (["--locking-deg", "95"], "locking_deg: 95, allowed is a number above 0 and below 90"),
        (["--measured", "case.yaml"], "unknown column"),
        (["--against", "nowhere"], "allowed is the folder of a run"),
    ],
)
def test_bad_input_is_one_line(run_folder, tmp_path, capsys, options, said):
    options = [run_folder / o if o == "case.yaml" else o for o in options]
    assert command("report", run_folder, "--out", tmp_path / "page", *options) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert not (tmp_path / "page").exists()


def test_only_drapes(run_folder, tmp_path, capsys):
    folder = tmp_path / "frame"
    folder.mkdir()
    write_setup(folder, QUARTER)
    write_step(folder, 1, at_rest(QUARTER), {})
    (folder / "case.yaml").write_text("test: picture_frame\n")
    assert command("report", folder) == 2
    assert "a run of picture_frame, allowed is one of a drape" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sheet_cut_to_the_pattern_drapes_to_the_trim_line(tmp_path):
    """The demo, its pattern for a circle of 100 mm, and that sheet draped: every end within 1 mm.

    What remains is mechanics, not the map: less fabric is held, and it draws in a little more.
    """
    radius = 100.0
    case = ff.load_case(ROOT / "demos" / "drape.yaml")
    ff.run(case, tmp_path / "whole", pictures=False)
    numbers = ff.report(tmp_path / "whole", trim=radius)
    assert numbers["pattern"]["mapped_again_off_by_mm"] < 1e-3
    line = pd.read_csv(tmp_path / "whole" / "report" / "pattern.csv")[["x_mm", "y_mm"]]
    outline = [tuple(place) for place in line.to_numpy().tolist()]
    keys = case.model_dump(exclude={"test", "weave", "assumptions"}, exclude_unset=True)
    cut = ff.make_case("drape", **keys, weave={"outline": outline})
    ff.run(cut, tmp_path / "cut", pictures=False)
    results = ff.read_results(tmp_path / "cut")
    net, snapshot, _ = results.at(results.nearest(None), mirror=True)
    ends = draw_in(draped_sheet(net, snapshot)).place[:, :2]
    assert len(ends) > 150
    off = to_line(ends, circle(radius))
    print(f"off the trim line by {np.sqrt(np.mean(off**2)):.2f} mm rms, {off.max():.2f} mm at most")
    assert off.max() < 1.0


def test_a_run_without_a_case_or_tools(tmp_path):
    """As a script leaves it: what is not known is said to be so."""
    folder = tmp_path / "bare"
    folder.mkdir()
    write_setup(folder, QUARTER)
    write_step(folder, 1, at_rest(QUARTER), {})
    numbers = ff.report(folder, mirror=True)
    assert numbers["bridging"] is None and numbers["forces"] is None and numbers["pattern"] is None
    assert numbers["wrinkles"]["out_of_plane"] is None
    assert numbers["wrinkles"]["compression"] is None
    assert numbers["thickness"]["factor_least_median_most"] == pytest.approx([1.0, 1.0, 1.0])
    text = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert "neither forces nor energies are known" in text
