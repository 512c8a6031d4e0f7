"""Strips and picture frames of one made-up fabric: the locking is shared, the tension is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from fabric_fenicsx import diagnose
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.bias_extension import BiasExtensionRig
from fabric_fenicsx.loop.kinds.bias_extension.centred import CentredBiasExtension
from fabric_fenicsx.loop.kinds.bias_extension.curves import KNOTS, Curve
from fabric_fenicsx.loop.kinds.bias_extension.frame_law import FRAME_SHARE, foretold, in_thirds
from fabric_fenicsx.loop.kinds.bias_extension.settling import LEFT, ROUGH, ROUNDS, Settling
from fabric_fenicsx.loop.kinds.bias_extension.strip import solved_strip, strip_case
from fabric_fenicsx.loop.kinds.bias_extension.with_frames import (
    held,
    shared_locking,
    way_out,
    weights_of,
)
from fabric_fenicsx.loop.kinds.picture_frame import PictureFrameRig
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

GAMMA = np.radians(KNOTS)
FABRIC = FabricKeys(areal_density_kg_m2=0.3, tow_spacing_mm=5.0)
WIDTH, TRAVEL = 40.0, 17.0
FRAME, INSIDE = 200.0, 150.0


def locks(gamma):
    """The fabric's own locking [N/mm]."""
    return 2.0 * np.maximum(gamma - 0.35, 0.0) ** 2


def frame(size=1.0, largest=0.95, count=60):
    """A frame whose clamps add tension to all but the locking of the fabric."""
    gamma = np.linspace(0.0, largest, count)
    moment = 0.03 * np.tanh(gamma / 0.02) + 0.05 * gamma + size * locks(gamma)
    theta = np.pi / 4.0 - gamma / 2.0
    D = FRAME * (2.0 * np.cos(theta) - np.sqrt(2.0))
    force = moment * INSIDE**2 / (FRAME * np.sin(theta))
    columns = {"time_s": D / 0.5, "displacement_mm": D, "force_N": force}
    rig = PictureFrameRig(frame_length_mm=FRAME, fabric_length_mm=INSIDE)
    run = Run("run.csv", False, "", columns)
    return Measurement(Path(), "picture_frame", "", FABRIC, rig, 0.01, (run,))


def strips(changes, lengths=(80.0, 100.0), noise=0.02, seed=1, sizes=None):
    """Strips of the fabric without the frame's tension, and the angles of their middle at last.

    With sizes, of specimens whose own law at small angles is so many times that of others.
    """
    rng = np.random.default_rng(seed)
    runs, angles = [], []
    for number, length in enumerate(lengths):
        size = 1.0 if sizes is None else sizes[number]
        own_law = size * (0.01 * np.tanh(GAMMA / 0.02) + 0.02 * GAMMA)
        law = Curve.through(own_law + locks(GAMMA))
        D = np.linspace(0.0, TRAVEL * (length - WIDTH) / WIDTH, 35)
        own = {"length_mm": length, "width_mm": WIDTH}
        columns = {"time_s": D, "displacement_mm": D, "force_N": np.zeros_like(D)}
        specimen = "A" if sizes is None else f"{number}"
        run = Run("run.csv", False, f"{length:g}", columns, own=own, specimen=specimen)
        whole = Measurement(Path(), "bias_extension", "", FABRIC, BiasExtensionRig(), noise, (run,))
        path = solved_strip(strip_case(whole, run, float(D[-1]), 1.0, changes, steps=56), law)
        columns["force_N"] = PchipInterpolator(path.travel, path.force)(D)
        columns["force_N"] += noise * rng.normal(size=len(D))
        runs.append(run)
        angles.append(np.degrees(path.middle[-1]))
    return replace(whole, runs=tuple(runs)), angles


def test_the_tension_of_a_frame_is_no_part_of_what_is_shared():
    (curve,) = way_out(PictureFrame([frame()]))
    known = shared_locking([curve])
    inside = curve[0][-1] >= GAMMA
    assert known.moment[GAMMA < 0.35].max() < 0.01 * known.moment[inside][-1]
    assert known.moment[inside][-1] == pytest.approx(locks(GAMMA[inside][-1]), rel=0.05)
    assert 0.3 < known.onset < 0.6
    # Of one laboratory nobody knows what others would find.
    assert known.shares == (1.0,) and known.least < 1.0 < known.most


