"""Decks of Abaqus and CalculiX: their nodes and shell elements read, all the rest kept as it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .shell_mesh import ShellMesh, padded
from .validation import read_text

__all__ = ["SHELLS", "Deck", "read_deck"]

SHELLS = {
    **dict.fromkeys(("S3", "S3R", "S3RS", "STRI3"), 3),
    **dict.fromkeys(("S4", "S4R", "S4RS", "S4RSW", "S4R5"), 4),
    **dict.fromkeys(("S6", "STRI65"), 6),
    **dict.fromkeys(("S8", "S8R", "S8R5"), 8),
}
"""Number of nodes of each type of shell element."""

LARGEST = 999_999_999
"""Number of a node or an element."""

DEEPEST = 20
"""Files that include one another; more are taken for a circle."""


@dataclass(frozen=True, slots=True)
class Section:
    """A shell section of a deck: its lines from `start` to before `stop`, and its elements."""

    start: int
    stop: int
    name: str
    elements: frozenset[int]


@dataclass(frozen=True, slots=True, eq=False)
class Deck:
    """The lines of a deck, included files in their places, and where its shell sections are.

    Attributes:
        lines: of the deck, without ends of lines.
        sections: shell sections of the part that has the shell elements.
        model: line before which definitions of the whole model may stand.
        end: line before which sections may stand, behind the elements.
    """

    lines: list[str]
    sections: list[Section]
    model: int
    end: int

    def with_sections(self, covered: frozenset[int], sections: list[str], model: list[str]) -> str:
        """The deck with other sections for some of its elements.

        A section that it has keeps the elements that are not covered; one without such elements
        goes. New sections stand before the first step or the part's end: CalculiX wants materials
        before them.

        Args:
            covered: numbers of the elements that the new sections are of.
            sections: lines of the new sections.
            model: lines that have to stand outside of any part.
        """
        touched = [section for section in self.sections if section.elements & covered]
        instead: dict[int, list[str]] = {self.end: [*sections]}
        gone: set[int] = set()
        for section in touched:
            gone |= set(range(section.start, section.stop))
            rest = sorted(section.elements - covered)
            if rest:
                name = f"{section.name}_UNCOVERED"
                kept = self.lines[section.start : section.stop]
                keyword = [
                    f"ELSET={name}" if word.strip().upper().startswith("ELSET") else word.strip()
                    for word in kept[0].split(",")
                ]
                instead.setdefault(section.start, []).extend(
                    [f"*ELSET, ELSET={name}", *rows(rest), ", ".join(keyword), *kept[1:]]
                )
        out: list[str] = []
        for number, line in enumerate([*self.lines, ""]):
            if number == self.model:
                out += model
            out += instead.get(number, [])
            if number not in gone and number < len(self.lines):
                out.append(line)
        return "\n".join(out) + "\n"


def rows(numbers: list[int]) -> list[str]:
    """Lines with up to 16 numbers, the most that a set may have in one line."""
    return [", ".join(map(str, numbers[i : i + 16])) for i in range(0, len(numbers), 16)]


@dataclass(slots=True)
class _Block:
    """A keyword with its lines of data."""

    keyword: str
    options: dict[str, str]
    start: int
    data: list[tuple[str, str]]
    stop: int


def read_deck(path: Path | str) -> ShellMesh:
    """Nodes and shell elements of a deck, flat or with one part that has shells.

    Included files (`*INCLUDE`, and `INPUT=` of any keyword) are looked for beside the deck and
    taken into it.

    Raises:
        InputError: it cannot be read, or its nodes, elements or sets contradict one another.
    """
    path = Path(path)
    places = [*_lines(path, path.parent, 0)]
    blocks = _blocks(places)
    part, owner = "", {}
    for number, block in enumerate(blocks):
        part = block.options.get("NAME", "") if block.keyword == "PART" else part
        part = "" if block.keyword in ("END PART", "ASSEMBLY") else part
        owner[number] = part
    shells = [
        number
        for number, block in enumerate(blocks)
        if block.keyword == "ELEMENT" and block.options.get("TYPE", "") in SHELLS
    ]
    parts = sorted({owner[number] for number in shells})
    if len(parts) > 1:
        raise InputError(
            f"{path}: shell elements in {' and '.join(name or 'no part' for name in parts)},"
            " allowed are those of one part"
        )
    part = parts[0] if parts else ""
    mine = [block for number, block in enumerate(blocks) if owner[number] == part]
    point_of, points = _nodes(mine)
    numbers: list[int] = []
    types: list[str] = []
    connected = []
    for block in (blocks[number] for number in shells):
        size = SHELLS[block.options["TYPE"]]
        found, ids = _elements(block, size)
        for place, row in zip(found, ids, strict=True):
            lost = [node for node in row[1:] if node not in point_of]
            if lost:
                raise InputError(f"{place}: element {row[0]}: there is no node {lost[0]}")
        connected.append(np.array([[point_of[node] for node in row[1:]] for row in ids], np.int64))
        numbers += [row[0] for row in ids]
        types += [block.options["TYPE"]] * len(ids)
    if not numbers:
        raise InputError(f"{path}: no shell elements, allowed are {', '.join(SHELLS)}")
    known, uses = np.unique(numbers, return_counts=True)
    if uses.max() > 1:
        raise InputError(f"{path}: two shell elements have the number {known[uses > 1][0]}")
    ours = frozenset(numbers)
    sets = _sets(mine, ours)
    sections = [
        Section(
            block.start,
            block.stop,
            block.options.get("ELSET", ""),
            sets.get(block.options.get("ELSET", ""), frozenset()),
        )
        for block in mine
        if block.keyword in ("SHELL SECTION", "SHELL GENERAL SECTION")
    ]
    deck = Deck([line for line, _ in places], sections, *_openings(blocks, part, len(places)))
    try:
        return ShellMesh(
            np.array(points, dtype=np.float64).reshape(-1, 3),
            np.array(list(point_of), dtype=np.int64),
            padded([block for block in connected if block.size]),
            np.array(numbers, dtype=np.int64),
            types,
            deck,
        )
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _openings(blocks: list[_Block], part: str, count: int) -> tuple[int, int]:
    """Lines before which definitions of the model, and sections of the part, may stand."""
    steps = [block.start for block in blocks if block.keyword == "STEP"]
    end = steps[0] if steps else count
    if not part:
        return end, end
    first = next(block.start for block in blocks if block.keyword == "PART")
    begun = next(b for b in blocks if b.keyword == "PART" and b.options.get("NAME") == part)
    ends = (b.start for b in blocks if b.keyword == "END PART" and b.start > begun.start)
    return first, next(ends, end)


def _lines(path: Path, folder: Path, depth: int) -> Iterator[tuple[str, str]]:
    """Each line with its place, for messages; included files in the place of their keyword."""
    if depth > DEEPEST:
        raise InputError(f"{path}: more than {DEEPEST} files that include one another")
    text = read_text(path, "a deck of Abaqus or CalculiX")
    for number, line in enumerate(text.splitlines(), start=1):
        keyword, options = _keyword(line)
        if "INPUT" in options and keyword in ("INCLUDE", *WITH_INPUT):
            other = folder / _given(line, "INPUT")
            if keyword != "INCLUDE":
                kept = [w for w in line.split(",") if not w.strip().upper().startswith("INPUT")]
                yield ",".join(kept), f"{path}: line {number}"
            yield from _lines(other, folder, depth + 1)
        else:
            yield line, f"{path}: line {number}"


WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET", "DISTRIBUTION", "AMPLITUDE", "NODAL THICKNESS")
"""Keywords whose data may be in a file of their own, which is taken into the deck."""


def _keyword(line: str) -> tuple[str, dict[str, str]]:
    """Keyword and options of a line, both in capitals; an empty keyword for any other line."""
    if not line.startswith("*") or line.startswith("**"):
        return "", {}
    first, *words = line[1:].split(",")
    pairs = (word.partition("=") for word in words)
    options = {name.strip().upper(): value.strip().strip("\"'").upper() for name, _, value in pairs}
    return " ".join(first.upper().split()), options


def _given(line: str, name: str) -> str:
    """An option as it is written: names of files have small letters too."""
    for word in line.split(","):
        key, _, value = word.partition("=")
        if key.strip().upper() == name:
            return value.strip().strip("\"'")
    return ""


def _blocks(places: list[tuple[str, str]]) -> list[_Block]:
    blocks: list[_Block] = []
    going_on = False
    for number, (line, place) in enumerate(places):
        keyword, options = _keyword(line)
        if keyword:
            blocks.append(_Block(keyword, options, number, [], number + 1))
        elif blocks and going_on:
            blocks[-1].options |= _keyword("*," + line)[1]
            blocks[-1].stop = number + 1
        elif blocks and not line.startswith("**") and line.strip():
            blocks[-1].data.append((line, place))
            blocks[-1].stop = number + 1
        # The keyword's own line goes on in the next one where it ends with a comma.
        going_on = (bool(keyword) or going_on) and line.rstrip().endswith(",")
    return blocks


def _nodes(blocks: list[_Block]) -> tuple[dict[int, int], list[list[float]]]:
    """Row of each node by its number, and the places."""
    row_of: dict[int, int] = {}
    points: list[list[float]] = []
    for block in blocks:
        for line, place in block.data if block.keyword == "NODE" else []:
            words = line.split(",")
            try:
                number = int(words[0])
                point = [float(word) if word.strip() else 0.0 for word in words[1:4]]
                if not 0 < number <= LARGEST:
                    raise ValueError
            except ValueError:
                raise InputError(f"{place}: {line.strip()!r} is not a node") from None
            # A node given twice is where it was given last.
            row_of.setdefault(number, len(points))
            points[row_of[number] : row_of[number] + 1] = [[*point, 0.0, 0.0][:3]]
    return row_of, points


def _elements(block: _Block, size: int) -> tuple[list[str], list[list[int]]]:
    """Places and numbers of each element with its nodes, which may go on in the next line."""
    words = [(w, place) for line, place in block.data for w in line.split(",") if w.strip()]
    numbers = []
    for word, place in words:
        if not word.strip().isdecimal() or int(word) > LARGEST:
            raise InputError(f"{place}: {word.strip()!r}, allowed is a number up to {LARGEST}")
        numbers.append(int(word))
    if len(numbers) % (size + 1):
        raise InputError(
            f"{words[-1][1]}: elements {block.options['TYPE']} have a number and {size} nodes"
        )
    starts = range(0, len(numbers), size + 1)
    return [words[i][1] for i in starts], [numbers[i : i + size + 1] for i in starts]


def _sets(blocks: list[_Block], shells: frozenset[int]) -> dict[str, frozenset[int]]:
    """Numbers of the shell elements of each set."""
    sets: dict[str, frozenset[int]] = {}
    for block in blocks:
        name = block.options.get("ELSET")
        if name is None or block.keyword not in ("ELEMENT", "ELSET"):
            continue
        found: set[int] = set()
        if block.keyword == "ELEMENT":
            size = SHELLS.get(block.options.get("TYPE", ""))
            found = {row[0] for row in _elements(block, size)[1]} if size else set()
        for line, place in block.data if block.keyword == "ELSET" else []:
            words = [word.strip().upper() for word in line.split(",") if word.strip()]
            if "GENERATE" in block.options:
                try:
                    first, last, step = map(int, [*words, "1"][:3])
                    # Not the numbers themselves: there may be any number of them.
                    found |= {n for n in shells if n in range(first, last + 1, step)}
                except ValueError:
                    raise InputError(f"{place}: allowed is first, last and step") from None
                continue
            for word in words:
                found |= {int(word)} if word.isdecimal() else sets.get(word, frozenset())
        sets[name] = sets.get(name, frozenset()) | (found & shells)
    return sets
