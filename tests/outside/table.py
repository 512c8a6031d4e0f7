"""Tables of results: ``python -m outside.table results.jsonl``."""

from __future__ import annotations

import json
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

Line = dict[str, Any]


def held_out(line: Line) -> float | None:
    """The held-out error over the true noise, where something was found or nothing was there."""
    after = (line.get("after") or {}).get("holdout")
    if after is None or line.get("verdict") not in ("no_effect", "effect_found"):
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
    seconds = [line["seconds"] for line in lines]
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
    return "\n".join(out)


def main(argv: list[str] | None = None) -> int:
    """Print the tables of one or more files of results."""
    files = argv if argv is not None else sys.argv[1:]
    lines = [
        json.loads(text)
        for name in files
        for text in Path(name).read_text().splitlines()
        if text.strip()
    ]
    print(table(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