def test_laboratories_say_how_much_of_it_is_known():
    """Those that do not get far enough say nothing; the shape is that of those that get there."""
    sizes = (0.5, 1.0, 1.5)
    curves = [
        way_out(PictureFrame([frame(size, end)]))[0]
        for size, end in zip((*sizes, 1.0), (0.8, 0.95, 0.7, 0.4), strict=True)
    ]
    known = shared_locking(curves)
    assert np.isnan(known.shares[3])
    assert known.shares[:3] == pytest.approx(sizes, rel=0.05)
    scatter = np.std(known.shares[:3], ddof=1)
    assert (known.least, known.most) == pytest.approx((1.0 - scatter, 1.0 + scatter))
    one = shared_locking([curves[1]])
    assert known.moment == pytest.approx(one.moment, abs=0.05 * one.moment[-1])
    (share,) = held(known).parameters
    assert (share.lower, share.upper) == (known.least, known.most)


def test_a_frame_that_does_not_lock_shares_nothing():
    gamma = np.linspace(0.0, 1.0, 40)
    assert shared_locking([(gamma, 0.3 * np.tanh(gamma))]) is None


def test_what_was_foretold_is_told_by_thirds():
    D = np.linspace(0.0, 9.0, 91)
    observed = np.full_like(D, 2.0)
    expected = np.where(D < 3.0, 8.0, np.where(D < 6.0, 2.0, 1.0))
    found = foretold(expected, observed, D, np.full_like(D, 9.0))
    assert [found[name] for name in ("early", "middle", "late")] == pytest.approx([4.0, 1.0, 0.5])
    assert in_thirds(found).endswith("N rms, 4, 1, 0.5 times the force in the thirds of the travel")


def test_a_model_that_was_settled_is_right_with_its_derivatives():
    """Forces, and their differences, against strips that were solved with all that it has."""
    measured, _ = strips({}, lengths=(80.0,))
    test = CentredBiasExtension([measured])
    effects = {e.name: e for e in test.effects}
    slip = effects["crossover_slip"].variants[0]
    soft = next(v for v in effects["tow_uncrimping"].variants if v.label == "soft throughout")
    forms = (slip, soft)
    values = {"k1_N": 0.05, "k3_N": 1.0, "c1_N_s": 0.0}
    values |= {slip.parameters[0].name: 0.8, soft.parameters[0].name: 0.03}
    test.settle(forms, values)
    force, slopes = test.predict(forms, values)
    (run,) = measured.runs
    D = run.columns["displacement_mm"]

    def exact(values):
        curve = Curve.through(values["k1_N"] * GAMMA + values["k3_N"] * GAMMA**3)
        changes = {n: c for v in forms for n, c in v.changes(values[v.parameters[0].name]).items()}
        path = solved_strip(strip_case(measured, run, float(D[-1]), 1.0, changes, 48), curve)
        return PchipInterpolator(path.travel, path.force)(D)

    there = exact(values)
    assert force == pytest.approx(there, abs=0.01 * there.max())
    for name in ("k3_N", *(v.parameters[0].name for v in forms)):
        # Each crossing that slips is a corner of the curve: differences must be wide ones.
        up, down = (exact(values | {name: values[name] * factor}) for factor in (1.1, 0.9))
        off = 0.2 * values[name] * slopes[name] - (up - down)
        assert np.linalg.norm(off) < 0.15 * np.linalg.norm(up - down)


def test_derivatives_of_a_law_with_a_dashpot_are_taken_over_differences():
    """A dashpot has no energy that angles would make least: as they were they do not suffice."""
    measured, _ = strips({}, lengths=(80.0,))
    test = CentredBiasExtension([measured])
    values = {"k1_N": 0.005, "k3_N": 1.0, "c1_N_s": 0.5}
    steps = {name: 0.05 * value for name, value in values.items()}
    test.settle((), values, steps=steps)
    force, slopes = test.predict((), values)
    for name, step in steps.items():
        # Half as far the model is solved as well.
        moved = {**values, name: values[name] + 0.5 * step}
        test.settle((), moved, steps=None)
        change = test.predict((), moved)[0] - force
        off = np.linalg.norm(0.5 * step * slopes[name] - change)
        assert off < 0.01 * np.linalg.norm(change)
    test.settle((), values)
    _, with_angles_as_they_were = test.predict((), values)
    off = with_angles_as_they_were["c1_N_s"] - slopes["c1_N_s"]
    assert np.linalg.norm(off) > 0.03 * np.linalg.norm(slopes["c1_N_s"])


