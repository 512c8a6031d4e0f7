"""Whatever stands in an input file, the command line says one line or does as asked."""

import resource
import shutil
import signal
from collections import Counter
from contextlib import contextmanager

import pytest
from fuzz import mutant
from fuzz_measurements import broken

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.loop.diagnose import read_measurement

MEMORY = 6 << 30
"""Bytes of address space that a broken number must not reach."""

PATIENCE = 300
"""Seconds after which a case counts as one that hangs."""

ODD = {
    "a list in itself": "test: drape\npoints: &a [*a]\n",
    "a mapping in itself": "test: drape\nsheet: &a {width_mm: *a}\n",
    "a billion laughs": "a: &a [x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a]\n"
    "c: &c [*b,*b,*b,*b,*b,*b,*b,*b]\nd: &d [*c,*c,*c,*c,*c,*c,*c,*c]\n"
    "e: &e [*d,*d,*d,*d,*d,*d,*d,*d]\ntest: drape\ntitle: [*e,*e,*e,*e,*e,*e,*e,*e]\n",
    "a sheet of a thousand kilometres": "test: drape\nsheet: {width_mm: 1.0e+9}\n",
    "tows that run on for ever": "test: picture_frame\nframe_length_mm: 1.0e+9\n",
    "a code": "test: !!python/object/apply:os.system ['true']\n",
    "deep": "[" * 3000,
    "nothing": "",
    "no mapping": "- drape\n",
    "not text": "\x00\x01",
}


@contextmanager
def watched(patience=PATIENCE, error=TimeoutError):
    """Limits of memory and time [s], as a user's patience has them; the error of a late one."""

    def late(number, frame):
        raise error(f"not done in {patience} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGALRM, late)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, before[1]))
    signal.alarm(patience)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


def checked(path, capsys):
    """Exit code of `check`, with the promises of the command line kept."""
    with watched(), pytest.raises(SystemExit) as ended:
        main(["check", str(path)])
    said = capsys.readouterr()
    code = ended.value.code or 0
    assert code in (0, 2), said.err
    assert len(said.err.splitlines()) == (1 if code == 2 else 0), said.err
    if code == 2:
        assert said.out == "" and path.name in said.err, said.err
    return code


@pytest.mark.parametrize("name", ODD)
def test_odd_files_are_one_line(tmp_path, capsys, name):
    path = tmp_path / "case.yaml"
    path.write_text(ODD[name])
    assert checked(path, capsys) == 2


def tried(seeds, path, capsys):
    codes, failures = Counter(), []
    for seed in seeds:
        path.write_bytes(mutant(seed))
        try:
            codes[checked(path, capsys)] += 1
        except BaseException as error:
            failures.append((seed, repr(error)[:300]))
    with capsys.disabled():
        print(
            f"\n{len(seeds)} case files: {codes[0]} taken, {codes[2]} refused in one line, "
            f"{len(failures)} failures"
        )
    assert not failures
    assert min(codes[0], codes[2]) > 0.05 * len(seeds)  # both sides are tried


def test_case_files_broken_at_random(tmp_path, capsys):
    tried(range(80), tmp_path / "case.yaml", capsys)


@pytest.mark.slow
def test_many_case_files_broken_at_random(tmp_path, capsys):
    tried(range(1000, 5000), tmp_path / "case.yaml", capsys)


#: One effect of each test is enough to come by all that a search does; a drape has its own.
TRIED = {"picture_frame": ["crossover_friction"], "cantilever": ["clamp_tilt"], "drape": []}


def test_measurements_broken_at_random(tmp_path, capsys):
    """What is refused is refused by the command, in one line and before it writes anything."""
    codes = Counter()
    for seed in range(50):
        folder = tmp_path / str(seed)
        broken(seed, folder)
        with watched():
            try:
                read_measurement(folder)
            except InputError as error:
                codes["refused"] += 1
                line = " ".join(str(error).split())
            else:
                codes["taken"] += 1
                continue
            with pytest.raises(SystemExit) as ended:
                main(["diagnose", str(folder), "--out", str(tmp_path / "out"), "--quiet"])
        said = capsys.readouterr()
        assert (ended.value.code, said.err, said.out) == (2, line + "\n", ""), seed
        assert not (tmp_path / "out").exists(), seed
    assert min(codes.values()) > 0.1 * codes.total()  # both sides are tried


@pytest.mark.slow
def test_measurements_broken_at_random_are_diagnosed(tmp_path, capsys):
    """What is taken ends with a whole report, a line, or on request; never with half a report."""
    codes = Counter()
    for seed in range(10000, 10150):
        folder, out = tmp_path / str(seed), tmp_path / f"out {seed}"
        broken(seed, folder)
        try:
            effects = TRIED[read_measurement(folder).test]
        except InputError:
            continue
        chosen = ["--effects", *effects] if effects else []
        with watched(60, KeyboardInterrupt), pytest.raises(SystemExit) as ended:
            main(["diagnose", str(folder), "--out", str(out), "--quiet", *chosen])
        said, code = capsys.readouterr(), ended.value.code or 0
        codes[code] += 1
        assert code in (0, 2, 3, 130), (seed, said.err)
        assert len(said.err.splitlines()) == (code != 0), (seed, said.err)
        left = {path.name for path in out.rglob("*")}
        assert ({"report.json", "report.html"} <= left) == bool(left) == (code == 0), (seed, left)
        assert not any("partial" in name for name in left), (seed, left)
        shutil.rmtree(out, ignore_errors=True)
    with capsys.disabled():
        print(f"\ndiagnosed: {dict(codes)} by exit code")
    assert codes[0] > 5
