"""The table of the families that ask for terms on no list; printed by ``outside.table``."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np

Line = dict[str, Any]


def _share(lines: list[Line], key: str) -> str:
    return f"{np.mean([bool(line['terms'][key]) for line in lines]):.0%}"


def row(title: str, test: str, lines: list[Line]) -> str:
    """One line of the table."""
    asked = [line for line in lines if line["asked"]]
    both = [line["terms"]["variables"] and line["terms"]["error_right"] for line in asked]
    variables = _share(asked, "variables") if asked else "-"
    names = Counter(name for line in lines for name in line["terms"]["wrong_names"])
    wrong = sum(bool(line["terms"]["wrong_names"]) for line in lines)
    listed = ", ".join(f"{name} {count}" for name, count in names.most_common())
    needless = sum(line["terms"]["needless"] > 0 for line in lines)
    cpu = [line["cpu_seconds"] for line in lines]
    return (
        f"| {title} | {test} | {len(lines)} | {sum(not line['fair'] for line in lines)} |"
        f" {sum(bool(line['right']) for line in lines)} | {variables} |"
        f" {_share(lines, 'error_right')} | {f'{np.mean(both):.0%}' if asked else '-'} |"
        f" {wrong}{f' ({listed})' if listed else ''} | {needless} |"
        f" {np.median(cpu):.0f}, {max(cpu):.0f} |"
    )


def words(terms: list[Line]) -> str:
    """Terms in words."""
    return " or ".join(f"{one['acts_on']}({', '.join(one['depends_on'])})" for one in terms)


def answer(line: Line) -> str:
    """What a report answers, in words."""
    found = [words([one, *one.get("rivals", [])]) for one in line.get("discovered") or []]
    return " + ".join([str(line.get("verdict")), *(line.get("names") or []), *found])


def table_terms(lines: list[Line]) -> str:
    """Markdown tables by family, and of the wrong answers; empty if no family asks for terms."""
    scored = [line for line in lines if "terms" in line]
    if not scored:
        return ""
    groups: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in scored:
        for key in (line["test"], "all", f"all: {line['fault']}"):
            groups[line["family"], key].append(line)
    out = [
        "| family | sets of | sets | doubtful | right | right variable | held out <= 1.5 noise |"
        " both | sets with a listed name wrongly given | with a false discovery |"
        " CPU seconds: median, largest |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    out += [row(family, test, members) for (family, test), members in sorted(groups.items())]
    out += [
        "",
        "| wrong | seed | truth | answer | held out / noise | reason |",
        "|---|---|---|---|---|---|",
    ]
    out += [
        f"| {line['family']}: {line['set']} | {line['seed']} |"
        f" {' + '.join(words(one) for one in line['asked']) or ', '.join(line['truth']) or '-'} |"
        f" {answer(line)} | {line['terms']['error']} | {line['reason']} |"
        for line in scored
        if not line["right"]
    ]
    return "\n".join(out)
