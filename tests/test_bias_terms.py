"""Terms without a formula of strips, what their readings cannot tell apart, and what would."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from measurements.strips import corners, measured, pulled
from test_bias_loop import VALUES, with_angles
from test_bias_loop import measured as of_runs
from test_bias_loop import pulled as run_of
from test_terms import RANGES
from ufl import exp

from fabric_fenicsx.loop.diagnose import diagnose
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.next_tests import next_tests
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds import kind_of
from fabric_fenicsx.loop.kinds.bias_extension import solved
from fabric_fenicsx.loop.kinds.bias_extension.model import BiasExtension
from fabric_fenicsx.loop.kinds.bias_extension.proposals import OfTheFabric, proposals
from fabric_fenicsx.loop.kinds.bias_extension.terms import strip_terms
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.mechanics.laws.law import CrossingLaw, number
from fabric_fenicsx.mechanics.laws.shaped import ShapedLaw

FORCE = np.concatenate([np.linspace(0.0, 20.0, 29), np.linspace(19.0, 0.0, 28)])


@pytest.fixture(scope="module")
def back():
    """Out and back, with angles."""
    return BiasExtension([with_angles(of_runs(run_of(force=FORCE, back=True)))])


def term(test, name, label):
    (effect,) = (e for e in test.terms if e.name == name)
    (variant,) = (v for v in effect.variants if v.label == label)
    return variant


def test_terms_of_a_strip_are_those_that_it_can_show():
    names = {t.name for t in strip_terms(RANGES)}
    assert {"odd_moment_of_angle", "reading_of_force", "travel_of_force"} < names
    assert not any(name.startswith("even") for name in names)
    assert {t.test for t in strip_terms(RANGES)} == {"bias_extension"}


def test_terms_know_whose_general_form_they_are(back):
    """By name; of what is in the list of effects."""
    named = {e.name for e in back.effects}
    of = {t.name: t.general_form_of for t in back.terms}
    assert {name for names in of.values() for name in names} <= named
    assert of["dissipative_moment_of_path"] == ("crossover_friction",)
    assert of["odd_moment_of_angle"] == ("shear_locking",)
    damage = "elastic_moment_of_largest_angle"
    assert of[damage] == ()
    # Along one way out the largest angle is the angle.
    once = {t.name: t.general_form_of for t in strip_terms(RANGES, goes_back=False)}
    assert once[damage] == ("shear_locking",)


def test_what_gives_way_by_the_force_may_be_either_of_two():
    """In series with the strip; by what it gives way by another variable is neither."""
    ranges = RANGES | dict.fromkeys(("force_per_width", "largest_force_per_width"), 1.0)
    slips = [t for t in strip_terms(ranges | {"pinned_angle": 0.5}) if t.acts_on == "slip"]
    assert {t.depends_on for t in slips} == {("force",), ("angle",)}
    for term in slips:
        either = ("crossover_slip", "tow_uncrimping") if term.depends_on == ("force",) else ()
        assert term.in_general == either


def test_angles_alone_have_no_terms():
    test = BiasExtension([with_angles(of_runs(run_of(force=np.full(29, np.nan))))])
    assert test.terms == [] and "shear_locking" in test.alike


def test_a_term_is_shown_along_what_the_crossings_felt(back):
    """The largest angle so far is that of the crossings that are sheared most."""
    variant = term(back, "elastic_moment_of_largest_angle", "largest angle, linear")
    values = VALUES | {p.name: 0.1 for p in variant.parameters}
    rows = np.flatnonzero(back.readings.run == 0)
    along = back.along(variant, values)[rows]
    angle = np.radians(back.readings.covariates["shear angle [°]"][rows])
    assert along == pytest.approx(np.maximum.accumulate(angle), abs=1e-3)
    travel = back.along(term(back, "reading_of_displacement", "linear"), values)[rows]
    assert travel == pytest.approx(back.readings.covariates["displacement [mm]"][rows])


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("elastic_moment_of_largest_angle", "largest angle, step"),
        ("reading_of_force", "2 coefficients"),
        ("travel_of_force", "linear"),
    ],
)
def test_slopes_are_differences(back, name, label, monkeypatch):
    variant = term(back, name, label)
    values = dict(VALUES)
    for k, p in enumerate(variant.parameters):
        values[p.name] = p.starts[0] if p.starts else 0.2 - 0.05 * k
    _, slopes = back.predict((variant,), values)
    monkeypatch.setattr(solved, "MOST", 0)
    for key in ("k3_N", *(p.name for p in variant.parameters)):
        h = 1e-5 * abs(values[key])
        up, down = (back.predict((variant,), values | {key: values[key] + s})[0] for s in (h, -h))
        difference = (up - down) / (2.0 * h)
        # Rates of a travel that depends on the force are differences themselves.
        off = 2e-3 * np.abs(difference).max() + 1e-8
        assert slopes[key] == pytest.approx(difference, abs=off)
        assert np.abs(difference).max() > 1e-3


def test_jaws_that_give_turn_the_crossings_less(back):
    """A strip that is drawn by less, as its force pulls the jaws: forces and angles of there."""
    variant = term(back, "travel_of_force", "linear")
    force, _ = back.predict((), VALUES)
    rows = back.readings.run == 0
    out = np.flatnonzero(rows)[:29]
    D = back.readings.covariates["displacement [mm]"]
    give = 0.05
    reach = variant.shape.reach
    moved, _ = back.predict((variant,), VALUES | {variant.parameters[0].name: -give * reach})
    # To first order what is missing of the travel is the force without the jaws.
    less = D[out] - give * np.minimum(force[out], reach)
    assert moved[out] == pytest.approx(np.interp(less, D[out], force[out]), abs=0.02 * force.max())
    angles = back.readings.run == 1
    assert (moved[angles] < force[angles]).all()


@pytest.mark.parametrize(
    ("name", "label"),
    [("travel_of_force", "linear"), ("dissipative_moment_of_path", "path, linear")],
)
def test_angles_that_were_read_seldom_are_those_read_each_time(name, label):
    """Along the force's record, whose crossings are followed once, in a law with memory too."""
    found = []
    for between, step in ((2, 1), (1, 2)):
        measurement = of_runs(run_of(force=FORCE, back=True))
        test = BiasExtension([with_angles(measurement, every=between)])
        assert test._going.runs.tolist() == [0]
        variant = term(test, name, label)
        values = VALUES | dict.fromkeys((p.name for p in variant.parameters), 0.02)
        expected, slopes = test.predict((variant,), values)
        force, angle = (np.flatnonzero(test.readings.run == run) for run in (0, 1))
        rows = np.concatenate([force, angle[::step]])
        # In degrees: a newton is as many of them as their scatter says.
        unit = np.where(rows > force[-1], test.readings.others[0].unit, 1.0)
        found.append(np.stack([expected[rows], *(slopes[n][rows] for n in sorted(slopes))]) / unit)
    size = np.abs(found[0]).max(axis=1, keepdims=True)
    assert (np.abs(found[0] - found[1]) <= 1e-9 * size).all() and (size > 0.0).all()


