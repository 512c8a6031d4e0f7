"""The command diagnose: from folders of measured data to a report."""

import base64
import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from measurements.bad import CASES, EXECUTED
from measurements.sets import sixty
from test_cli import MPI, contents
from test_drape_loop import angle, made_up, marks, written

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.fabric import NEAREST
from fabric_fenicsx.loop.inference.one_search import Search
from fabric_fenicsx.loop.inference.ranking import nothing_left
from fabric_fenicsx.loop.kinds.drape import model as drape
from fabric_fenicsx.loop.kinds.drape.model import Drape
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.report.content import SCHEMA
from fabric_fenicsx.loop.report.words import parameter_unit

RECIPES = {recipe.name: recipe for recipe in sixty(1)}
#: Of all effects.
FEW = ["crossover_friction", "load_drift"]
#: One set of each verdict, with the effects in it.
SETS = {
    "crossover_friction-dahl": ("effect_found", ["crossover_friction"]),
    "none-shear-declared": ("no_effect", []),
    "unlisted-vibration": ("unexplained", []),
}


def command(*arguments):
    """Exit code of the command line."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


def report_of(folder):
    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    return json.loads((folder / "report.json").read_text(), parse_constant=refuse)


#: All effects with a name.
NAMED = {"crossover_friction", "crossover_relaxation", "rate_hardening", "shear_locking"}
NAMED |= {"tension_coupling", "crosshead_backlash", "load_drift"}


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """Folders of measurement and of report by name of a set."""
    made = {}
    for name, (verdict, _) in SETS.items():
        folder = tmp_path_factory.mktemp("sets") / name
        RECIPES[name](folder)
        out = folder.parent / "report"
        only = ("--effects", ",".join(FEW)) if verdict == "unexplained" else ()
        assert command("diagnose", folder, *only, "--out", out, "--quiet") == 0
        made[name] = folder, out
    return made


@pytest.mark.parametrize("name", SETS)
def test_the_report_keeps_the_contract(diagnosed, name):
    _, out = diagnosed[name]
    report = report_of(out)
    verdict, effects = SETS[name]
    assert report["schema"] == SCHEMA == "fabric-report/1"
    assert report["test"] == "picture_frame"
    assert report["verdict"] == verdict
    assert [effect["name"] for effect in report["effects"]] == effects
    for effect in report["effects"]:
        assert effect["parameters"] and set(effect["std"]) == set(effect["parameters"])
        assert isinstance(effect["rivals"], list)
    tried = set(FEW) if verdict == "unexplained" else NAMED
    if effects == ["crossover_friction"]:
        # What a large shear leaves for good is tried in its place.
        tried = tried | {"rest_moment_of_largest_angle"}
    assert {c["name"] for c in report["candidates"]} == tried
    for candidate in report["candidates"]:
        assert {"score", "p_value", "error_fit", "error_holdout"} < set(candidate)
        assert 0.0 <= candidate["p_value"] <= 1.0
    names = {"k1_N", "k3_N", "c1_N_s"}
    for key in ("baseline", "baseline_alone"):
        assert set(report[key]) == {"parameters", "std"}
        assert set(report[key]["parameters"]) == set(report[key]["std"]) == names
    # With what was found beside them, and without.
    for kind in ("parameters", "std"):
        refitted = {name: report["model"][kind][name] for name in names}
        assert report["baseline"][kind] == refitted
    assert (report["baseline"] == report["baseline_alone"]) == (verdict != "effect_found")
    error = report["error"]
    assert error["quantity"] == "force_N"
    for number in (*error["before"].values(), *error["after"].values(), error["noise"]):
        assert math.isfinite(number) and number > 0.0
    assert set(error["before"]) == set(error["after"]) == {"fit", "holdout"}
    if verdict == "effect_found":
        assert error["after"]["holdout"] < 0.5 * error["before"]["holdout"]
    else:
        assert error["after"] == error["before"]
    assert not (out / "report.json.partial").exists()


@pytest.mark.parametrize("name", SETS)
def test_runs_make_up_the_whole(diagnosed, name):
    """Squares of the runs' errors add up to the fitted ones'; the page has a row for each run."""
    _, out = diagnosed[name]
    report = report_of(out)
    left_out = report["left_out"]
    total = {"before": 0.0, "after": 0.0}
    count = 0
    (measurement,) = report["measurements"]
    for run in (run for run in measurement["runs"] if run["role"] == "fit"):
        own = run["readings"] - sum(o["file"] == run["file"] for o in left_out["outliers"])
        own -= sum(o["readings"] for o in left_out["not_comparable"] if o["file"] == run["file"])
        count += own
        for when in total:
            total[when] += own * run["error"][when] ** 2
        low, high = run["expected_error"]
        assert 0.0 < low < high and 0.0 <= run["more_extreme"] <= 1.0
        assert set(run["parameters"]) >= set(report["baseline"]["parameters"])
    for when, square in total.items():
        assert math.sqrt(square / count) == pytest.approx(report["error"][when]["fit"], rel=1e-9)
    checks = report["predictive_check"]
    assert checks[0]["statistic"] == "root mean square"
    nearest = report["best"] or report["model"]
    assert checks[0]["observed"] == pytest.approx(nearest["error_fit"], rel=1e-9)


def test_the_criterion_is_that_of_the_chosen(diagnosed):
    """A found effect gains what decides; no other effect by itself has a better criterion."""
    report = report_of(diagnosed["crossover_friction-dahl"][1])
    own, before = report["criterion"]["after"], report["criterion"]["before"]
    assert before - own > 10.0
    best = min(report["candidates"], key=lambda c: c["criterion"])
    assert best["name"] == "crossover_friction"
    assert best["criterion"] == pytest.approx(own, abs=0.5)


@pytest.mark.slow
def test_terms_are_tried_where_no_name_will_do(tmp_path):
    """To a vibration of less than two readings a cycle none is near."""
    RECIPES["unlisted-vibration"](tmp_path / "set")
    assert command("diagnose", tmp_path / "set", "--out", tmp_path / "out", "--quiet") == 0
    report = report_of(tmp_path / "out")
    assert report["verdict"] == "unexplained" and report["discovered"] == []
    assert {c["name"] for c in report["candidates"]} > NAMED


def test_the_unexplained_says_what_came_nearest(diagnosed, tmp_path):
    """To wrinkles an even force.

    What comes and goes within a few readings is noise beside the model, but not white.
    """
    report = report_of(diagnosed["unlisted-vibration"][1])
    assert report["whiteness"]["after"]["period"] < 1e-10
    RECIPES["unlisted-wrinkles"](tmp_path / "set")
    only = ["--effects", "tension_coupling,load_drift", "--quiet"]
    assert command("diagnose", tmp_path / "set", "--out", tmp_path / "out", *only) == 0
    report = report_of(tmp_path / "out")
    assert report["verdict"] == "unexplained"
    assert report["best"]["effects"] and report["best"]["effects"][0]["name"] in report["headline"]
    assert report["best"]["error_fit"] > 1.5 * report["error"]["noise"]
    assert (tmp_path / "out" / NEAREST).exists()


def emptied(model):
    """A model whose last effect has its amplitudes on a bound at nothing."""
    names = [p.name for p in model.fit.variants[-1].amplitudes]
    values = model.fit.values | dict.fromkeys(names, 0.0)
    empty = replace(model, fit=replace(model.fit, values=values, at_bound=tuple(names)))
    assert nothing_left(empty.fit)
    return empty


def test_what_is_left_of_nothing_is_in_no_model_of_several(tmp_path, monkeypatch):
    """An effect whose amplitude ends at nothing beside others: the model is that of the others."""
    RECIPES["pair-crossover_friction-shear_locking"](tmp_path / "set")
    test = PictureFrame([read_measurement(tmp_path / "set")])
    names = ("crossover_friction", "shear_locking")
    search = Search(test, [e for e in test.effects if e.name in names], lambda done, what: None)
    fitted = search.several._together

    def with_others(*of):
        """Its models, and after them each with nothing left of its last effect."""
        models = fitted(*of)
        return [*models, *map(emptied, models)]

    monkeypatch.setattr(search.several, "_together", with_others)
    _, levels = search._looked_through()
    pairs = levels[2]
    assert pairs and not any(nothing_left(model.fit) for model in pairs)


@pytest.mark.slow
def test_terms_are_looked_through_once_for_several_effects_with_names(tmp_path, monkeypatch):
    """What spares their fits is also what may be imitated by them."""
    RECIPES["pair-crossover_friction-shear_locking"](tmp_path / "set")
    looked_through, own = [], Search._alone
    monkeypatch.setattr(Search, "_alone", lambda self: looked_through.append(self) or own(self))
    report = diagnose([read_measurement(tmp_path / "set")]).report
    names = {effect["name"] for effect in report["effects"]}
    assert names == {"crossover_friction", "shear_locking"}
    assert sum(any(not e.listed for e in search.effects) for search in looked_through) == 1


class Images(HTMLParser):
    """What a page loads, and the images in it."""

    def __init__(self):
        super().__init__()
        self.loaded, self.images = [], []

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        assert tag not in ("script", "link", "iframe")
        self.loaded += [attributes[key] for key in ("src", "href", "data") if key in attributes]
        if tag == "img":
            self.images.append(attributes["src"])


@pytest.mark.parametrize("name", SETS)
def test_the_page_stands_by_itself(diagnosed, name):
    _, out = diagnosed[name]
    text = (out / "report.html").read_text()
    page = Images()
    page.feed(text)
    kinds = ("data", "residuals", "dependence", "noise", "candidates")
    assert len(page.images) == len(page.loaded) == len(kinds)
    assert "url(" not in text and "@import" not in text
    for source in page.images:
        start, _, code = source.partition(",")
        assert start == "data:image/svg+xml;base64"
        assert ET.fromstring(base64.b64decode(code)).tag.endswith("svg")
    for kind in kinds:
        header = (out / f"picture_frame_{kind}.png").read_bytes()[:24]
        assert header[:8] == b"\x89PNG\r\n\x1a\n" and int.from_bytes(header[16:20]) > 1000
    report = report_of(out)
    assert report["headline"] in unescape(text)
    for candidate in report["candidates"]:
        assert candidate["name"] in text


def test_a_title_is_text_and_no_markup(tmp_path):
    folder = tmp_path / "measured"
    RECIPES["none-shear-declared"](folder)
    path = folder / "measurement.yaml"
    content = yaml.safe_load(path.read_text()) | {"title": "a < b <script>x</script>"}
    path.write_text(yaml.safe_dump(content))
    few = ("--effects", "load_drift", "--quiet")
    assert command("diagnose", folder, *few, "--out", tmp_path / "out") == 0
    assert "<script>" not in (tmp_path / "out" / "report.html").read_text()


@pytest.fixture(scope="module")
def narrowed(diagnosed, tmp_path_factory):
    """Folders of measurement and of a report among few effects."""
    folder, out = diagnosed["crossover_friction-dahl"][0], tmp_path_factory.mktemp("narrowed")
    assert command("diagnose", folder, "--out", out, "--effects", ",".join(FEW), "--quiet") == 0
    return folder, out


def test_the_same_data_give_the_same_report_and_the_search_is_narrow(narrowed, tmp_path, capsys):
    folder, out = narrowed
    names = FEW
    # As an earlier diagnosis into the same folder leaves it, which explained nothing.
    (tmp_path / NEAREST).write_text("# of other measurements")
    assert command("diagnose", folder, "--out", tmp_path, "--effects", ", ".join(names)) == 0
    assert not (tmp_path / NEAREST).exists()
    for name in ("report.json", "report.html"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes()
    report = report_of(tmp_path)
    assert [candidate["name"] for candidate in report["candidates"]] == names
    printed = capsys.readouterr().out
    assert "effect_found" in printed and "m_c_N" in printed
    kept = contents(tmp_path)
    assert command("diagnose", folder, "--out", tmp_path, "--effects", "crossover_fricton") == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "'crossover_fricton'" in line and all(name in line for name in names)
    assert contents(tmp_path) == kept


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_bad_folder_is_one_line_and_writes_nothing(case, tmp_path, capfd):
    folder, out = tmp_path / "measured", tmp_path / "report"
    case.write(folder)
    assert command("diagnose", folder, "--out", out) == 2
    printed = capfd.readouterr()
    assert printed.err.count("\n") == 1 and printed.out == ""
    for text in case.says:
        assert text in printed.err
    assert not out.exists() and not (folder / EXECUTED).exists()


def test_the_same_folder_twice_is_a_mistake(diagnosed, tmp_path, capsys):
    folder, _ = diagnosed["none-shear-declared"]
    twice = ["diagnose", folder, folder.parent / "report" / ".." / folder.name]
    assert command(*twice, "--out", tmp_path / "new") == 2
    assert "stands twice" in capsys.readouterr().err


def test_a_baseline_without_enough_readings_is_exit_code_3(diagnosed, tmp_path, capsys):
    """Four readings, two of which lie beside corners of unknown sharpness, leave no fit."""
    folder = tmp_path / "short"
    RECIPES["none-shear-declared"](folder)
    rows = ["time_s,displacement_mm,force_N", "0,0,0", "1,9,0.3", "2,5,0.1", "3,14,0.5"]
    for path in folder.glob("*.csv"):
        path.write_text("\n".join(rows) + "\n")
    assert command("diagnose", folder, "--out", tmp_path / "new") == 3
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "baseline" in line
    assert not list((tmp_path / "new").iterdir())


def test_units_are_those_of_the_names():
    units = {"k1_N": "N", "c1_N_s": "N s", "drift_N_s": "N/s", "rounding_rad_s": "rad/s", "n": ""}
    units |= {"b_N_mm3": "N mm³", "kappa0_1_mm": "1/mm", "compliance_rad_per_N": "rad/N"}
    units |= {"slip_angle_rad": "rad", "free_travel_mm": "mm", "force_N": "N", "angle_deg": "°"}
    assert {name: parameter_unit(name) for name in units} == units


@pytest.mark.slow
def test_a_drape_takes_the_shear_law_of_the_frames(diagnosed, tmp_path, monkeypatch):
    """The law that the frames gave is in the drape's case; the drape's fields come last."""
    cases = []

    class Quick(Drape):
        def __init__(self, measurements, own=()):
            super().__init__(measurements, own, solve=self.solve, net=None)

        @staticmethod
        def solve(case):
            cases.append(case)
            return made_up(case)

    monkeypatch.setattr(drape, "Drape", Quick)
    frames, _ = diagnosed["crossover_friction-dahl"]
    sheet = tmp_path / "sheet"
    sheet.mkdir()
    x, y = marks()
    noise = np.random.default_rng(0).normal(0.0, 1.0, x.shape)
    written(sheet, x, y, angle(x, y) + noise, held=20)
    assert command("diagnose", sheet, frames, "--out", tmp_path / "out") == 0
    report = report_of(tmp_path / "out")
    assert report["test"] == "drape" and list(report["tests"]) == ["picture_frame", "drape"]
    assert report["verdict"] == "no_effect" and report["baseline"]["parameters"] == {}
    assert report["error"]["quantity"] == "angle_deg"
    # Friction is the fabric's: it is in the drape, and the springs beside it.
    law = report["tests"]["picture_frame"]["model"]["parameters"]
    crossover = cases[0].crossover
    assert [one.law for one in crossover.laws] == ["dahl_friction"]
    assert crossover.laws[0].limit_N_mm == pytest.approx(law["m_c_N"])
    taken = (crossover.k1_N_mm, crossover.k3_N_mm, crossover.dashpot_N_s_mm)
    assert taken == pytest.approx([law[name] for name in ("k1_N", "k3_N", "c1_N_s")])
    assert sum("fitted to the other tests" in note for note in report["notes"]) == 1
    text = (tmp_path / "out/report.html").read_text()
    assert text.count("<section>") == 2 and (tmp_path / "out/drape_data.png").exists()


def on_two_ranks(*arguments):
    """The command diagnose under mpirun, ended."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    program = ["/usr/bin/mpirun", "-n", "2", sys.executable, "-m", "fabric_fenicsx", "diagnose"]
    return subprocess.run(
        [*program, *map(str, arguments)],
        env=env | MPI,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=120,
    )


