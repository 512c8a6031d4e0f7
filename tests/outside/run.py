"""Make sets, have them diagnosed, score the reports: ``python -m outside.run FAMILY SEED ...``."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .families import DISCOVERING, FAMILIES
from .jobs import Job
from .score import names_of, rivals_of, score, z_scores
from .score_terms import discovered, score_terms
from .sets import MeasurementSet, Term


def default_command() -> str:
    """The command beside the interpreter, or the one on the path."""
    beside = Path(sys.executable).with_name("fabric-fenicsx")
    return shlex.quote(str(beside)) if beside.exists() else "fabric-fenicsx"


@dataclass
class Outcome:
    """Exit code, seconds (of the clock, of the processor), report, last line of the errors."""

    code: int
    seconds: float
    cpu: float
    report: dict[str, Any]
    said: str


def diagnose(
    made: MeasurementSet, command: str, specimens: bool, limit: float, keep: Path | None
) -> Outcome:
    """One diagnosis of a set by the command."""
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        if keep is not None:
            root = keep / made.family / made.name.replace("/", "_").replace(" ", "_")
        folder = made.write(root / "set", specimens)
        call = [*shlex.split(command), "diagnose", str(folder), "--out", str(root / "out")]
        start = time.perf_counter()
        code, cpu, said = timed([*call, "--quiet"], limit, root / "stderr")
        spent = time.perf_counter() - start
        path = root / "out" / "report.json"
        report = json.loads(path.read_text()) if code == 0 and path.exists() else {}
        return Outcome(code, spent, cpu, report, said)


def timed(call: list[str], limit: float, errors: Path) -> tuple[int, float, str]:
    """Exit code, seconds of processor time and last line of the errors of a program.

    A program that is not done within ``limit`` seconds is ended, and its exit code is 124.
    """
    with errors.open("w") as stream:
        started = subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=stream)
        ends, late = time.monotonic() + limit, False
        while True:
            done, status, used = os.wait4(started.pid, os.WNOHANG)
            if done:
                break
            if not late and time.monotonic() > ends:
                late = True
                started.kill()
            time.sleep(0.05)
    started.returncode = code = os.waitstatus_to_exitcode(status)
    lines = errors.read_text(errors="replace").strip().splitlines()
    said = "out of time" if late else lines[-1] if lines else ""
    return 124 if late else code, used.ru_utime + used.ru_stime, said


def as_entry(term: Term) -> dict[str, Any]:
    """A term as the contract writes it."""
    return {"acts_on": term.acts_on, "depends_on": sorted(term.depends_on)}


def record(
    made: MeasurementSet,
    seed: int,
    outcome: Outcome,
    advised: bool = False,
) -> dict[str, Any]:
    """One line of the results."""
    report = outcome.report
    error = report.get("error") or {}
    line: dict[str, Any] = {
        "family": made.family + (" advised" if advised else ""),
        "set": made.name,
        "seed": seed,
        "test": made.test,
        "fault": made.fault,
        "truth": made.truth.effects,
        "forms": made.truth.forms,
        "accept": [sorted(names) for names in made.truth.accept],
        "fair": made.truth.fairness.get("fair", True),
        "fairness": made.truth.fairness,
        "keyed": any(run.specimen for run in made.runs),
        "stated": bool(made.noise),
        "code": outcome.code,
        "seconds": round(outcome.seconds, 1),
        "cpu_seconds": round(outcome.cpu, 1),
        "stderr": outcome.said,
        "noise_true": made.truth.noise_rms,
    }
    if made.family in DISCOVERING:
        line["asked"] = [[as_entry(term) for term in right] for right in made.truth.terms]
        line["terms"] = asdict(score_terms(made, report))
    if not report:
        return {**line, "right": False, "reason": f"exit {outcome.code}", "false_names": []}
    scored = score(made, report, advised)
    return {
        **line,
        "verdict": report.get("verdict"),
        "names": names_of(report),
        "rivals": rivals_of(report),
        "before": error.get("before"),
        "after": error.get("after"),
        "noise": error.get("noise"),
        "discovered": [
            {**as_entry(found), "rivals": [as_entry(rival) for rival in rivals]}
            for found, *rivals in discovered(report)
        ],
        "z": z_scores(made, report),
        "right": scored.right,
        "reason": scored.reason,
        "false_names": scored.false_names,
    }


def advice_of(report: Any, test: str) -> Any:
    """The first run that a report's ``next_tests`` describes in full, or nothing."""
    if isinstance(report, list):
        found = (advice_of(item, test) for item in report)
        return next((advice for advice in found if advice is not None), None)
    if not isinstance(report, dict):
        return None
    times, places = report.get("time_s"), report.get("displacement_mm")
    if not isinstance(times, list) or not isinstance(places, list):
        times, places = [], []
    if test == "picture_frame" and len(times) == len(places) > 1:
        return times, places
    for key in ("length_mm", "overhang_mm"):
        if test == "cantilever" and isinstance(report.get(key), int | float):
            return float(report[key])
    return advice_of(list(report.values()), test)


