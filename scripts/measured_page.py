"""Diagnose folders of published measurements and write what came out as docs/measured.md.

    python scripts/measured_page.py FOLDER [FOLDER ...]

The readings themselves stay where they are. What a comment at the top of a measurement.yaml says
of its source is quoted.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "docs" / "measured.md"
OPENING = """# Published measurements, diagnosed

Readings of published figures and photographs, each diagnosed by

    fabric-fenicsx diagnose FOLDER

and written here by `python scripts/measured_page.py FOLDER ...`. Errors are root mean squares of
what was not fitted, before any effect is added and after. None of the readings is kept in this
repository; the sources are named.

"""


def diagnosed(folder: Path, out: Path) -> dict[str, Any]:
    """The report of a folder."""
    command = ["fabric-fenicsx", "diagnose", str(folder), "--out", str(out), "--quiet"]
    subprocess.run([str(Path(sys.executable).parent / command[0]), *command[1:]], check=True)
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    return report


def number(value: float | None) -> str:
    """Three digits."""
    return "" if value is None else f"{value:.3g}"


def section(folder: Path, report: dict[str, Any]) -> str:
    """What came out for one folder."""
    text = (folder / "measurement.yaml").read_text()
    source = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
    title = report["measurements"][0]["title"] or folder.name
    lines = [f"## {title}", "", f"Source: {source}.", "", f"**{report['headline']}**", ""]
    error, unit = report["error"], report["error"]["quantity"]
    lines += [f"| error, {unit} | before | after |", "|---|---|---|"]
    for kind, words in (("fit", "fitted"), ("holdout", f"held out: {report['holdout_source']}")):
        lines.append(
            f"| {words} | {number(error['before'][kind])} | {number(error['after'][kind])} |"
        )
    lines += ["", f"Noise {number(error['noise'])}: {report['noise_source']}.", ""]
    model = report["model"] if report["effects"] else report["best"] or report["model"]
    lines += ["| parameter | value | ± |", "|---|---|---|"]
    for name, value in model["parameters"].items():
        lines.append(f"| `{name}` | {number(value)} | {number(model['std'][name])} |")
    lines += ["", "| effect tried | score | fitted error | held-out error |", "|---|---|---|---|"]
    rivals = {name for effect in report["effects"] for name in effect["rivals"]}
    for candidate in report["candidates"]:
        mark = " (rival)" if candidate["name"] in rivals else ""
        cells = [number(candidate[key]) for key in ("score", "error_fit", "error_holdout")]
        lines.append(f"| {candidate['name']}{mark} | {' | '.join(cells)} |")
    for advice in report["further_tests"]:
        lines += ["", f"- {' and '.join(advice['effects'])}: {advice['do']}"]
    return "\n".join([*lines, "", ""])


def main() -> None:
    """Write the page."""
    text = OPENING
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as out:
            text += section(Path(name), diagnosed(Path(name), Path(out)))
    PAGE.write_text(text.rstrip() + "\n")


if __name__ == "__main__":
    main()
