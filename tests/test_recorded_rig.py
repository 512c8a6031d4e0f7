"""What a crosshead's record tells of its motion."""

import numpy as np
import pytest

from fabric_fenicsx.loop.kinds.picture_frame.motion import crosshead_motion
from fabric_fenicsx.loop.kinds.recorded_rig import RecordedRig


def from_rest(t):
    """To and fro by 40 mm, from its turn: with the largest acceleration at once [mm, mm/s²]."""
    omega = 2.0 * np.pi / 5.0
    return 20.0 * (1.0 - np.cos(omega * t)), 20.0 * omega**2 * np.cos(omega * t)


def at_speed(t):
    """The same from the middle, where it is fastest."""
    omega = 2.0 * np.pi / 5.0
    return 20.0 * np.sin(omega * t), -20.0 * omega**2 * np.sin(omega * t)


@pytest.mark.parametrize("motion", [from_rest, at_speed])
def test_accelerations_are_of_second_order_to_the_ends(motion):
    off = []
    for count in (101, 201, 401):
        t = np.linspace(0.0, 7.0, count)
        D, exact = motion(t)
        rig = RecordedRig([crosshead_motion(t, D)], {})
        found = rig.at_readings(rig.acceleration.value)
        off.append(np.abs(found - exact).max() / np.abs(exact).max())
    orders = np.log2(np.array(off[:-1]) / off[1:])
    assert off[0] < 0.03
    np.testing.assert_array_less(1.8, orders)


def test_what_goes_at_one_speed_has_no_acceleration():
    t = np.linspace(0.0, 10.0, 51)
    rig = RecordedRig([crosshead_motion(t, 2.0 * t)], {})
    np.testing.assert_allclose(rig.acceleration.value, 0.0, atol=1e-9)
