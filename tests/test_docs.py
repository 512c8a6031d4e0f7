"""Every command of the pages runs, in the order of its page; links and pictures are there.

A page is prose. Its ```console blocks are commands, those after `<!-- slow -->` for the slow tests;
one after `<!-- file: NAME -->` is a file that they use.
"""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

import pandas as pd
import pytest
import yaml

from fabric_fenicsx import rigs
from fabric_fenicsx.__main__ import main
from fabric_fenicsx.loop.inference.criteria import CRITERIA
from fabric_fenicsx.loop.kinds.bias_extension.effects import BIAS_EXTENSION_EFFECTS
from fabric_fenicsx.loop.kinds.cantilever.effects import CANTILEVER_EFFECTS
from fabric_fenicsx.loop.kinds.drape.effects import DRAPE_EFFECTS
from fabric_fenicsx.loop.kinds.picture_frame.effects import PICTURE_FRAME_EFFECTS
from fabric_fenicsx.rigs import load, registry

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BUILT = {"gallery", "keys.md"}
"""What `make docs` writes."""

BLOCK = re.compile(r"(<!-- slow -->\n)?(?:<!-- file: (\S+) -->\n)?```(\w+)\n(.*?)```", re.S)

COMMAND = re.compile(r"^\$ (.*)$", re.M)


def blocks(page):
    """(slow, kind, file, text) of each block of a page."""
    for slow, file, kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        yield bool(slow), kind, file, text


def test_every_form_of_every_effect_is_in_the_tutorial():
    text = (DOCS / "tutorial_measurements.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| (\w+) \| (.*) \|$", text.split("## What is tried")[1], re.M))
    effects = (
        *PICTURE_FRAME_EFFECTS,
        *BIAS_EXTENSION_EFFECTS,
        *CANTILEVER_EFFECTS,
        *DRAPE_EFFECTS,
    )
    for effect in effects:
        assert [v.label for v in effect.variants if v.label not in rows[effect.name]] == []


def test_the_thresholds_of_a_diagnosis_are_those_of_the_code():
    text = (DOCS / "diagnosis.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]+) \|", text, re.M)
    said = {
        name.strip("`"): float(value)
        for names, values in rows
        for name, value in zip(names.split(", "), values.split(", "), strict=True)
    }
    assert len(said) > 10
    assert said == {name: float(getattr(CRITERIA, name)) for name in said}


def with_commands(slow):
    pages = [*sorted(DOCS.glob("*.md")), ROOT / "README.md"]
    chosen = [p for p in pages if any(s == slow and k == "console" for s, k, _, _ in blocks(p))]
    return [pytest.param(page, id=page.stem) for page in chosen]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder like the repository's, with the first steps of a drape in results/drape."""
    folder = tmp_path_factory.mktemp("docs")
    for name in ("demos", "meshes"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "bin").mkdir()
    for name, command in (
        ("fabric-fenicsx", f"{sys.executable} -m fabric_fenicsx"),
        ("python", sys.executable),
    ):
        script = folder / "bin" / name
        script.write_text(f'#!/bin/sh\nexec {command} "$@"\n')
        script.chmod(0o755)
    short = ["--set", "punch_travel_mm=3", "--set", "duration_s=3", "--no-pictures"]
    # Whoever runs a case has its folder for itself as long as the process lives.
    line = " ".join(["fabric-fenicsx run demos/drape.yaml --out results/drape", *short])
    shell(folder, line, inside=False)
    return folder


def shell(folder, line, *, inside):
    """One line of a page; inside, a command of the package alone is called: to start takes long."""
    words = shlex.split(line)
    if inside and words[0] == "fabric-fenicsx" and not set("|<>;&$`*") & set(line):
        said = io.StringIO()
        with chdir(folder), redirect_stdout(said), redirect_stderr(said):
            with pytest.raises(SystemExit) as ended:
                main(words[1:])
        assert not ended.value.code, f"{line}\n{said.getvalue()[-4000:]}"
        return
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    env["PATH"] = f"{folder / 'bin'}:{env['PATH']}"
    env["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), env.get("PYTHONPATH")]))
    done = subprocess.run(
        line, shell=True, cwd=folder, env=env, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, f"{line}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"


def run_page(folder, page, slow):
    count = 0
    for is_slow, kind, file, text in blocks(page):
        if file:
            (folder / file).write_text(text, encoding="utf-8")
        # Slow ones go on from what the others of their page have left.
        if kind == "console" and (slow or not is_slow):
            for line in COMMAND.findall(text):
                shell(folder, line, inside=not slow)
                count += 1
    assert count > 0


@pytest.mark.parametrize("page", with_commands(slow=False))
def test_commands_of_a_page(place, page):
    run_page(place, page, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", with_commands(slow=True))
def test_all_commands_of_a_page(place, page):
    # The quick ones have run there, if they were asked for.
    (place / "mine.yaml").unlink(missing_ok=True)
    shutil.rmtree(place / "results" / "imported", ignore_errors=True)
    run_page(place, page, slow=True)


def test_the_rig_of_the_contributors_page(tmp_path, monkeypatch, capsys):
    """The page's file and its line, and every command knows it; n E A Δ/L with E = 6 C1."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## A new rig")[1]
    (tmp_path / "tensile_strip.py").write_text(re.search(r"```python\n(.*?)```", text, re.S)[1])
    monkeypatch.setattr(rigs, "__path__", [*rigs.__path__, str(tmp_path)])
    for module in (registry, load):
        monkeypatch.setattr(module, "RIGS", (*registry.RIGS, "tensile_strip"))
    case, out = tmp_path / "case.yaml", tmp_path / "out"
    case.write_text("test: tensile_strip\nwarp_spacing_mm: 8\n")
    for command in (
        ["keys", "tensile_strip"],
        ["check", case],
        ["run", case, "--out", out],
        ["fibres", out],
    ):
        with pytest.raises(SystemExit) as ended:
            main([*map(str, command)])
        assert ended.value.code in (None, 0), capsys.readouterr().err
    assert "travel_mm" in capsys.readouterr().out
    force = json.loads((out / "result.json").read_text())["quantities"]["force_N"]
    curve = pd.read_csv(out / "curve.csv")
    exact = 6 * 6.0 * 60000.0 * 4.57 * 0.04 * curve["displacement_mm"] / 96.0
    assert curve["displacement_mm"].iloc[-1] == pytest.approx(1.0)
    assert curve["force_N"].to_numpy() == pytest.approx(exact.to_numpy(), rel=1e-3)
    assert force == pytest.approx(curve["force_N"].max())
    monkeypatch.delitem(sys.modules, "fabric_fenicsx.rigs.tensile_strip")


def test_blocks_are_marked_as_what_they_are():
    """No command hides in a block of another kind, and each console block has one."""
    for page in DOCS.glob("*.md"):
        for _, kind, _, text in blocks(page):
            assert bool(COMMAND.search(text)) == (kind == "console"), (page, text)


def test_links_lead_somewhere():
    for page in DOCS.glob("*.md"):
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
            if not target.startswith("http") and target.split("/")[0] not in BUILT:
                assert (DOCS / target).exists(), (page.name, target)


def test_every_page_is_in_the_menu():
    menu = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]

    def files(entries):
        for entry in entries:
            for value in entry.values():
                yield from files(value) if isinstance(value, list) else [value]

    listed = set(files(menu))
    assert {page.name for page in DOCS.glob("*.md")} <= listed | BUILT
    assert listed <= {page.name for page in DOCS.glob("*.md")} | BUILT
