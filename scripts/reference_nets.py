"""Rows of docs/reference.md about time, nets, friction and what must not matter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
from reference_table import CLOSED, CODE, IDENTITY, Row, last_order, number, size

# isort: split
import reference
import test_chebyshev_net as chebyshev
import test_crossover as crossover
import test_friction as friction
import test_invariance as invariance
import test_picture_frame_net as frame
import test_pressed as pressed
import test_time as time
from solve import random_rotation, set_state

from fabric_fenicsx.solving.update import compose


def dynamics() -> Iterator[Row]:
    """Frequency, free flight, the right-angle cantilever."""
    exact = 1.875104068711961**2 * np.sqrt(time.EI / time.RHO_A) / time.LENGTH**2
    found = [time.lowest_mode(time.cantilever(n))[0] for n in (16, 32)]
    yield Row(
        "Cantilever, lowest frequency, 32 cells",
        "ω [rad/s]",
        number(exact),
        CLOSED,
        "cos λ cosh λ = −1",
        number(found[-1]),
        size(found[-1] / exact - 1),
        last_order([abs(f - exact) for f in found]),
    )
    for radius in (1.0, 0.5):
        rates, errors = time.flight_orders(radius)
        yield Row(
            f"Beam thrown and spun, spectral radius {radius:g}, 160 steps",
            "place of its end",
            "run of 1280 steps",
            "own fine run",
            "generalised-α, order 2",
            "",
            size(errors[-1]),
            f"{rates[-1]:.2f}",
        )
    moment, _, _, elbow, tip = time.right_angle(1.0, 40, 825, 16.5).T
    places = {"tip_max": tip.argmax(), "tip_min": tip.argmin(), "elbow_min": elbow.argmin()}
    for row in reference.table("right_angle_cantilever.csv"):
        at = places[row["quantity"]]
        way = (tip if row["quantity"].startswith("tip") else elbow)[at]
        yield Row(
            "Right-angle cantilever, 40 cells a leg, Δt 0.02",
            f"{row['quantity'].replace('_', ', ')} (time)",
            f"{row['displacement']} ({row['time']})",
            CODE,
            "Exudyn; problem of Simo & Vu-Quoc 1988",
            f"{way:.3f} ({moment[at]:.2f})",
            size(round(way - float(row["displacement"]), 3)),
        )
    ways = [time.right_angle(1.0, 4, n, 4.0)[-1, 3:] for n in (80, 160, 320, 1280)]
    errors = [float(np.linalg.norm(way - ways[-1])) for way in ways[:-1]]
    yield Row(
        "the same, 4 cells a leg, Δt 0.0125",
        "elbow and tip at t = 4",
        "run of Δt 0.003125",
        "own fine run",
        "generalised-α, order 2",
        "",
        size(errors[-1]),
        last_order(errors),
    )
    swings = []
    for steps in (330, 660):
        now, strain, kinetic, _, _ = time.right_angle(1.0, 10, steps, 16.5).T
        total = (strain + kinetic)[now > 2.0 + 1e-9]
        swings.append(float(np.ptp(total) / total.mean()))
    yield Row(
        "the same, spectral radius 1, Δt 0.025",
        "swing of the energy without load",
        "0",
        IDENTITY,
        "conservation",
        size(swings[-1]),
        size(swings[-1]),
        last_order(swings),
    )


def nets() -> Iterator[Row]:
    """Picture frame and Chebyshev net."""
    ratio, gamma, _, _ = frame.sheared(5, stiffer=1000.0)
    yield Row(
        "Picture frame, 5 × 5 tows a thousand times stiffer, 55°",
        "generalised force over n²kγ",
        "1",
        CLOSED,
        "virtual work of the affine motion",
        number(ratio, 8),
        size(ratio - 1),
    )
    yield Row(
        "the same",
        "shear angle [degrees]",
        "55",
        CLOSED,
        "affine motion",
        f"{np.degrees(gamma).min():.5f} to {np.degrees(gamma).max():.5f}",
        size(np.degrees(np.abs(gamma - frame.FULL).max()), "°"),
    )
    lost = 1 - frame.sheared(15)[1].reshape(15, 15)[7, 7] / frame.FULL
    _, GA, _, _, _, EI = frame.SECTION.stiffness()
    bay = 2 * frame.K * frame.SPACING / (12 * EI) * (1 - 1 / 2**2) + 2 * frame.K / (
        GA * frame.SPACING
    )
    yield Row(
        "Picture frame, 15 × 15 real tows, 2 cells a bay",
        "part of the middle crossing's angle lost to bending",
        number(bay, 4),
        CLOSED,
        "bending and shear of a bay",
        number(lost, 4),
        size(lost / bay - 1),
    )
    ratio, *_ = frame.sheared(9, subdivisions=4)
    force = ratio * 81 * frame.K * frame.FULL
    yield Row(
        "Picture frame, 9 × 9 real tows, 55°",
        "generalised force [N mm]",
        "3880.67",
        CODE,
        "Exudyn 1.13.6, the same beams and springs",
        f"{force:.2f}",
        size(force / 3880.67 - 1),
    )
    spacings = (12.0, 6.0, 3.0)
    found = {s: chebyshev.errors(s) for s in spacings}
    rms_order = last_order([found[s][1] for s in spacings])
    angles, exact = chebyshev.angles(6.0)
    yield Row(
        "Chebyshev net on a sphere of radius 76.2 mm, spacing 6 mm",
        f"shear angles of {len(exact)} crossings, up to [degrees]",
        f"{exact.max():.3f}",
        CLOSED,
        "ξω″ + ω′ + sin ω = 0, integrated",
        f"{angles.max():.3f}",
        f"{found[6.0][0]:.3f}° largest, {found[6.0][1]:.4f}° rms",
        last_order([found[s][1] for s in spacings[:2]]),
    )
    angles, exact = chebyshev.angles(3.0)
    yield Row(
        "the same, spacing 3 mm",
        f"shear angles of {len(exact)} crossings, up to [degrees]",
        f"{exact.max():.3f}",
        CLOSED,
        "the same",
        f"{angles.max():.3f}",
        f"{found[3.0][0]:.3f}° largest, {found[3.0][1]:.4f}° rms",
        rms_order,
    )


@contextmanager
def thinner_tow() -> Iterator[None]:
    """Halve the height of the tows in the tests of friction."""
    tow = friction.SECTION
    friction.SECTION = replace(tow, height=tow.height / 2)
    try:
        yield
    finally:
        friction.SECTION = tow


def sliding() -> Iterator[Row]:
    """Coulomb friction."""
    exact = float(np.exp(friction.MU * np.pi / 2))
    for tow, section in (
        ("Tow pulled over a drum, a quarter turn, μ = 0.3, 40 cells⁴", nullcontext()),
        ("the same, tow half as high", thinner_tow()),
    ):
        with section:
            ratio = friction.over_a_drum(40)[-1]
        yield Row(
            tow,
            "T2/T1",
            number(exact),
            CLOSED,
            "capstan, exp(μφ)",
            number(ratio, 6),
            size(ratio / exact - 1),
        )
    coarse, fine = (friction.over_a_drum(20, steps=n)[-1] for n in (10, 40))
    yield Row(
        "the same, 20 cells",
        "T2/T1 in 10 and in 40 steps",
        "equal",
        IDENTITY,
        "independent of the step",
        f"{coarse:.5f}, {fine:.5f}",
        size(coarse / fine - 1),
    )
    slope, end = np.radians(30.0), 0.2
    slip = friction.GRAVITY * (np.sin(slope) - friction.MU * np.cos(slope)) * end**2 / 2
    runs = [friction.on_an_incline(slope, end, end / n) for n in (40, 80)]
    extrapolated = 2 * runs[1] - runs[0]
    yield Row(
        "Tow released on an incline of 30°, μ = 0.3, 80 steps³",
        "slip after 0.2 s [mm] [extrapolated]",
        number(slip, 6),
        CLOSED,
        "g (sin φ − μ cos φ) t²/2",
        f"{runs[1]:.3f} [{extrapolated:.4f}]",
        f"{size(runs[1] / slip - 1)} [{size(extrapolated / slip - 1)}]",
        last_order([abs(r - slip) for r in runs]),
    )
    slope = np.radians(16.0)
    stretch = friction.SECTION.density * friction.SECTION.area * friction.GRAVITY
    stretch *= np.sin(slope) / 0.5
    crept = friction.on_an_incline(slope, 1.0, 0.01)
    yield Row(
        "The same at 16°, below the friction angle",
        "slip after 1 s [mm]",
        number(stretch, 3),
        CLOSED,
        "stretch of the stick, w sin φ/k",
        number(crept, 3),
        size(crept - stretch, "mm"),
    )


def held() -> Iterator[Row]:
    """A blank holder pushed by a force."""
    for force in (0.4, 30.0):
        place, _, exact = pressed.height(force)
        yield Row(
            f"Holder pushed on a tow of 40 mm by {force:g} N",
            "its height over the die [mm]",
            number(exact),
            CLOSED,
            "contact law of two flat faces",
            number(place),
            size(place - exact, "mm"),
        )
    force, mu = 4.0, 0.3
    pull, _ = pressed.pulled_out(force, mu)
    yield Row(
        "Tow pulled from under a holder of 4 N, μ = 0.3",
        "pull [N]",
        number(2.0 * mu * force),
        CLOSED,
        "2 μ F",
        number(pull),
        size(pull / (2.0 * mu * force) - 1),
    )


def invariances() -> Iterator[Row]:
    """Rigid turns, the path, the ranks."""
    model, loads = invariance.make()
    statics = invariance.run(model, loads)
    u, q = statics.displacements, statics.quaternions
    set_state(model, u, q)
    before, gamma, _ = invariance.observed(model)
    change = 0.0
    for seed in range(5):
        R, p = random_rotation(np.random.default_rng(seed))
        x = (model.net.points + u) @ R.T
        set_state(model, x - model.net.points, compose(np.tile(p, (len(q), 1)), q))
        after, turned, _ = invariance.observed(model)
        change = max(change, *(abs(after[name] / before[name] - 1) for name in before))
        change = max(change, float(np.abs(turned - gamma).max()))
    yield Row(
        "Loaded, bent and twisted net of 2 × 3 tows, 5 random rigid turns",
        "each energy, each shear angle",
        "unchanged",
        IDENTITY,
        "frame invariance (Crisfield & Jelenić 1999)",
        "",
        size(change),
    )
    other = max(
        float(np.abs(invariance.run(*invariance.make(), steps=5, order=o).displacements - u).max())
        for o in ((0, 1, 2), (2, 0, 1))
    )
    yield Row(
        "the same, loads one after another in two orders",
        f"displacements up to {np.linalg.norm(u, axis=1).max():.1f} mm",
        "the same end",
        IDENTITY,
        "path independence",
        "",
        size(other, "mm"),
    )
    found: list[dict[str, Any]] = [crossover.on_that_many(ranks) for ranks in (1, 2, 3)]
    one = np.array(found[0]["displacements"])
    yield Row(
        "Net of 3 × 4 tows on 1, 2 and 3 ranks",
        f"displacements up to {np.abs(one).max():.1f} mm",
        "equal",
        IDENTITY,
        "independent of the partition",
        "",
        size(max(np.abs(np.array(f["displacements"]) - one).max() for f in found[1:]), "mm"),
    )
    yield Row(
        "the same",
        "norm of the tangent",
        "equal",
        IDENTITY,
        "independent of the partition",
        "",
        size(max(abs(f["tangent"] / found[0]["tangent"] - 1) for f in found[1:])),
    )