def test_one_way_at_one_speed_is_one_curve(back):
    one = of_runs(run_of(force=FORCE[:29]))
    alike = BiasExtension([one]).alike
    assert {"crossover_friction", "shear_locking", "viscous_moment_of_time"} < alike
    assert not alike & {"crossover_slip", "clamp_slip", "load_drift", "reading_of_time"}
    # A way back, or another speed, may tell.
    assert not back.alike
    faster = run_of(force=FORCE[:29], speed=5.0)
    assert not BiasExtension([of_runs(run_of(force=FORCE[:29]), faster)]).alike


def test_forces_of_one_size_one_way_at_one_speed_know_a_curve_only(back):
    pull = run_of(force=FORCE[:29])
    test = BiasExtension([of_runs(pull, pull)])
    assert test.curves_only
    assert any("not which effect makes it" in note for note in test.notes)
    longer = run_of(force=FORCE[:29], length=250.0)
    for more in (run_of(force=FORCE[:29], speed=5.0), longer):
        assert not BiasExtension([of_runs(pull, more)]).curves_only
    assert not back.curves_only
    # Each laboratory's are on a curve of their own.
    assert BiasExtension([of_runs(pull), of_runs(longer)]).curves_only
    assert not BiasExtension([with_angles(of_runs(pull), every=1)]).curves_only


@pytest.mark.slow
def test_what_tells_friction_from_a_curve():
    """A way back does; the way out again, by whatever reads it, knows what it knew."""
    runs = of_runs(run_of(force=FORCE[:29]))
    test = BiasExtension([runs])
    (friction,) = (v for v in by(test, "crossover_friction") if v.label == "Coulomb with stick")
    (locking,) = (v for v in by(test, "shear_locking") if v.label == "power 2")
    at = VALUES | {p.name: 0.02 if p.amplitude else p.starts[0] for p in friction.parameters}
    read = replace(
        runs.runs[0], columns=runs.runs[0].columns | {"force_N": test.predict((friction,), at)[0]}
    )
    measurement = replace(runs, runs=(read,), noise=0.05)
    test = BiasExtension([measurement])
    known = Variances(Noise(0.05))
    fits = []
    for variant in (friction, locking):
        start = at | {p.name: 0.02 if p.amplitude else p.starts[0] for p in variant.parameters}
        fits.append(fit(test, (variant,), start, test.readings.fit, known))
    pair = ("crossover_friction", [fits[0]], "shear_locking", [fits[1]])
    solves = test._strips.count
    best = next_tests(test, kind_of("bias_extension"), [measurement], [pair], 0.05)
    assert all("unload" in one.proposal.label for one in best)
    assert best[0].separation > 3.0 and best[0].power > 0.9
    assert test._strips.count <= solves + 1


def by(test, name):
    return next(e for e in test.effects if e.name == name).variants


