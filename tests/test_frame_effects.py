"""Effects that single readings carry, and those of each run: closed forms, diagnosed.

A crosshead goes to and fro at a constant speed between 0 and 60 mm; the frame follows it with play,
and the force is that of k1 γ + k3 γ³ + c1 γ̇ with the frame's own γ. In the gap the frame rests, so
that the readings just after a turn miss the dashpot's force.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fabric_fenicsx.loop.inference.beside import signed
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.picture_frame import PictureFrameRig
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

LENGTH, FABRIC, TRAVEL, SIGMA = 192.0, 96.0, 60.0, 0.02
K1, K3, C1 = 0.05, 0.2, 1.5
SPEEDS = (0.6, 2.0, 6.0)
COUNT = 160


def force(D, speed, c1=C1):
    """Crosshead force [N] of a frame at D [mm] that moves at a speed [mm/s]."""
    theta = np.arccos((D / LENGTH + np.sqrt(2.0)) / 2.0)
    gamma = np.pi / 2.0 - 2.0 * theta
    lever = LENGTH * np.sin(theta)
    m = K1 * gamma + K3 * gamma**3 + c1 * speed / lever
    return m * FABRIC**2 / lever


def followed(D, behind, ahead):
    """Where a frame is that trails by up to ``behind`` and runs ahead by up to ``ahead`` [mm]."""
    x = np.zeros_like(D)
    for i in range(1, len(D)):
        x[i] = min(max(x[i - 1], D[i] - behind), D[i] + ahead)
    return x


def in_a_gap(t, D, wide, c1):
    """Where a frame is with a gap on the side of no force: engaged if it is pulled or pushed.

    In small steps, whichever of the two makes the force that it takes; else as without any.
    """
    fine = np.linspace(0.0, t[-1], 20001)
    x, step = np.zeros_like(fine), fine[1]
    for i, place in enumerate(np.interp(fine[1:], t, D), 1):
        before = x[i - 1]
        if force(place - wide, (place - wide - before) / step, c1) > 0.0:
            x[i] = place - wide
        elif force(place, (place - before) / step, c1) < 0.0:
            x[i] = place
        else:
            # Less fast by as much as no force takes.
            one = force(before, 1.0, c1) - force(before, 0.0)
            x[i] = before - step * force(before, 0.0) / one
    return np.interp(t, fine, x)


def measured(follow=lambda t, D: D, added=lambda run, t: 0.0, spoil=(), noise=SIGMA, c1=C1):
    """Three runs of two cycles, the middle one held out, as a folder would be read."""
    rng = np.random.default_rng(11)
    runs = []
    for number, speed in enumerate(SPEEDS):
        t = np.linspace(0.0, 4.0 * TRAVEL / speed, COUNT + 1)[:-1]
        near = t[:, None] + [0.0, 1e-6 * t[-1]]
        D = TRAVEL * (1.0 - np.abs(1.0 - near * speed / TRAVEL % 2.0))
        # Beside each reading the next moment: its speed.
        order = np.argsort(near, axis=None)
        x = np.zeros(2 * COUNT)
        x[order] = follow(near.ravel()[order], D.ravel()[order])
        x = x.reshape(D.shape)
        rate = (x[:, 1] - x[:, 0]) / (near[:, 1] - near[:, 0])
        F = force(x[:, 0], rate, c1) + added(number, t)
        F += rng.normal(0.0, SIGMA, COUNT)
        F[list(spoil)] += 40.0 * SIGMA
        columns = {"time_s": t, "displacement_mm": D[:, 0], "force_N": F}
        runs.append(Run(f"{number}.csv", number == 1, "", columns))
    fabric = FabricKeys(areal_density_kg_m2=0.2)
    rig = PictureFrameRig(frame_length_mm=LENGTH, fabric_length_mm=FABRIC)
    return Measurement(Path("frame"), "picture_frame", "", fabric, rig, noise, tuple(runs))


#: Effects that zeros of runs are found among, and gaps.
OTHERS = ["load_drift", "crossover_friction", "tension_coupling", "crosshead_backlash"]


def diagnosed(**how):
    return diagnose_test(PictureFrame([measured(**how)]))


@pytest.mark.parametrize(
    ("form", "behind", "ahead"),
    [
        pytest.param("play", 0.5, 0.5, marks=pytest.mark.slow),
        pytest.param("play on the way out", 1.0, 0.0, marks=pytest.mark.slow),
        ("play on the way back", 0.0, 1.0),
    ],
)
def test_play_is_found_by_what_happens_at_the_turns(form, behind, ahead):
    found = diagnosed(follow=lambda t, D: followed(D, behind, ahead))
    assert [e.name for e in found.effects] == ["crosshead_backlash"]
    assert found.final.variants[0].label == form
    travel = found.final.values["free_travel_mm"]
    assert travel == pytest.approx(max(behind, ahead), abs=0.1)
    assert found.holdout_after < 1.15 * SIGMA
    # Without the play just these stand out as outliers would.
    assert not found.outliers.any()


def test_of_shearing_one_way_an_even_moment_has_an_odd_one_as_its_rival():
    """And its first power is the spring of the baseline; neither where the frame goes both ways."""
    out = measured()
    both = [
        replace(run, columns=run.columns | {"displacement_mm": run.columns["displacement_mm"] - 5})
        for run in out.runs
    ]
    rivals = {"tension_coupling", "odd_moment_of_angle"}
    for measurement, one_way in ((out, True), (replace(out, runs=tuple(both)), False)):
        test = PictureFrame([measurement])
        (even,) = (e for e in test.effects if e.name == "tension_coupling")
        first = [p for v in even.variants for p in v.parameters if p.name == "k_even1_N"]
        assert test.alike == (rivals if one_way else set())
        assert ("tension_coupling" in test.imitated) is one_way
        assert bool(first) is not one_way


GAP = {"wide": 2.9, "c1": 0.1 * C1}


@pytest.fixture(scope="module")
def with_a_gap():
    measurement = measured(follow=lambda t, D: in_a_gap(t, D, **GAP), c1=GAP["c1"])
    return PictureFrame([measurement])


def test_a_gap_is_on_the_side_that_the_force_leaves(with_a_gap):
    """The crosshead comes back by the gap where a dashpot makes the force change its sign."""
    (effect,) = (e for e in with_a_gap.effects if e.name == "crosshead_backlash")
    (form,) = (v for v in effect.variants if v.label == "gap that the force closes")
    values = {"k1_N": K1, "k3_N": K3, "c1_N_s": GAP["c1"], "free_travel_mm": GAP["wide"]}
    # Of a spring and a dashpot side by side: in the two slower runs the cubic part is next to
    # nothing where the force changes its sign, at 2 and 6 mm.
    expected, _ = with_a_gap.predict((form,), values | {"going_back_s": GAP["c1"] / K1})
    rows = with_a_gap.readings.usable & (with_a_gap.readings.run < 2)
    left = np.sqrt(np.mean((with_a_gap.readings.observed - expected)[rows] ** 2))
    assert left < 1.1 * SIGMA
    for label in ("free on the way out", "play on the way out"):
        (other,) = (v for v in effect.variants if v.label == label)
        far = (with_a_gap.readings.observed - with_a_gap.predict((other,), values)[0])[rows]
        assert np.sqrt(np.mean(far**2)) > 1.25 * left
    # One that is at rest again at once is a gap that only the place tells, but for the way there.
    at_once, _ = with_a_gap.predict((form,), values | {"going_back_s": 1e-6})
    (by_place,) = (v for v in effect.variants if v.label == "free on the way out")
    by_its_place, _ = with_a_gap.predict((by_place,), values)
    np.testing.assert_allclose(at_once[rows], by_its_place[rows], atol=0.02)


@pytest.mark.slow
def test_a_gap_that_the_force_closes_is_found(with_a_gap):
    found = diagnose_test(with_a_gap, OTHERS)
    assert [e.name for e in found.effects] == ["crosshead_backlash"]
    assert found.final.variants[0].label == "gap that the force closes"
    assert found.holdout_after < 1.15 * SIGMA < 1.5 * SIGMA < found.holdout_before
    values, std = found.final.values, found.final.errors
    assert values["free_travel_mm"] == pytest.approx(GAP["wide"], abs=0.3)
    assert abs(values["going_back_s"] - GAP["c1"] / K1) < 4.0 * std["going_back_s"]


@pytest.mark.slow
def test_outliers_are_left_out_beside_play():
    spoil = (37, 112)
    found = diagnosed(follow=lambda t, D: followed(D, 1.0, 0.0), spoil=spoil)
    assert [e.name for e in found.effects] == ["crosshead_backlash"]
    expected = [COUNT * run + k for run in range(3) for k in spoil]
    assert np.flatnonzero(found.outliers).tolist() == expected


def test_a_load_cell_of_each_run_without_a_held_out_run():
    offsets = (0.4, -0.2, 0.1)
    measurement = measured(added=lambda run, t: offsets[run])
    for run in measurement.runs:
        object.__setattr__(run, "holdout", False)
    found = diagnose_test(PictureFrame([measurement]), OTHERS)
    assert [e.name for e in found.effects] == ["load_drift"]
    assert found.holdout_source == "leave one run out"
    # The zero of the run that is left out is its own, or nothing could be said of it.
    assert found.holdout_after < 1.15 * SIGMA
    assert any("zero" in note for note in found.notes)
    for number, offset in enumerate(offsets, 1):
        values, std = found.final.values, found.final.errors
        assert abs(values[f"run{number}_offset_N"] - offset) < 4.0 * std[f"run{number}_offset_N"]


@pytest.mark.parametrize(
    ("zeros", "names"), [((0.3, -0.1, -0.2), []), ((0.3, 0.3, 0.3), ["load_drift"])]
)
def test_zeros_of_runs_about_nothing_are_noise_and_to_one_side_an_offset(zeros, names):
    found = diagnosed(added=lambda run, t: zeros[run])
    assert [e.name for e in found.effects] == names
    assert found.verdict == ("effect_found" if names else "no_effect")
    fitted = [zeros[0], zeros[2]]
    assert found.zeros == pytest.approx(0.0 if names else np.hypot(*fitted) / 2**0.5, abs=0.02)
    assert found.rivals.keys() == set(names)
    assert found.holdout_before > 3.0 * SIGMA
    assert found.holdout_after < 1.15 * SIGMA


def test_a_run_not_fitted_has_a_zero_of_its_own_where_the_fitted_one_hardly_has():
    # What drifts in one run may begin anywhere in another: its error tests the force's shape.
    lines = ((0.0, -0.02), (0.4, -0.015), (-0.3, 0.01))
    measurement = measured(added=lambda run, t: lines[run][0] + lines[run][1] * t)
    for number, run in enumerate(measurement.runs):
        object.__setattr__(run, "holdout", number > 0)
    found = diagnose_test(PictureFrame([measurement]), OTHERS)
    assert [e.name for e in found.effects] == ["load_drift"]
    assert [v.label for v in found.final.variants] == ["drift of each run"]
    assert found.holdout_before > 3.0 * SIGMA
    assert found.holdout_after < 1.15 * SIGMA


@pytest.mark.slow
def test_no_candidate_fits_worse_than_the_baseline():
    """With noise and specimens that differ as the candidate has them: these weigh the readings."""
    # Fits in which far readings count less need not come near them.
    found = diagnosed(added=lambda run, t: 0.5 * np.sin(t / 3.0))
    base = found.baseline
    for candidate in found.candidates:
        alone = fit(found.experiment, (), base.values, base.used, candidate.fit.variances)
        assert candidate.fit.sum_of_squares <= alone.sum_of_squares * (1.0 + 1e-9)


@pytest.fixture(scope="module")
def alone():
    """A test, its baseline, and that one's sensitivities to forms of all effects and terms."""
    test = PictureFrame([measured()])
    start = {p.name: p.starts[0] for p in test.baseline}
    base = fit(test, (), start, test.readings.fit, Variances(Noise(SIGMA)))
    every = signed(test, base, [*test.effects, *test.terms])
    return test, base, {v: own for forms in every.values() for v, own in forms.items()}