def test_two_ranks_report_the_same(narrowed, tmp_path):
    folder, out = narrowed
    process = on_two_ranks(folder, "--effects", ",".join(FEW), "--out", tmp_path / "two")
    assert process.returncode == 0, process.stderr
    assert (tmp_path / "two/report.json").read_bytes() == (out / "report.json").read_bytes()
    assert process.stdout.count(b"effect_found") == 1
    process = on_two_ranks(tmp_path, "--out", tmp_path / "bad")
    assert process.returncode == 2
    assert process.stderr.count(b"measurement.yaml") == 1


@pytest.mark.slow
def test_two_ranks_report_the_same_of_a_cantilever(tmp_path):
    RECIPES["clamp_tilt-down"](tmp_path / "set")
    assert command("diagnose", tmp_path / "set", "--out", tmp_path / "one", "--quiet") == 0
    process = on_two_ranks(tmp_path / "set", "--out", tmp_path / "two")
    assert process.returncode == 0, process.stderr
    one, two = (json.loads((tmp_path / k / "report.json").read_text()) for k in ("one", "two"))
    assert [effect["name"] for effect in one["effects"]] == ["clamp_tilt"]
    # Fits that are only ranked begin where the last one of the process came to rest.
    for a, b in zip(one["effects"], two["effects"], strict=True):
        assert (a["name"], a["variant"], a["rivals"]) == (b["name"], b["variant"], b["rivals"])
        assert a["parameters"] == pytest.approx(b["parameters"], rel=1e-6)
    for when in ("before", "after"):
        assert one["error"][when] == pytest.approx(two["error"][when], rel=1e-6)
    assert [c["name"] for c in one["candidates"]] == [c["name"] for c in two["candidates"]]