def test_strips_that_were_solved_serve_what_is_proposed():
    """The same strip, to the same place at the same speed, as was measured: no solve."""
    measurement = of_runs(run_of(force=FORCE[:29]))
    test = BiasExtension([measurement])
    before = len(test._strips.paths)
    again = BiasExtension([measurement], like=test)
    assert len(test._strips.paths) == before and again._strips.paths is test._strips.paths
    labels = [p.label for p in proposals([measurement])]
    for words in (
        "40 x 80 mm: pull by 14 mm at 10 mm/s, unload",
        "hold",
        "40 x 120 mm",
        "60 x 120",
    ):
        assert any(words in label for label in labels)
    assert sum("with a camera" in label for label in labels) == 1
    assert sum("a picture frame of 200 mm" in label for label in labels) == 1
    read = proposals([with_angles(measurement)])
    strips = [p for p in read if p.measurement.test == "bias_extension"]
    assert all("shear_angle_deg" in p.measurement.runs[0].columns for p in strips)
    assert all(p.measurement.besides == {"shear_angle_deg": 0.5} for p in strips)


def test_a_proposed_frame_has_the_laws_and_nothing_of_the_clamps():
    measurement = of_runs(run_of(force=FORCE[:29]))
    (proposal,) = [p for p in proposals([measurement]) if p.model is not None]
    frame, plain = (m([proposal.measurement]) for m in (OfTheFabric, PictureFrame))
    test = BiasExtension([measurement])
    (locking,) = (v for v in by(test, "shear_locking") if v.label == "power 2")
    others = [by(test, name)[0] for name in ("crossover_slip", "clamp_slip", "load_drift")]
    values = VALUES | {p.name: 0.2 for v in (locking, *others) for p in v.parameters}
    own = VALUES | {p.name: 0.2 for p in locking.parameters}
    force, slopes = frame.predict((locking, *others), values)
    assert np.array_equal(force, plain.predict((locking,), own)[0])
    assert all(not slopes[p.name].any() for v in others for p in v.parameters)


@dataclass(frozen=True)
class Bump(CrossingLaw):
    """A moment that rises and falls again: on no list."""

    size: Any = number("size", "largest")

    law = "bump"

    def moment(self, at):
        """M exp(-((γ - γ0)/w)²), less what it is at rest."""
        at_rest = np.exp(-((0.4 / 0.12) ** 2))
        return at.number(self.size) * (exp(-(((at.gamma - 0.4) / 0.12) ** 2)) - at_rest)


LAW = {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "dashpot_N_s_mm": 0.01}


def damaged(area):
    """Half of the elastic moment is lost where the angle has been beyond 0.36 rad."""
    numbers = {"shape": "step", "place": 0.45, "width": 0.08}
    elastic = {"k1": 0.02 * area, "k3": 0.2 * area}
    return ShapedLaw("elastic", "largest_angle", 0.8, (-0.5,), **numbers, **elastic)


def programmes(*laws):
    """Two strips loaded, unloaded and loaded again at two speeds, and a longer one, held out."""
    found = []
    for length, speed, held in ((80.0, 0.5, False), (100.0, 3.0, False), (120.0, 1.0, True)):
        way = 0.16 * length
        turns = corners(speed, 0.55 * way, 0.0, way, 0.0)
        found.append((length, pulled(length, *turns, law=LAW, laws=laws), held))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("laws", "share", "depends_on"),
    [
        ((damaged,), 0.004, "largest_angle"),
        ((lambda area: Bump(size=0.012 * area),), 0.01, "angle"),
    ],
    ids=["damage", "bump"],
)
def test_a_law_on_no_list_is_discovered(laws, share, depends_on):
    measurement, sigma = measured(programmes(*laws), share, seed=1)
    report = diagnose([measurement]).report
    assert report["verdict"] == "effect_discovered"
    (found,) = report["discovered"]
    assert found["acts_on"] == "moment"
    named = [found["depends_on"], *(rival.get("depends_on", []) for rival in found["rivals"])]
    assert any(depends_on in names for names in named)
    assert report["error"]["after"]["holdout"] < 1.25 * sigma < report["error"]["before"]["holdout"]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.015, 0.03])
def test_damage_that_looks_like_friction_is_named(share):
    """Friction that grows with the angle leaves noise as well: both names are there.

    And what would tell them apart. That damage is told from other terms is not asked for.
    """
    measurement, _ = measured(programmes(damaged), share, seed=1)
    report = diagnose([measurement]).report
    named = {effect["name"]: effect["rivals"] for effect in (*report["effects"], *report["beside"])}
    named |= {term["of"]: term["rival_names"] for term in report["discovered"]}
    (pair,) = ((name, *rivals) for name, rivals in named.items())
    assert {"crossover_friction", "elastic_moment_of_largest_angle"} <= {*pair}
    told = [t for t in report["next_tests"] if "crossover_friction" in t["effects"]]
    # A separation is in units of the noise: twice as large at half of it.
    assert told[0]["separation"] * share > 3.0 * 0.015 and "unload" in told[0]["do"]


@pytest.mark.slow
def test_in_an_empty_strip_nothing_is_found():
    strips = programmes()
    for seed in range(10):
        measurement, _ = measured(strips, (0.01, 0.02)[seed % 2], seed)
        report = diagnose([measurement]).report
        assert report["verdict"] == "no_effect", seed
