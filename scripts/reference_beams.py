"""Rows of docs/reference.md about single beams in balance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from reference_table import (
    CLOSED,
    CODE,
    EXPERIMENT,
    IDENTITY,
    NUMERICAL,
    Row,
    last_order,
    number,
    size,
)

# isort: split
import reference
import test_arc_length as arc
import test_beam as beam
import test_composite_strips as strips
import test_heavy_cantilever as heavy
import test_princeton_beam as princeton
import test_section as section
from solve import random_rotation


def bends() -> Iterator[Row]:
    """Roll-up, the 45-degree bend and the cantilever with an end force."""
    left = max(float(np.linalg.norm(beam.roll_up(d, 20))) for d in beam.DIRECTIONS)
    coarse = [float(np.linalg.norm(beam.roll_up((1, 0, 0), n))) for n in (8, 10)]
    order = np.log(coarse[0] / coarse[1]) / np.log(10 / 8)
    yield Row(
        "Roll-up, 20 cells, every 45° and 4 more directions",
        "largest distance of the tip from the root over the length",
        "0",
        CLOSED,
        "end moment 2πEI/L",
        size(left / beam.LENGTH),
        size(left / beam.LENGTH),
        f"{order:.1f}",
    )
    yield Row(
        "the same",
        "distance of the polygon of 20 cells",
        number(beam.distance_left(20) / beam.LENGTH, 3),
        IDENTITY,
        "element's own moment relation",
        number(left / beam.LENGTH, 3),
        size((left - beam.distance_left(20)) / beam.LENGTH),
    )
    circle = reference.curved_cantilever(beam.RADIUS, np.pi / 4, beam.SQUARE, (0, 0, 600.0))
    kinds = (
        ("parabola¹", beam.parabola, beam.ROUNDED, beam.published_bend("Kynema"), CODE, "Kynema¹"),
        ("circle", beam.circle, beam.SQUARE, circle, NUMERICAL, "shooting"),
    )
    for name, shape, stiffness, exact, kind, source in kinds:
        found = {n: beam.bend_45(shape(n), stiffness) for n in (16, 32, 64)}
        extrapolated = found[64] + (found[64] - found[32]) / 3.0
        for k, component in enumerate(("radial", "tangential", "out of plane")):
            yield Row(
                f"45° bend, {name}, 64 cells",
                f"tip, {component} [extrapolated]",
                number(exact[k], 9),
                kind,
                source,
                f"{number(found[64][k], 7)} [{number(extrapolated[k], 8)}]",
                f"{size(found[64][k] / exact[k] - 1)} [{size(extrapolated[k] / exact[k] - 1)}]",
                last_order([abs(u[k] - exact[k]) for u in found.values()]),
            )
    eight = beam.bend_45(beam.circle(8), beam.SQUARE)
    for author, source in (("Simo", "Simo & Vu-Quoc 1986"), ("Bathe", "Bathe & Bolourchi 1979")):
        theirs = beam.published_bend(author)
        yield Row(
            "45° bend, circle, 8 cells",
            "tip",
            ", ".join(number(v, 4) for v in theirs),
            CODE,
            f"{source}, 8 elements",
            ", ".join(f"{v:.2f}" for v in eight),
            size(np.abs(eight - theirs).max()),
        )
    turn, _ = random_rotation(np.random.default_rng(3))
    reach, deflection = reference.end_shear(4.0)
    exact = np.array([1.0 - reach, deflection])
    ends = {n: beam.end_shear(n, turn) for n in (32, 64)}
    table = reference.table("cantilever_end_shear.csv")[-1]
    for k, name in enumerate(("shortening", "deflection")):
        yield Row(
            "End force PL²/B = 4, 64 cells, turned in space",
            f"{name} over length",
            number(exact[k]),
            NUMERICAL,
            "elastica, initial value problem",
            number(ends[64][k]),
            size(ends[64][k] - exact[k]),
            last_order([abs(e[k] - exact[k]) for e in ends.values()]),
        )
        yield Row(
            "the same",
            f"{name} over length",
            number(float(table[name]) / 10.0),
            CODE,
            "Sze et al. 2004, shells, as far below the elastica",
            f"{ends[64][k]:.4f}",
            size(ends[64][k] - float(table[name]) / 10.0),
        )


def hanging() -> Iterator[Row]:
    """Strips under their own weight."""
    for overhang in heavy.OVERHANGS:
        load = heavy.WEIGHT * overhang**3 / heavy.B
        exact = np.array(reference.heavy_cantilever(load))
        exact[1] += heavy.WEIGHT * overhang / (2.0 * heavy.SECTION.stiffness()[1])
        found = {n: heavy.strip(overhang, n) for n in (32, 64)}
        for k, name in enumerate(("reach", "drop")):
            yield Row(
                f"Heavy cantilever, overhang {overhang} mm, wL³/B = {load:.3f}, 64 cells",
                f"{name} over overhang",
                number(exact[k]),
                NUMERICAL,
                "heavy elastica, initial value problem",
                number(found[64][k]),
                size(found[64][k] - exact[k]),
                last_order([abs(f[k] - exact[k]) for f in found.values()]),
            )


def twisted() -> Iterator[Row]:
    """The Princeton beam, laminated strips, the Neo-Hookean section."""
    fine = princeton.tips(32, princeton.section(0.198))[:, 1:]
    codes = np.array([princeton.published(code) for code in princeton.CODES])
    outside = np.maximum(codes.min(axis=0) - fine, fine - codes.max(axis=0)).max()
    spread = float(np.ptp(codes, axis=0).max())
    yield Row(
        "Princeton beam, 2 loads, 7 angles, 32 cells",
        "28 tip displacements [mm]",
        f"intervals of three codes, up to {spread:.1f} wide",
        CODE,
        "ANSYS beams and solids (Obrezkov et al. 2022), Exudyn",
        "in or next to them",
        f"{max(outside, 0.0):.2f} mm outside",
    )
    exact = princeton.tips(64, princeton.section(0.217, 5 / 6))[:, 1:]
    yield Row(
        "the same, torsion constant fitted (0.217 of the polar moment), 64 cells",
        "28 tip displacements [mm]",
        "up to 200.68",
        CODE,
        "ANSYS beams",
        f"up to {exact.max():.2f}",
        size(np.abs(exact - princeton.published("ANSYS_beam")).max(), "mm"),
    )
    for name, theta in strips.CASES:
        off, measured, across = strips.deviations(name, theta)
        largest = measured[across].max()
        rms = strips.rms(off[across])
        low = -np.sum(off[across] * measured[across]) / np.sum(measured[across] ** 2)
        yield Row(
            f"Laminated strip {name} turned by {theta}°, 22 cells",
            f"{across.sum()} deflections up to {largest:.0f} mm",
            "measured",
            EXPERIMENT,
            "Minguet & Dugundji 1990²",
            f"{-100 * low:+.1f} % on the whole, at most {np.abs(off[across]).max():.1f} mm off",
            f"rms {rms:.1f} mm ({100 * rms / largest:.1f} %)",
        )
    for name in ("b2", "b3"):
        exact_end = strips.shooting(strips.matrix(name), 45, 400)
        found = [strips.deflections(strips.matrix(name), 45, (200, 400), n)[-1] for n in (22, 44)]
        errors = [float(np.linalg.norm(u - exact_end)) for u in found]
        yield Row(
            f"Coupled section {name} at 45°, 400 g, 44 cells",
            "displacement at 500 mm [mm]",
            ", ".join(f"{v:.3f}" for v in exact_end),
            NUMERICAL,
            "shooting",
            ", ".join(f"{v:.3f}" for v in found[-1]),
            size(errors[-1], "mm"),
            last_order(errors),
        )
    forces, _ = section.law_of(section.rectangle(0.0))
    worst = 0.0
    for stretch in (0.5, 0.9, 1.1, 2.0):
        N = 2 * section.C1 * section.A * section.B * (stretch - stretch**-2)
        worst = max(worst, abs(forces([stretch - 1, 0, 0, 0, 0, 0])[0].real / N - 1))
    yield Row(
        "Neo-Hookean bar, stretches 0.5 to 2",
        "normal force",
        "2 C1 A (λ − λ⁻²)",
        CLOSED,
        "incompressible solid",
        "",
        size(worst),
    )


def unstable() -> Iterator[Row]:
    """A truss and an arch that snap through, a tow that buckles."""
    w, P, exact = arc.truss_path()
    up = w < 10.0
    yield Row(
        f"Two-bar truss of rise 1:10, pushed through in {len(w) - 1} steps",
        "highest and lowest load on the way [N]",
        f"{number(exact[up].max(), 6)}, {number(exact.min(), 6)}",
        CLOSED,
        "EA (l/L − 1)(w − h)/l",
        f"{number(P[up].max(), 6)}, {number(P.min(), 6)}",
        size(np.abs(P - exact).max() / exact[up].max()),
    )
    coarse, fine = (arc.arch_limit(cells) for cells in (40, 80))
    extrapolated = (4.0 * fine - coarse) / 3.0
    yield Row(
        "Clamped-hinged arch of 215°, load at its crown, 80 cells",
        "limit load P R²/EI [extrapolated]",
        "8.97",
        NUMERICAL,
        "DaDeppo & Schmidt 1975",
        f"{fine:.4f} [{extrapolated:.4f}]",
        f"{size(fine / 8.97 - 1)} [{size(extrapolated / 8.97 - 1)}]",
    )
    alpha, P, exact, _ = arc.buckled()
    far = alpha > np.radians(15.0)
    last = int(np.argmax(alpha))
    yield Row(
        "Clamped tow pushed beyond Euler's load, 40 cells",
        f"load over Euler's at an end angle of {np.degrees(alpha[last]):.1f}°",
        number(exact[last], 6),
        CLOSED,
        "elastica, (2 K(sin α/2)/π)²",
        number(P[last], 6),
        size(np.abs(P[far] / exact[far] - 1).max()),
    )
