"""What the crosshead of a shear frame is told to do, and when it is read.

Units: mm, s, rad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Frame:
    """A picture frame: sides of the frame and of the sheared fabric [mm]."""

    length: float = 192.0
    fabric: float = 96.0

    def displacement(self, angle: np.ndarray) -> np.ndarray:
        """Crosshead travel [mm] from the square frame at a shear angle [rad]."""
        return self.length * (2 * np.cos(np.pi / 4 - np.asarray(angle) / 2) - np.sqrt(2))

    def angle(self, displacement: np.ndarray) -> np.ndarray:
        """Shear angle [rad] at a crosshead travel [mm]."""
        ratio = (np.sqrt(2) * self.length + np.asarray(displacement)) / (2 * self.length)
        return np.pi / 2 - 2 * np.arccos(ratio)

    def travel_per_angle(self, angle: np.ndarray) -> np.ndarray:
        """dD/dgamma [mm/rad]: the lever on which force and moment do the same work."""
        return self.length * np.sin(np.pi / 4 - np.asarray(angle) / 2)


@dataclass(frozen=True)
class Programme:
    """A motion in time: `motion(t)` gives position and velocity of what is controlled."""

    duration: float
    motion: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    control: str  # "crosshead" [mm] or "angle" [rad]
    corners: tuple[float, ...] = ()

    def drive(self, frame: Frame, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Crosshead travel [mm] and speed [mm/s] at times [s], same shapes."""
        position, velocity = self.motion(time)
        if self.control == "crosshead":
            return position, velocity
        return frame.displacement(position), frame.travel_per_angle(position) * velocity


def stations(
    frame: Frame,
    angles: list[float],
    rate: float,
    holds: list[float] | None = None,
    control: str = "crosshead",
    run_up: float = 0.0,
) -> Programme:
    """From angle to angle [rad] at a constant speed, resting `holds[i]` s after angle i.

    The crosshead's constant speed is the mean one that gives `rate` [rad/s] over the largest
    angle. `run_up` [s] is the time the machine takes to change its speed; with 0 it jumps and the
    velocity at a corner is that of the leg to come.
    """
    largest = max(abs(a) for a in angles)
    speed = rate
    places = np.array([0.0, *angles])
    if control == "crosshead":
        speed = rate * float(frame.displacement(np.array(largest))) / largest
        places = frame.displacement(places)
    time, place = [0.0], [float(places[0])]
    for i, goal in enumerate(places[1:]):
        time.append(time[-1] + abs(goal - place[-1]) / speed)
        place.append(float(goal))
        if holds and holds[i] > 0:
            time.append(time[-1] + holds[i])
            place.append(float(goal))
    knots, values = np.array(time), np.array(place)
    slopes = np.diff(values) / np.diff(knots)
    areas = np.concatenate([[0], np.cumsum(np.diff(knots) * (values[1:] + values[:-1]) / 2)])

    def sharp(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        leg = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(slopes) - 1)
        return np.interp(t, knots, values), slopes[leg]

    def area(t: np.ndarray) -> np.ndarray:
        leg = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(slopes) - 1)
        past = np.clip(t, 0, None) - knots[leg]
        return areas[leg] + values[leg] * past + slopes[leg] * past**2 / 2

    def smooth(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # The mean of the sharp programme over the last `run_up` seconds.
        now, before = np.interp(t, knots, values), np.interp(t - run_up, knots, values)
        return (area(t) - area(t - run_up)) / run_up, (now - before) / run_up

    return Programme(float(knots[-1]), smooth if run_up > 0 else sharp, control, tuple(knots[1:-1]))


def monotone(frame: Frame, peak: float, rate: float, **how) -> Programme:
    """One pull to the angle `peak` [rad]."""
    return stations(frame, [peak], rate, **how)


def triangle(
    frame: Frame, peak: float, low: float, rate: float, cycles: int = 2, **how
) -> Programme:
    """To and fro between `peak` and `low` [rad], from the square frame and back to it."""
    turns = [peak, low] * cycles
    return stations(frame, turns if low == 0 else [*turns, 0.0], rate, **how)


def load_hold(
    frame: Frame, levels: list[float], rate: float, hold: float, unload: bool, **how
) -> Programme:
    """Up through `levels` [rad] with a rest of `hold` s on each, then back if `unload`."""
    goals = [*levels, 0.0] if unload else levels
    rests = [hold] * len(levels) + [0.0] * unload
    return stations(frame, goals, rate, holds=rests, **how)


def sine(peak: float, low: float, rate: float, cycles: float = 2.5) -> Programme:
    """Harmonic in the angle [rad] between `low` and `peak`, `rate` [rad/s] its largest rate."""
    amplitude, mean = (peak - low) / 2, (peak + low) / 2
    omega = rate / amplitude
    start = np.arccos(np.clip(mean / amplitude, -1, 1))

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase = omega * t + start
        return mean - amplitude * np.cos(phase), amplitude * omega * np.sin(phase)

    return Programme(2 * np.pi * cycles / omega, motion, "angle")


def reading_times(
    rng: np.random.Generator, duration: float, count: int, spacing: str, digits: int | None
) -> np.ndarray:
    """`count` strictly increasing times [s] from 0, "even", "jitter" or "early" (denser first).

    With `digits` the logger's clock is rounded; the crosshead is where it is at the time written.
    """
    even = np.linspace(0, 1, count)
    if spacing == "jitter":
        even[1:-1] += rng.uniform(-0.4, 0.4, count - 2) / (count - 1)
    elif spacing == "early":
        even = 0.35 * even + 0.65 * even**2
    elif spacing != "even":
        raise ValueError(f"spacing {spacing}")
    time = duration * even
    if digits is None:
        return time
    # Down, so that the last reading does not lie after the programme.
    return np.unique(np.floor(time * 10**digits) / 10**digits)
