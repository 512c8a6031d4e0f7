"""Work that is shared with copies of the process: the same answers, the same objects, no trace."""

import multiprocessing
import os
import signal

import numpy as np
import pytest
from linear import Linear, linear_effect, readings

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.loop import copies
from fabric_fenicsx.loop.copies import in_copies, put_off_in_copies
from fabric_fenicsx.loop.inference.search import diagnose_test


@pytest.fixture(autouse=True)
def three_cores(monkeypatch):
    monkeypatch.setattr(copies, "cores", lambda: 3)


@pytest.fixture
def made(monkeypatch):
    """Processes that were made, two of them; at the end none of them is there any more."""
    numbers = []
    fork = os.fork

    def noted():
        numbers.append(fork())
        return numbers[-1]

    monkeypatch.setattr(os, "fork", noted)
    yield numbers
    assert len(numbers) == 2
    for number in numbers:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


@pytest.fixture
def together():
    """To be called in a task: a process that takes its first one waits for the two others."""
    barrier, met = multiprocessing.get_context("fork").Barrier(3), set()

    def wait():
        if os.getpid() not in met:
            met.add(os.getpid())
            barrier.wait(60.0)

    return wait


def test_answers_come_in_the_order_of_the_tasks_from_as_many_processes_as_cores(made, together):
    found = in_copies(lambda k: (together(), k**2, os.getpid()), range(8))
    assert [square for _, square, _ in found] == [k**2 for k in range(8)]
    assert {pid for *_, pid in found} == {os.getpid(), *made}


def test_a_process_that_is_free_takes_the_next_task(made, together):
    own = os.getpid()

    def task(k):
        together()
        if os.getpid() != own:
            # Until all others are done.
            assert signal.sigtimedwait([signal.SIGUSR1], 60.0)
        elif k == 59:
            for copy in made:
                os.kill(copy, signal.SIGUSR1)
        return os.getpid()

    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
    try:
        assert in_copies(task, range(60)).count(own) == 58
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGUSR1])


def test_one_task_or_one_core_needs_no_copy(monkeypatch):
    assert in_copies(lambda _: os.getpid(), [0]) == [os.getpid()]
    monkeypatch.setattr(copies, "cores", lambda: 1)
    assert in_copies(lambda _: os.getpid(), range(5)) == [os.getpid()] * 5
    assert in_copies(lambda _: os.getpid(), []) == []


@pytest.mark.parametrize("cores", [1, 3])
def test_what_a_copy_cannot_do_is_done_here_when_the_others_are_done(cores, monkeypatch):
    monkeypatch.setattr(copies, "cores", lambda: cores)
    solved = []

    def task(k):
        known = len(solved)
        if k % 2:
            put_off_in_copies()
            solved.append(k)
        return k, known, os.getpid()

    found = in_copies(task, range(6))
    assert [k for k, _, _ in found] == list(range(6))
    # The even ones know nothing of what the odd ones find, and these come in their order.
    assert [known for _, known, _ in found] == [0, 0, 0, 1, 0, 2]
    assert solved == [1, 3, 5] and {pid for *_, pid in found[1::2]} == {os.getpid()}
    put_off_in_copies()


def test_a_copy_has_no_copies(made, together):
    found = in_copies(lambda _: [together(), *in_copies(lambda _: os.getpid(), range(4))], range(3))
    found = [own for _, *own in found]
    assert all(len(set(own)) == 1 for own in found)
    assert len({own[0] for own in found}) == 3


def test_known_objects_stay_the_very_same():
    def law():
        """No pickle holds what is defined in a function."""

    other = object()
    found = in_copies(lambda k: (k, [law, other]), range(3), [law, other])
    assert all(one is law and two is other for _, (one, two) in found)


def test_a_large_answer_fits_through():
    assert in_copies(lambda k: bytes([k]) * 10**7, range(3))[2] == b"\2" * 10**7


@pytest.mark.parametrize("here", [True, False])
def test_what_is_raised_of_a_task_is_raised_here(here, made, together):
    own = os.getpid()

    def strict(k):
        together()
        if (os.getpid() == own) is here:
            raise SolveError(f"task of {os.getpid()}")
        return k

    with pytest.raises(SolveError, match=r"task of \d+") as raised:
        in_copies(strict, range(6))
    pid = int(str(raised.value).removeprefix("task of "))
    assert pid == own if here else pid in made


def test_a_copy_that_is_killed_is_an_error_and_no_answer(made, together):
    own = os.getpid()

    def mortal(k):
        together()
        if os.getpid() != own:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with pytest.raises(SolveError, match="has ended"):
        in_copies(mortal, range(3))


def test_an_interrupt_ends_the_copies(made, together):
    own = os.getpid()

    def slow(_):
        together()
        if os.getpid() == own:
            raise KeyboardInterrupt
        signal.pause()

    with pytest.raises(KeyboardInterrupt):
        in_copies(slow, range(3))


def test_a_diagnosis_is_the_same_to_the_last_digit_however_many_share_it(monkeypatch):
    t = np.tile(np.linspace(0.0, 1.0, 60), 3)
    columns = {"a": np.ones_like(t), "b": t, **{f"c{k}": np.sin(k * t) for k in range(2, 9)}}
    clean = 1.0 + 2.0 * t + columns["c3"] - columns["c7"]
    observed = clean + 0.01 * np.random.default_rng(4).normal(size=len(t))
    test = Linear(readings(observed, run=np.repeat(np.arange(3), 60)), columns, ("a", "b"))
    test.effects = [linear_effect(f"c{k}") for k in range(2, 9)]
    test.terms, test.terms_are_rivals = (), False
    found = []
    for count in (3, 1):
        monkeypatch.setattr(copies, "cores", lambda count=count: count)
        found.append(diagnose_test(test))
    assert {e.name for e in found[0].effects} == {"c3", "c7"}
    assert found[0].criterion_after == found[1].criterion_after
    assert found[0].final.values == found[1].final.values
    assert [c.criterion for c in found[0].candidates] == [c.criterion for c in found[1].candidates]