@pytest.mark.parametrize(
    ("names", "first"),
    [
        (("crossover_friction",), 0),
        (("viscous_moment_of_time", "reading_of_displacement"), 2),
        pytest.param(("reading_of_force",), 5, marks=pytest.mark.slow),
        (("travel_of_displacement",), 4),
    ],
)
def test_what_adds_alike_is_not_asked_for_again(alone, names, first):
    """Beside other effects it changes the readings as it did without, whatever numbers these have.

    What is said to add alike is compared with the model of both.
    """
    test, base, known = alone
    effects = [*test.effects, *test.terms]
    variants = tuple(next(e for e in effects if e.name == n).variants[0] for n in names)
    values = {name: 1.3 * value for name, value in base.values.items()}
    values |= {p.name: p.starts[0] if p.starts else 0.1 for v in variants for p in v.parameters}
    model = fit(test, variants, values, base.used, base.variances, evaluations=1)
    # Another share of them beside each.
    others = [e for e in effects if e.name not in names][first::6]
    reused, asked = signed(test, model, others, known), signed(test, model, others)
    rows, size = test.readings.fit, np.abs(model.expected).max()
    alike = 0
    for effect in others:
        for variant, own in asked[effect].items():
            alike += test.added_alike(variant, variants)
            assert len(reused[effect][variant]) == len(own)
            for mine, other in zip(reused[effect][variant], own, strict=True):
                assert mine.at == other.at
                assert mine.slopes.keys() == other.slopes.keys()
                expected = mine.expected[rows], other.expected[rows]
                assert np.allclose(*expected, rtol=0.0, atol=1e-9 * size)
                for name in other.slopes:
                    slopes = mine.slopes[name][rows], other.slopes[name][rows]
                    largest = np.abs(slopes[1]).max(initial=0.0)
                    assert np.allclose(*slopes, rtol=0.0, atol=1e-9 * largest)
    moves = any(not v.adds_up for v in variants)
    assert (alike == 0) == moves
    if not moves:
        assert alike > 20


