"""Runs the benchmark problems by this solver and by others in turn, and writes their ratios.

    python tests/benchmarks/side_by_side.py PEERS.yaml [--out docs/side_by_side.md] [--repeats 3]

PEERS.yaml maps the name of each other solver to its commands; a command prints a line of JSON with
the keys that network.py prints, `solve_seconds` and `converged` at least:

    Exudyn:
      frame: /opt/peers/bin/python exudyn_net.py frame {n}
      sheet: /opt/peers/bin/python exudyn_net.py sheet {n}

The solvers take turns, so that a machine whose speed drifts treats them alike; of the repeats the
shortest counts, as whatever else runs can only lengthen one. `seconds` is the loading loop on the
clock; the processor's time for the whole run, start and mesh included, does not suffer from what
else runs. A run is stopped after ``--limit`` seconds. Of the times only the ratios mean something
on another machine.
"""

from __future__ import annotations

import argparse
import json
import resource
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

OURS = "fabric_fenicsx"
NETWORK = Path(__file__).with_name("network.py")
CASES = ("frame:9", "frame:17", "frame:33", "sheet:9", "sheet:17", "sheet:33")


def run(command: str, limit: float) -> dict[str, Any]:
    """The last line of JSON that a command prints; its failure in words under "failed"."""
    words = shlex.split(command)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return {"failed": f"not done in {limit:.0f} s"}
    except OSError as error:
        return {"failed": str(error)}
    for line in reversed(done.stdout.splitlines()):
        start = line.find("{")
        if start >= 0:
            found: dict[str, Any] = json.loads(line[start:])
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            found["cpu_seconds"] = after.ru_utime - before.ru_utime
            return found if found.get("converged") else found | {"failed": "does not converge"}
    return {"failed": f"no result, exit code {done.returncode}"}


def best(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The shortest run that converged, else the first."""
    good = [one for one in runs if "failed" not in one]
    return min(good, key=lambda one: one["solve_seconds"]) if good else runs[0]


def measure(
    problem: str, n: int, commands: dict[str, str], repeats: int, limit: float
) -> dict[str, dict[str, Any]]:
    """The best run of every solver, the solvers taking turns."""
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in commands}
    for _ in range(repeats):
        for name, command in commands.items():
            past = runs[name]
            if past and "failed" in past[-1]:
                continue
            past.append(run(command.format(problem=problem, n=n), limit))
            print(json.dumps({"solver": name, "problem": problem, "n": n} | past[-1]), flush=True)
    return {name: best(past) for name, past in runs.items()}


def row(problem: str, n: int, name: str, result: dict[str, Any], ours: dict[str, Any]) -> str:
    """A line of the table."""
    if "failed" in result:
        return f"| {problem} | {n} | {name} | | | {result['failed']} | | | | |"

    def over(key: str) -> str:
        return "" if "failed" in ours else f"{result[key] / ours[key]:.2f}"

    answer = result.get("force", result.get("z_corner"))
    cells = (
        problem,
        n,
        name,
        result.get("steps", ""),
        result.get("newton_iterations", ""),
        f"{result['solve_seconds']:.2f}",
        over("solve_seconds"),
        f"{result['cpu_seconds']:.1f}",
        over("cpu_seconds"),
        "" if answer is None else f"{answer:.3f}",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    """Run all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("peers", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, help="also write the table here")
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--limit", type=float, default=300.0, help="of one run [s]")
    parser.add_argument("--cases", nargs="+", default=CASES, help="problem:n")
    wanted = parser.parse_args()
    peers: dict[str, dict[str, str]] = {}
    if wanted.peers is not None:
        peers = yaml.safe_load(wanted.peers.read_text())
    lines = [
        "| problem | n | solver | steps | iterations | seconds | over ours | CPU s, whole run "
        "| over ours | force or z |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for case in wanted.cases:
        problem, n = case.split(":")[0], int(case.split(":")[1])
        mine = f"{shlex.quote(sys.executable)} {shlex.quote(str(NETWORK))} {problem} --n {n}"
        commands = {OURS: mine}
        commands |= {name: by[problem] for name, by in peers.items() if problem in by}
        results = measure(problem, n, commands, wanted.repeats, wanted.limit)
        lines += [row(problem, n, name, one, results[OURS]) for name, one in results.items()]
    table = "\n".join(lines) + "\n"
    print(table)
    if wanted.out is not None:
        wanted.out.write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