@pytest.mark.slow
def test_fits_with_the_locking_of_frames_end_where_nothing_moves():
    """From two starts at the same place, at which every way off makes the residual larger."""
    measured, _ = strips({"tow.stiffness.stretch_N_mm": 25.0}, sizes=(1.0, 1.2))
    form = held(shared_locking([way_out(PictureFrame([frame(s)]))[0] for s in (1.3, 0.8)]))
    test = CentredBiasExtension([measured])
    effects = {e.name: e for e in test.effects}
    soft = next(v for v in effects["tow_uncrimping"].variants if v.label == "soft throughout")
    (compliance,) = (p.name for p in soft.parameters)
    rows, judge = test.readings.fit, Judge(test, list(test.effects))
    first = Variances(Noise(0.1), {"k1_N": 0.1, "c1_N_s": 0.1, compliance: 0.1})
    ends = []
    for start in (0.02, 0.1):
        search = Settling(test, (form, soft), rows, first, judge)
        values = {"k1_N": 0.02, "k3_N": 0.0, "c1_N_s": 0.0, FRAME_SHARE: 1.0, compliance: start}
        ends.append(search.from_there(search.at(values, {})))
    for found in ends:
        # Within LEFT, or where no way ahead makes the residual smaller and little is left.
        assert found.fit.converged and found.rounds[-1].left <= ROUGH
        assert found.rounds[0].left > LEFT
        assert len(found.rounds) < ROUNDS
    one, other = (found.fit for found in ends)
    free = [name for name in one.values if name not in one.at_bound]
    assert compliance in free
    for name in free:
        assert abs(one.values[name] - other.values[name]) < 3.0 * LEFT * one.errors[name]
    there = Settling(test, (form, soft), rows, one.variances)
    for name in free:
        for way in (-1.0, 1.0):
            moved = one.values | {name: one.values[name] + way * one.errors[name]}
            assert there.at(moved, one.deviations).sum_of_squares > one.sum_of_squares


def test_a_model_weighs_by_what_it_foretells_of_strips():
    assert weights_of(np.array([1.0, 2.0, np.nan]), 2) == pytest.approx([0.8, 0.2, 0.0])
    assert weights_of(np.array([3.0, 3.0]), 5) == pytest.approx([0.5, 0.5])


@pytest.mark.slow
def test_the_middle_of_soft_strips_is_found_with_frames(tmp_path):
    """The truth is among the models that are kept, and the angles of the best are its own."""
    true = "tow_uncrimping"
    measured, angles = strips({"tow.stiffness.stretch_N_mm": 25.0})
    found = diagnose(
        [frame(1.3), frame(0.8), measured],
        tmp_path,
        effects=("shear_locking", "crossover_slip", "tow_uncrimping"),
    )
    d = found.diagnoses[-1]
    kept = [model for model in d.joined if model.kept]
    assert true in [e.name for model in kept for e in model.effects]
    assert FRAME_SHARE in kept[0].fit.values
    names = [d.experiment.readings.names[run] for run in range(len(angles))]
    # With the locking of the frames nearer than strips alone know them, by any one of the effects.
    off = [abs(kept[0].middle[name] - angle) for name, angle in zip(names, angles, strict=True)]
    assert max(off) < 1.0
    for candidate in d.candidates:
        alone = d.experiment.middle_angle(candidate.fit.variants, candidate.fit.values)
        for run, angle in enumerate(angles):
            rows = d.experiment.readings.run == run
            assert abs(alone[rows][-1] - angle) > off[run]
    pinned = next(model for model in d.joined if not model.effects)
    assert not pinned.kept
    assert min(pinned.middle[name] - angle for name, angle in zip(names, angles, strict=True)) > 1.0
    assert (tmp_path / f"fabric_with_frames_{true}.yaml").exists()
    assert any("beyond" in note for note in found.report["notes"])
    assert [m["kept"] for m in found.report["joined"]] == [m.kept for m in d.joined]
    assert sum(m["weight"] for m in found.report["joined"]) == pytest.approx(1.0)