def test_forms_that_are_unlikely_beside_a_model_are_not_asked_for(alone):
    """Where the model changes what they add; what is not known beforehand always is."""
    test, base, known = alone
    effects = [*test.effects, *test.terms]
    moved = next(e for e in effects if e.name == "travel_of_displacement").variants[0]
    values = base.values | {p.name: 0.1 for p in moved.parameters}
    model = fit(test, (moved,), values, base.used, base.variances, evaluations=1)
    others = [e for e in effects if e.name != "travel_of_displacement"][::3]
    unknown = others[0].variants[0]
    known = {v: own for v, own in known.items() if v is not unknown}
    taken = set()

    def likely(every):
        first = every[:: len(every) // 5]
        taken.update(v for ((v, _),) in first)
        return first

    whole, some = signed(test, model, others, known), signed(test, model, others, known, likely)
    left_out, rows = 0, test.readings.fit
    for effect in others:
        for variant, own in whole[effect].items():
            mine = some[effect][variant]
            begins = not any(one.little(variant) for one in own)
            if variant in taken or variant is unknown or begins:
                assert [one.at for one in mine] == [one.at for one in own]
                for a, b in zip(mine, own, strict=True):
                    assert np.array_equal(a.expected[rows], b.expected[rows])
            else:
                assert mine == []
                left_out += 1
    assert len(taken) >= 5 and left_out > 20
