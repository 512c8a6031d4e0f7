"""Whatever stands in a case file, the command line says one line or does as asked; no traceback."""

import resource
import signal
from collections import Counter
from contextlib import contextmanager

import pytest
from fuzz import mutant

from fabric_fenicsx.__main__ import main

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
def watched():
    """Limits of memory and time, as a user's patience has them."""

    def late(number, frame):
        raise TimeoutError(f"not done in {PATIENCE} s")

    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGALRM, late)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, before[1]))
    signal.alarm(PATIENCE)
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
    tried(range(150), tmp_path / "case.yaml", capsys)


@pytest.mark.slow
def test_many_case_files_broken_at_random(tmp_path, capsys):
    tried(range(1000, 5000), tmp_path / "case.yaml", capsys)