def work(job: Job, seed: int, args: argparse.Namespace) -> list[dict[str, Any]]:
    """Make, diagnose and score one set; and once more with the advised run where there is one."""
    name, build = job
    try:
        made = build()
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as problem:
        return [{"set": name, "seed": seed, "family": args.family, "skipped": str(problem)}]
    keep = Path(args.keep) / str(seed) if args.keep else None
    options = (args.command, not args.no_specimens, args.limit, keep)
    outcome = diagnose(made, *options)
    lines = [record(made, seed, outcome)]
    if made.advice is not None and made.further is not None and not args.no_advice:
        theirs = None if args.own_advice else advice_of(outcome.report.get("next_tests"), made.test)
        more = made.with_run(made.further(made.advice if theirs is None else theirs))
        more.name = made.name + ", advised"
        lines.append(record(more, seed, diagnose(more, *options), advised=True))
        lines[-1]["advice"] = "own" if theirs is None else "of the report"
    return lines


def plain(value: Any) -> Any:
    """A number of numpy as one of Python."""
    return value.item() if hasattr(value, "item") else str(value)


def arguments(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m outside.run", description=__doc__)
    parser.add_argument("family", choices=[*FAMILIES, "all"])
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--jobs", type=int, default=1, help="diagnoses at once")
    parser.add_argument("--out", default="results.jsonl", help="file that lines are added to")
    parser.add_argument("--only", default="", help="only sets whose name has this text")
    parser.add_argument("--command", default=default_command())
    parser.add_argument("--limit", type=float, default=900.0, help="seconds for one diagnosis")
    parser.add_argument("--keep", default="", help="keep the folders and reports here")
    parser.add_argument("--every", type=int, default=1, help="only every so many-th set")
    parser.add_argument("--first", type=int, default=0, help="only so many sets of a seed")
    parser.add_argument("--no-specimens", action="store_true", help="leave `specimen` keys out")
    parser.add_argument("--no-advice", action="store_true", help="no second, advised diagnosis")
    parser.add_argument("--own-advice", action="store_true", help="not that of the report")
    parser.add_argument("--resume", action="store_true", help="leave out what the file has")
    parser.add_argument("--dry", action="store_true", help="make and list the sets only")
    return parser.parse_args(argv)


def done_before(path: Path) -> set[tuple[str, str, int]]:
    """Family, name and seed of the sets that a file of results has."""
    lines = path.read_text().splitlines() if path.exists() else []
    return {(line["family"], line["set"], line["seed"]) for line in map(json.loads, lines)}


def main(argv: list[str] | None = None) -> int:
    """Run families over seeds; lines are written as they come."""
    args = arguments(argv)
    todo: list[tuple[Job, int]] = []
    known = done_before(Path(args.out)) if args.resume else set()
    for family in FAMILIES if args.family == "all" else [args.family]:
        for seed in args.seeds:
            jobs = [job for job in FAMILIES[family](seed) if args.only in job[0]][:: args.every]
            jobs = jobs[: args.first] if args.first else jobs
            todo += [(job, seed) for job in jobs if (family, job[0], seed) not in known]
    if args.dry:
        for (name, build), seed in todo:
            try:
                made = build()
            except (ArithmeticError, ValueError, np.linalg.LinAlgError) as problem:
                print(seed, name, problem, flush=True)
                continue
            fair = made.truth.fairness
            accept = [sorted(names) for names in made.truth.accept]
            asked = [" | ".join(map(str, right)) for right in made.truth.terms]
            print(seed, name, len(made.runs), accept, asked, fair, flush=True)
        return 0
    with ThreadPoolExecutor(args.jobs) as pool, Path(args.out).open("a") as stream:
        for lines in pool.map(lambda item: work(item[0], item[1], args), todo):
            for line in lines:
                stream.write(json.dumps(line, default=plain) + "\n")
                stream.flush()
                mark = "right" if line.get("right") else "WRONG"
                print(
                    mark,
                    line["seed"],
                    line["set"],
                    line.get("verdict"),
                    line.get("names"),
                    line.get("reason"),
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
