"""The keys of a case file, as a table."""

from __future__ import annotations

from typing import Annotated

import typer

from .results import listed

__all__ = ["keys"]


def keys(
    rig: Annotated[
        str | None, typer.Argument(metavar="[RIG]", help="One rig; default: every rig.")
    ] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="As tables in Markdown.")] = False,
) -> None:
    """Print the keys of a case file with unit, default and what is allowed."""
    from ..inputs.keys import documented
    from ..rigs import registry

    if rig is not None:
        listed("keys", rig, registry.RIGS)
    headings = ("key", "unit", "default", "allowed", "meaning")
    for name in [rig] if rig else registry.RIGS:
        case = registry.rig(name).case
        rows: list[tuple[str, ...]] = [
            (key.name, key.unit, key.default, key.allowed, key.description)
            for key in documented(case)
        ]
        text = " ".join((case.__doc__ or "").split())
        if markdown:
            _print_markdown(name, text, headings, rows)
        else:
            _print_table(name, text, headings, rows)


def _print_markdown(
    name: str, text: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]
) -> None:
    def line(cells: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    print(f"## {name}\n\n{text}\n\n{line(headings)}\n{line(('---',) * len(headings))}")
    for key, *rest in rows:
        print(line((f"`{key}`", *rest)))
    print()


def _print_table(
    name: str, text: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]
) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    # Piped, there is no width to keep to; on a narrow terminal long keys are folded.
    width = console.width if console.is_terminal else 180
    table = Table(title=f"{name}: {text}", title_justify="left")
    for heading in headings:
        wide = heading in ("allowed", "meaning")
        whole = heading == "key" and width >= 140
        table.add_column(heading, no_wrap=whole, overflow="fold", ratio=1 if wide else 0)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    Console(width=width).print(table)
