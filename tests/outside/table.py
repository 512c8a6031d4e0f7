"""Tables of results: ``python -m outside.table results.jsonl``."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from .table_terms import table_terms

Line = dict[str, Any]


def held_out(line: Line) -> float | None:
    """The held-out error over the true noise, where something was found or nothing was there."""
    after = (line.get("after") or {}).get("holdout")
    if after is None or line.get("verdict") not in (
        "no_effect",
        "effect_found",
        "effect_discovered",
    ):
        return None
    return float(after) / float(line["noise_true"])


def textbook(line: Line) -> str:
    """What the textbook's form of a single true effect leaves, in units of the noise."""
    singles = line["fairness"].get("singles") or {}
    left = singles.get(line["truth"][0]) if len(line["truth"]) == 1 else None
    return "-" if left is None else f"{left:.2f}"


def row(title: str, fault: str, lines: list[Line]) -> str:
    """One line of the table."""
    right = sum(bool(line["right"]) for line in lines)
    unfair = sum(not line.get("fair", True) for line in lines)
    false = Counter(name for line in lines for name in line.get("false_names", []))
    z = [v for line in lines for v in (line.get("z") or {}).values() if v is not None]
    share = f"{np.mean(np.abs(z) < 2):.0%} of {len(z)}" if z else "-"
    errors = [error for error in map(held_out, lines) if error is not None]
    error_text = f"{np.median(errors):.2f}, {max(errors):.2f}" if errors else "-"
    seconds = [float(line.get("cpu_seconds") or line["seconds"]) for line in lines]
    names = ", ".join(f"{name} {count}" for name, count in false.most_common()) or "-"
    return (
        f"| {title} | {fault} | {right}/{len(lines)} | {unfair} | {names} | {share} | {error_text}"
        f" | {np.median(seconds):.0f}, {max(seconds):.0f} |"
    )


def table(lines: list[Line]) -> str:
    """Markdown tables: by family and fault, and of the wrong answers."""
    scored = [line for line in lines if "skipped" not in line]
    groups: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in scored:
        groups[line["family"], line["test"] + ": " + line["fault"]].append(line)
        groups[line["family"], "all"].append(line)
    out = [
        "| family | fault | right | doubtful | false names | abs(z) < 2 | held out / noise: "
        + "median, largest | seconds: median, largest |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (family, fault), members in sorted(groups.items()):
        out.append(row(family, fault, members))
    if scored:
        out.append(row("all", "all", scored))
    out += [
        "",
        "| wrong | seed | truth (form) | textbook form leaves | answer | reason |",
        "|---|---|---|---|---|---|",
    ]
    for line in scored:
        if not line["right"]:
            truth = ", ".join(
                f"{n} ({f})" for n, f in zip(line["truth"], line["forms"], strict=True)
            )
            answer = f"{line.get('verdict')} {' + '.join(line.get('names') or [])}"
            out.append(
                f"| {line['family']}: {line['set']} | {line['seed']} | {truth or 'nothing'} |"
                f" {textbook(line)} | {answer} | {line['reason']} |"
            )
    terms = table_terms(scored)
    return "\n".join([*out, "", terms] if terms else out)


OPENING = """# The loop on an outsider's sets

Folders of measurements made by somebody who had read the contract for data and the paper, but
neither the program nor its tests (`tests/outside`, whose README says what is made and how fair
it is), each diagnosed once. Right is the name that was put in, nothing where nothing was, no
listed name where the effect is on no list. `abs(z) < 2` counts parameters of the baseline
within two standard errors of the truth; the held-out error is over the noise that was put in,
and is larger than one by right where the held-out run is of another specimen. Seconds are of
processor time. Written by

    python -m outside.run FAMILY SEED ... --out results.jsonl
    python -m outside.table results.jsonl --page FILE

"""


def main(argv: list[str] | None = None) -> int:
    """Print the tables of one or more files of results, or write a page of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--page", type=Path)
    given = parser.parse_args(argv)
    texts = (text for file in given.files for text in file.read_text().splitlines())
    lines = [json.loads(text) for text in texts if text.strip()]
    seeds = ", ".join(str(seed) for seed in sorted({line["seed"] for line in lines}))
    if given.page is None:
        print(table(lines))
    else:
        given.page.write_text(f"{OPENING}Seeds: {seeds}.\n\n{table(lines)}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
