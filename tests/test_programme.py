"""Rates of a crosshead found from its record alone, against the programmes that drove it."""

import numpy as np
import pytest
from measurements.programmes import Frame, load_hold, sine, triangle

from fabric_fenicsx.loop.kinds.picture_frame.motion import frame_motion

FRAME = Frame()


def found(programme, times, digits=None):
    """The programme found, and the true speed at each reading."""
    travel, speed = programme.drive(FRAME, times)
    if digits is not None:
        travel = np.round(travel, digits)
    return frame_motion(times, travel, FRAME.length), speed


def rates(p):
    """At the readings, in their order."""
    own = p.reading >= 0
    return p.rate[own][np.argsort(p.reading[own])]


@pytest.mark.parametrize("control", ["crosshead", "angle"])
@pytest.mark.parametrize(("count", "least"), [(15, 10), (41, 34), (400, 380)])
def test_legs_at_a_constant_rate(control, count, least):
    driven = triangle(FRAME, 0.8, 0.0, 0.03, 2, control=control)
    p, speed = found(driven, np.linspace(0.0, driven.duration, count))
    assert p.certain.sum() >= least
    # The rate at a corner is that of either side; such readings are not among the certain ones.
    assert rates(p)[p.certain] == pytest.approx(speed[p.certain], rel=1e-6)


def test_a_reading_beside_a_turn_counts_where_it_is_in_line():
    driven = triangle(FRAME, 0.8, 0.0, 0.03, 1, control="angle")
    # Turned half way between two readings.
    p, _ = found(driven, np.linspace(0.0, driven.duration, 16))
    assert p.certain[[7, 8]].all()
    rounded = triangle(FRAME, 0.8, 0.0, 0.03, 1, control="angle", run_up=0.12 * driven.duration)
    p, _ = found(rounded, np.linspace(0.0, driven.duration, 16))
    assert not p.certain[[7, 8]].any()


@pytest.mark.parametrize("digits", [2, 4, None])
def test_holds_are_at_rest(digits):
    driven = load_hold(FRAME, [0.4, 0.8], 0.03, 20.0, True)
    times = np.linspace(0.0, driven.duration, 301)
    p, speed = found(driven, times, digits)
    at_rest = (speed == 0.0) & p.certain
    assert at_rest.sum() > 0.9 * (speed == 0.0).sum()
    assert (rates(p)[at_rest] == 0.0).all()
    assert p.certain.mean() > 0.9


def test_a_dense_sine_is_known_to_two_percent_and_a_sparse_one_not_at_all():
    driven = sine(0.7, -0.7, 0.05)
    p, speed = found(driven, np.linspace(0.0, driven.duration, 300))
    away = np.abs(rates(p) - speed)[p.certain] / np.abs(speed).max()
    assert p.certain.mean() > 0.85
    assert away.max() < 0.02
    # Five readings a cycle: what agrees does so by chance.
    p, speed = found(driven, np.linspace(0.0, driven.duration, 13))
    assert p.certain.sum() <= 2


@pytest.mark.parametrize("control", ["crosshead", "angle"])
@pytest.mark.parametrize("count", [14, 15, 17, 19])
def test_one_speed_to_and_fro_is_known_from_few_readings(control, count):
    # Three or four readings on a leg: few of them lie in line with two others.
    driven = triangle(FRAME, 0.8, 0.0, 0.03, 2, control=control)
    times = np.linspace(0.0, driven.duration, count)
    p, speed = found(driven, times)
    assert p.certain.sum() >= count - 4
    assert rates(p)[p.certain] == pytest.approx(speed[p.certain], rel=1e-6)
    # It turns when it turned, and goes as far.
    turns = p.reading < 0
    for when, where in zip(p.time[turns], p.displacement[turns], strict=True):
        assert np.abs(np.array(driven.corners) - when).min() < 1e-6 * driven.duration
        assert where == pytest.approx(float(driven.drive(FRAME, when)[0]), abs=1e-4)


@pytest.mark.parametrize("count", [13, 15])
def test_a_leg_may_have_its_turns_on_both_sides_of_a_reading(count):
    # Read ever more rarely, so that the last ways to and fro have one or two readings each.
    driven = triangle(FRAME, 0.8, 0.0, 0.03, 3, control="angle")
    times = driven.duration * np.linspace(0.0, 1.0, count) ** 1.4
    p, speed = found(driven, times)
    assert p.certain.sum() >= count - 2
    assert rates(p)[p.certain] == pytest.approx(speed[p.certain], rel=1e-6)
    turns = p.time[p.reading < 0]
    assert turns == pytest.approx(np.array(driven.corners), rel=1e-6)


@pytest.mark.parametrize("last", [0.02, 0.05, 0.1, 0.5, 0.9, 0.98])
def test_a_turn_shortly_before_a_reading_is_on_the_way_to_it(last):
    """Friction acts the other way from there on: at the reading itself, by its rate.

    Args:
        last: share of the interval, from the turn to the reading.
    """
    times = np.linspace(0.0, 30.0, 26)
    step = times[1]
    turn = times[13] - last * step
    p = frame_motion(times, 20.0 - 0.05 * (times - turn) ** 2, FRAME.length)
    at = np.flatnonzero(p.reading == 13)[0]
    assert p.rate[at] == pytest.approx(-0.1 * last * step, rel=0.05)
    assert p.displacement[at] < p.displacement[at - 1]
    assert p.displacement.max() == pytest.approx(20.0, abs=1e-6)
    assert np.diff(p.time).min() > 1e-7


@pytest.mark.parametrize("count", [13, 17, 19, 23])
def test_a_sparse_sine_is_not_taken_for_it(count):
    driven = sine(0.7, -0.7, 0.05)
    p, speed = found(driven, np.linspace(0.0, driven.duration, count))
    assert p.certain.mean() < 0.5
    away = np.abs(rates(p) - speed)[p.certain] / np.abs(speed).max()
    assert away.max(initial=0.0) < 0.06
