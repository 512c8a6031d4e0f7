"""Case files broken at random: valid YAML with other values and keys, and text that is not YAML."""

from __future__ import annotations

import copy
import random
from pathlib import Path
from typing import Any

import yaml

from fabric_fenicsx.rigs.registry import RIGS
from fabric_fenicsx.rigs.write_case import template

DEMOS = Path(__file__).parents[1] / "demos"

VALUES: list[Any] = [
    *(0, 1, -1, 2, 3.5, -0.0, 1e-300, 1e300, -1e300, 1e-9, 1e9, 10**400, float("nan")),
    *(float("inf"), float("-inf"), True, False, None, "", "x", "drape", "../x.msh", "/dev/null"),
    *("1e5", "nan", "0x10", "ünïcode ✂", "a" * 5000, "\x00\x07", "2024-01-01", "${HOME}", "~"),
    *([], {}, [[]], [{}], [1, 2, 3], [None], {"a": 1}, {1: 2}, {None: None}, [[0, 1], [1, 0]]),
    *([[[1]]], "plain", "twill_2_2", [1e9], [0.1] * 200, {"law": "maxwell"}, [{"law": "x"}]),
    *("meshes", "herringbone.txt", b"\xff\xfe", [{"x_mm": "y"}], -(10**30), 1.5e6, "12 mm", "12,5"),
]

TEXTS = ("{", "]", ":", "- ", "\t", "&a ", "*a", "!!python/name:os.system", "%YAML 9\n", "---\n")


def originals() -> list[str]:
    """Texts of valid cases: demos that name no other file, and a template of each rig."""
    demos = [path.read_text(encoding="utf-8") for path in sorted(DEMOS.glob("*.yaml"))]
    return [text for text in demos if "../" not in text] + [template(rig) for rig in RIGS]


def mutant(seed: int) -> bytes:
    """A case file, broken or only changed, by the number of a seed."""
    draw = random.Random(seed)
    text = draw.choice(originals())
    if draw.random() < 0.25:
        return scrambled(text.encode(), draw)
    data = yaml.safe_load(text)
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        change(data, draw)
    return yaml.dump(data, allow_unicode=True).encode("utf-8", "surrogatepass")


def change(data: Any, draw: random.Random) -> None:
    """Change one place of nested mappings and lists, which must not be empty."""
    places = list(_places(data))
    holder, key = draw.choice(places)
    value = holder[key]
    kind = draw.randrange(6)
    if kind == 0 and isinstance(holder, dict):
        del holder[key]
    elif kind == 1 and isinstance(holder, dict):
        name = str(key)
        at = draw.randrange(len(name) + 1)
        holder[name[:at] + draw.choice("xs_0 ü") + name[at:]] = holder.pop(key)
    elif kind == 2 and isinstance(value, (int, float)) and not isinstance(value, bool):
        holder[key] = value * draw.choice((-1, 0, 0.5, 2, 10, 100, 1e4, 1e-4))
    elif kind == 3:
        other_holder, other = draw.choice(places)
        holder[key] = copy.deepcopy(other_holder[other])
    else:
        holder[key] = copy.deepcopy(draw.choice(VALUES))


def _places(data: Any) -> Any:
    """Every mapping or list with each of its keys."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in list(pairs):
        yield data, key
        if isinstance(value, (dict, list)):
            yield from _places(value)


def scrambled(text: bytes, draw: random.Random) -> bytes:
    """Text with bytes changed, cut off or put in."""
    for _ in range(draw.choice((1, 2, 8))):
        at = draw.randrange(len(text) + 1)
        match draw.randrange(4):
            case 0:
                text = text[:at]
            case 1:
                text = text[:at] + bytes([draw.randrange(256)]) + text[at + 1 :]
            case 2:
                text = text[:at] + draw.choice(TEXTS).encode() + text[at:]
            case 3:
                other = draw.randrange(len(text) + 1)
                text = text[:at] + text[min(at, other) : max(at, other)] + text[at:]
        if not text:
            break
    return text
