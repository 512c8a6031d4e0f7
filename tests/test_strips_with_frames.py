"""Strips and picture frames of one made-up fabric: the locking is shared, the tension is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from fabric_fenicsx import diagnose
from fabric_fenicsx.loop.kinds.bias_extension import BiasExtensionRig
from fabric_fenicsx.loop.kinds.bias_extension.frame_law import foretold, in_thirds
from fabric_fenicsx.loop.kinds.bias_extension.strip import KNOTS, Curve, solved_strip, strip_case
from fabric_fenicsx.loop.kinds.bias_extension.with_frames import (
    held,
    shared_locking,
    way_out,
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


def strips(changes, lengths=(80.0, 100.0), noise=0.02, seed=1):
    """Strips of the fabric without the frame's tension, and the angles of their middle at last."""
    rng = np.random.default_rng(seed)
    law = Curve.through(0.01 * np.tanh(GAMMA / 0.02) + 0.02 * GAMMA + locks(GAMMA))
    runs, angles = [], []
    for length in lengths:
        D = np.linspace(0.0, TRAVEL * (length - WIDTH) / WIDTH, 35)
        own = {"length_mm": length, "width_mm": WIDTH}
        columns = {"time_s": D, "displacement_mm": D, "force_N": np.zeros_like(D)}
        run = Run("run.csv", False, f"{length:g}", columns, own=own, specimen="A")
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
    inside = curve[-1][0] >= GAMMA if np.ndim(curve[-1][0]) else GAMMA <= curve[0][-1]
    # Less its least secant stiffness, that of the place where locking is about to outgrow it.
    assert known.moment[GAMMA < 0.35].max() < 0.01 * known.moment[inside][-1]
    assert known.moment[inside][-1] == pytest.approx(locks(GAMMA[inside][-1]), rel=0.15)
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
    assert known.shares[:3] == pytest.approx(sizes, rel=0.15)
    assert (known.least, known.most) == (min(known.shares[:3]), max(known.shares[:3]))
    one = shared_locking([curves[1]])
    assert known.moment == pytest.approx(one.moment, abs=0.1 * one.moment[-1])
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "true"),
    [
        ({"tow.stiffness.stretch_N_mm": 25.0}, "tow_uncrimping"),
        ({"crossover.slip_limit_N": 0.35, "crossover.translation_N_mm": 10.0}, "crossover_slip"),
    ],
)
def test_the_middle_of_strips_is_found_with_frames(changes, true, tmp_path):
    """The truth is among the models that are kept, and the span of these holds its angles."""
    measured, angles = strips(changes)
    found = diagnose(
        [frame(1.3), frame(0.8), measured],
        tmp_path,
        effects=("shear_locking", "crossover_slip", "tow_uncrimping"),
    )
    d = found.diagnoses[-1]
    kept = [model for model in d.joined if model.kept]
    assert true in [e.name for model in kept for e in model.effects]
    pinned = next(model for model in d.joined if not model.effects)
    assert not pinned.kept
    for run, angle in enumerate(angles):
        name = d.experiment.readings.names[run]
        of_models = [model.middle[name] for model in kept]
        assert min(of_models) - 1.0 < angle < max(of_models) + 1.0
        # A net that is pinned overpredicts it.
        assert pinned.middle[name] > angle + 1.0
    assert (tmp_path / f"fabric_with_frames_{true}.yaml").exists()
    assert any("beyond" in note for note in found.report["notes"])
    assert [m["kept"] for m in found.report["joined"]] == [m.kept for m in d.joined]
