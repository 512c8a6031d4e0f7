"""Every law of a crossing that there is: alone against itself, twice at a crossing, in a frame.

Laws are found by listing their folder; so is what is tested here. The numbers of a law are made
from its keys in a case, so that a new one is tested as soon as it is there.
"""

import pickle
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from solve import GivenSection, Statics, plain_net
from test_picture_frame_net import SECTION, axes, axes_rate
from test_shear_laws import STIFF, cross, evaluated, moments, number
from ufl import as_ufl

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.inputs.keys import documented
from fabric_fenicsx.loop.kinds.picture_frame import PictureFrameRig
from fabric_fenicsx.loop.kinds.picture_frame.effects import PICTURE_FRAME_EFFECTS
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.kinds.picture_frame.variant import FrameVariant
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.mechanics.laws import LAWS
from fabric_fenicsx.mechanics.laws.law import Crossing, CrossingLaw, per_area
from fabric_fenicsx.mechanics.laws.shaped import ShapedLaw
from fabric_fenicsx.rigs.cases import CrossoverKeys
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.simulation import simulate
from fabric_fenicsx.rigs.write_case import case_text, template
from fabric_fenicsx.solving.history import Histories
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw
from fabric_fenicsx.solving.stepping import StepControl
from fabric_fenicsx.solving.system import System

AREA = 144.0

#: Values of a case whose numbers go together, or that would be too stiff at their defaults.
TOGETHER: dict[str, dict[str, Any]] = {
    "compaction": {"width_mm": 1.6, "spacing_mm": 1.7, "weft_spacing_mm": 1.8},
    "tabulated_spring": {"angles_deg": [0, 9, 20, 30], "moments_N_mm": [0, 0.01, 0.02, 0.06]},
    "tabulated_dashpot": {"rates_rad_s": [0, 0.01, 0.1], "moments_N_mm": [0, 0.01, 0.04]},
    "lagging": {
        "coefficients_N_mm": [0.02, 0.01],
        "reach": 0.6,
        "shape": "spline",
        "even": False,
        "memory_s": 20.0,
        "pulls": 0,
        "by": "angle",
    },
    "sliding_friction": {"rounding_rad_s": 1e-3},
    "coulomb_friction": {"growth_1_rad": 0},
    "shaped": {
        "base": "elastic",
        "variable": "largest_angle",
        "reach": 0.6,
        "coefficients": [0.5, -0.2],
        "constant": 0.3,
        "shape": "spline",
        "also_reach": 1.0,
        "powers": [],
        "constants": [],
    },
}
#: Other values, by the ends of their keys; they are of the order of those of fabrics.
BY_UNIT = {"deg": 10.0, "rad_s": 0.02, "N_s_mm": 1.0, "N_mm": 0.02, "N_mm2": 0.1, "_s": 5.0}


def sample(law: str, factor: float = 1.0) -> dict[str, Any]:
    """Values of a case for a law; a factor makes another law of the kind of it."""
    values: dict[str, Any] = {"law": law, **TOGETHER.get(law, {})}
    for one in LAWS[law].numbers().values():
        ends = [end for end in BY_UNIT if one.key.endswith(end)]
        if one.key not in values and one.default is not None:
            values[one.key] = factor * BY_UNIT[ends[0]] if ends else 2
    return values


def built(law: str, factor: float = 1.0, area: float = AREA) -> CrossingLaw:
    """The law of a crossing of a case with these values."""
    return keys_of(sample(law, factor)).build(area)


def keys_of(values: dict[str, Any]) -> Any:
    """The keys of a law in a case."""
    (keys,) = CrossoverKeys.model_validate({"laws": [values]}).laws
    return keys


def is_elastic(law: CrossingLaw) -> bool:
    at = crossing(0.3)
    return not law.history(at) and law.energy(at.gamma, {}, number) is not None


def crossing(gamma: float, gamma_n: float = 0.0, memory: dict | None = None, per_time=1.0):
    past = memory or {}
    return Crossing(
        gamma=as_ufl(float(gamma)),
        gamma_n=as_ufl(float(gamma_n)),
        per_time=as_ufl(float(per_time)),
        number=number,
        past=lambda name: as_ufl(past.get(name, 0.0)),
    )


every_law = pytest.mark.parametrize("law", LAWS)
ELASTIC = [law for law in LAWS if is_elastic(built(law))]
REMEMBERING = [law for law in LAWS if built(law).history(crossing(0.3))]
#: What a law acts on, for an area of one, where others are looked at: a form takes long to compile
#: and has all of a sort in it.
TINY = 1e-9

# Alone --------------------------------------------------------------------------------------------


def test_what_is_elastic_and_what_remembers():
    assert {"polynomial_spring", "tabulated_spring", "even_spring", "locking"} < set(ELASTIC)
    assert {"smooth_locking", "exponential_locking", "compaction"} < set(ELASTIC)
    assert {"coulomb_friction", "dahl_friction", "maxwell"} <= set(REMEMBERING)
    assert not {*ELASTIC, *REMEMBERING} & {"linear_dashpot", "sliding_friction"}


@pytest.mark.parametrize("law", ELASTIC)
@pytest.mark.parametrize("gamma", [-0.9, -0.1, 0.05, 0.35, 1.1])
def test_stored_energy_is_the_work_of_the_moment(law, gamma):
    one = built(law)
    kinks = [s * np.radians(a) for s in (-1, 1) for a in (9, 10, 20, 30)]
    kinks += [s * np.arccos(1.6 / p) for s in (-1, 1) for p in (1.7, 1.8)]
    work = quad(lambda g: moments(one, [g])[0], 0.0, gamma, points=kinks, limit=200)[0]
    stored = evaluated(one.energy(as_ufl(gamma), {}, number))
    assert stored == pytest.approx(work, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("cubic", "flow"), [(0.0, 0.0), (1e-3, 0.0), (2.0, 0.0), (50.0, 0.0), (0.0, 0.1), (2.0, 0.1)]
)
def test_energy_of_a_relaxing_branch(cubic, flow):
    """Loaded at once and let go at once it is elastic; on any path its dashpot only loses.

    At once, M = k (γ + c γ³): ψ = k (γ²/2 + c γ⁴/4).
    """
    law = LAWS["maxwell"](3.0, 5.0, cubic, flow)
    gamma = 0.6
    at = crossing(gamma, per_time=1e9)
    stored, _ = law.energy_and_loss(at, law.moment(at))
    expected = 3.0 * (gamma**2 / 2 + cubic * gamma**4 / 4)
    assert evaluated(stored) == pytest.approx(expected, rel=1e-6)
    memory, before, energies, lost = {}, 0.0, [0.0], []
    for gamma in 0.5 * np.sin(np.linspace(0.0, 20.0, 801)[1:]):
        at = crossing(gamma, before, memory, 10.0)
        stored, loss = (evaluated(part) for part in law.energy_and_loss(at, law.moment(at)))
        energies.append(stored)
        lost.append(loss)
        memory = {name: evaluated(value) for name, value in law.history(at).items()}
        before = gamma
    assert min(energies) > -1e-12
    # The sum with the force at the end is off by half the square of a step.
    assert min(lost) > -3.0 * 0.5 * (1.0 + 3.0 * cubic * 0.25) * 0.0125**2


# Twice at a crossing ------------------------------------------------------------------------------


@dataclass
class Driven:
    """What a crossing went through: per step angle, moment, and the columns of steps.csv."""

    gamma: np.ndarray
    moment: np.ndarray
    rows: list[dict[str, float]]

    def column(self, name):
        return np.array([row[name] for row in self.rows])


def driven(laws, gammas, length=1.0, **weights):
    """One crossing of stiff tows whose four ends are turned affinely, in equal steps."""
    net = cross()
    ends = net.ends.ravel()
    X = net.points[ends]
    path = np.concatenate([[0.0], gammas])
    times = length * np.arange(len(path))
    model = Model(
        net,
        STIFF,
        crossovers=CrossoverLaw(100.0, 0.0, 0.0, 0.0, 1000.0, laws=tuple(laws)),
        supports=[
            Support(
                ends,
                (0, 1, 2),
                lambda time: (
                    np.c_[X[:, :2] @ axes(np.interp(time, times, path))[:, :2], X[:, 2]] - X
                ),
            ),
            Support(np.arange(6), (2, 3, 4)),
        ],
        **weights,
    )
    with TemporaryDirectory() as folder:
        run = simulate(
            model,
            Path(folder),
            test="frame",
            end=float(times[-1]),
            control=StepControl(first=length, smallest=length / 2.0, largest=length),
            force_tolerance=1e-6,
            measure=lambda seen: {
                "angle": seen.director_turn[0],
                "moment": seen.crossing_moment[0],
            },
        )
    assert run.completed and len(run.rows) == len(gammas), run.stop
    gamma, moment = (np.array([row[key] for row in run.rows]) for key in ("angle", "moment"))
    return Driven(gamma, moment, run.rows)


CLOSED = np.array([0.2, 0.5, 0.5, 0.3, -0.1, -0.4, -0.2, 0.0])


def two_of(law, area=AREA):
    """A law and another one of its kind, beside next to nothing of the others of its sort."""
    sort = [other for other in LAWS if (other in ELASTIC) == (law in ELASTIC)]
    sizes = {other: area if other == law else TINY * area for other in sort}
    return [built(other, factor, sizes[other]) for other in sort for factor in (1.0, 1.5)]


@cache
def twice(law):
    return driven(two_of(law), CLOSED)


@every_law
def test_two_of_a_kind_are_two(law):
    """Each has its own memory: the moments are those of two crossings that have one each."""
    seen = twice(law)
    np.testing.assert_allclose(seen.gamma, CLOSED, atol=1e-3)
    apart = sum(moments(built(law, factor), seen.gamma) for factor in (1.0, 1.5))
    assert np.abs(apart).max() > 0.1
    np.testing.assert_allclose(seen.moment, apart, rtol=1e-6, atol=1e-6)


@pytest.mark.mpi
def test_two_branches_in_a_hold():
    """Two branches of 1 s and 20 s: Σ k r τ (1 − e^(−t/τ)) e^(−hold/τ)."""
    taus, k, rate, time = np.array([1.0, 20.0]), 10.0, 0.05, 4.0
    laws = [LAWS["maxwell"](k, tau) for tau in taus]
    load = rate * np.arange(1.0, time + 1.0)
    seen = driven(laws, [*load, *np.full(3, load[-1])])
    peak = k * rate * taus * (1.0 - np.exp(-time / taus))
    assert seen.moment[3] == pytest.approx(peak.sum(), rel=1e-3)
    assert seen.moment[-1] == pytest.approx((peak * np.exp(-3.0 / taus)).sum(), rel=1e-3)


@pytest.mark.mpi
def test_energies_of_two_of_a_kind_stand_apart():
    seen = twice("coulomb_friction")
    names = [f"energy_Coulomb_friction{end}_N_mm" for end in ("", "_2")]
    # Slid through, each keeps m_c γ_s/2 of its own.
    expected = [0.02 * AREA * np.radians(10.0) / 2.0 * factor**2 for factor in (1.0, 1.5)]
    assert [seen.rows[1][name] for name in names] == pytest.approx(expected, rel=1e-6)


@pytest.mark.mpi
def test_a_name_stands_once():
    class Same(LAWS["linear_dashpot"]):
        name = "Coulomb friction 2"

    with pytest.raises(ValueError, match="Coulomb friction 2: a term that is twice"):
        driven((built("coulomb_friction"), built("coulomb_friction"), Same(1.0)), [0.1])
    model = Model(cross(), STIFF, crossovers=CrossoverLaw(1.0, 1.0, 1.0, 1.0, 1.0))
    histories = Histories(model.disc)
    values = np.zeros(3)
    histories.add_numbers("height", values)
    with pytest.raises(ValueError, match="height: remembered twice"):
        histories.add_numbers("height", values)
    with pytest.raises(ValueError, match="height: remembered twice"):
        histories.add("height", "crossings", None, None)
    with pytest.raises(ValueError, match="tows: a term that is twice"):
        System(model.disc, [model.system.terms[0]] * 2)


# Energy -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", ELASTIC)
def test_elastic_laws_lose_nothing_on_a_closed_path(law):
    seen = twice(law)
    assert np.abs(seen.column("lost_N_mm")).max() == 0.0
    stored = seen.column(f"energy_{LAWS[law].name.replace(' ', '_')}_2_N_mm")
    if law == "polynomial_spring":
        stored = seen.column("energy_rotational_spring_3_N_mm")
    expected = [evaluated(built(law, 1.5).energy(as_ufl(g), {}, number)) for g in seen.gamma]
    np.testing.assert_allclose(stored, expected, rtol=1e-6, atol=1e-9)
    assert abs(stored[-1]) < 1e-6 < np.abs(stored).max()


@pytest.mark.parametrize("law", [law for law in LAWS if law not in ELASTIC])
def test_the_others_lose_what_their_loop_encloses(law):
    """∮ M dγ, by the balance's sum: the moment at the end of a step times its change."""
    seen = twice(law)
    own = [moments(built(law, factor), seen.gamma) for factor in (1.0, 1.5)]
    change = np.diff(seen.gamma, prepend=0.0)
    names = [
        name
        for name in seen.rows[0]
        if name.startswith(f"energy_{LAWS[law].name}".replace(" ", "_"))
    ]
    nothing = defaultdict(lambda: as_ufl(0.0))
    stores = built(law).energy(as_ufl(0.1), nothing, number) is not None
    stored = sum(seen.column(name) for name in names) if stores else 0.0
    assert len(names) == (2 if stores else 0) and (not stores or law in REMEMBERING)
    expected = np.cumsum(sum(own) * change) - stored
    np.testing.assert_allclose(seen.column("lost_N_mm"), expected, rtol=1e-5, atol=1e-5)


def test_the_balance_closes_with_every_law_at_once():
    """What is left is the error of sums over steps: a quarter in steps of a quarter (order 1)."""
    laws = [built(law) for law in LAWS]
    left = []
    for parts in (4, 16):
        path = np.interp(
            np.arange(1, 6 * parts + 1) / parts,
            np.arange(7),
            0.5 * np.array([0, 0.5, 1, 0.4, -0.5, -0.2, 0]),
        )
        seen = driven(laws, path, 1.0 / parts)
        assert seen.column("lost_N_mm")[-1] > 1.0
        left.append(abs(seen.column("remainder_N_mm")).max())
    assert left[1] == pytest.approx(left[0] / 4.0, rel=0.3)


# Weaves -------------------------------------------------------------------------------------------


def test_what_is_due_to_floats():
    """Not what neighbours do that meet side by side, nor the clamps of a rig; all else is."""
    beside = {"locking", "smooth_locking", "exponential_locking", "compaction", "even_spring"}
    due = {"polynomial_spring", "tabulated_spring", "maxwell", "linear_dashpot", "power_dashpot"}
    due |= {"eyring_dashpot", "tabulated_dashpot", "coulomb_friction", "dahl_friction"}
    assert not any(LAWS[law].interlaced for law in beside)
    assert all(LAWS[law].interlaced for law in due | {"sliding_friction"})


@every_law
def test_a_twill_floats(law):
    """In a 2/2 twill half of the neighbours lie on the other side; locking does not mind."""
    # Half the interlacing, at a crossing that stands for three times as much as it is built for.
    weights = {"interlacing": np.full(1, 0.5 * 3.0), "patch": np.full(1, 3.0)}
    twill = driven(two_of(law), CLOSED[:3], **weights)
    share = 1.5 if LAWS[law].interlaced else 3.0
    apart = sum(moments(built(law, factor), twill.gamma) for factor in (1.0, 1.5))
    np.testing.assert_allclose(twill.moment, share * apart, rtol=1e-6, atol=1e-6)


# In a picture frame -------------------------------------------------------------------------------

N, SPACING, LENGTH = 3, 12.0, 192.0
STEPS = (16, 8)


def gammas():
    """At a constant rate out and half the way back, [rad], from the square frame."""
    top = 0.6
    return np.concatenate(
        [np.linspace(0, top, STEPS[0] + 1), np.linspace(top, 0.2, STEPS[1] + 1)[1:]]
    )


def net_force(laws):
    """Crosshead forces [N] of a net of rigid tows, by virtual work, at each of the angles."""
    net = plain_net(N, N, SPACING, 1)
    ends = net.ends.ravel()
    flat = net.points[ends, :2]
    path = gammas()

    def place(time):
        return flat @ axes(np.interp(time, np.arange(len(path)), path)) - net.points[ends]

    model = Model(
        net,
        GivenSection(tuple(1000.0 * SECTION.stiffness())),
        crossovers=CrossoverLaw(100.0, 0.0, 0.0, 0.0, 1000.0, laws=tuple(laws)),
        supports=[Support(ends, (0, 1, 2), place)],
    )
    statics = Statics(model, force_tolerance=1e-5)
    force = [0.0]
    for gamma in path[1:]:
        statics.step(1.0, keep=False)
        moment = np.sum(model.reactions()[ends, :3] * (flat @ axes_rate(gamma)))
        # D = L (2 cos(π/4 − γ/2) − √2), so dD/dγ = L sin(π/4 − γ/2).
        force.append(moment / (LENGTH * np.sin(np.pi / 4 - gamma / 2)))
        statics.stepper.advance(1.0)
    return np.array(force)


@every_law
def test_the_net_and_the_single_crossing_have_the_same_force(law):
    """The moment m of a case: on the net's crossings times their area, in the loop as it is.

    Of two laws of a kind at once.
    """
    both = [keys_of(sample(law, factor)).build(1.0) for factor in (1.0, 1.5)]
    compare_net_and_crossing(two_of(law, SPACING**2), both)


@pytest.mark.parametrize(
    ("base", "gamma", "before", "moment"),
    [
        ("outward", 0.3, 0.2, 3.0),
        ("outward", 0.2, 0.3, 0.0),
        ("outward", 0.3, 0.3, 0.0),
        ("outward", -0.3, -0.2, -3.0),
        ("outward", -0.2, -0.3, 0.0),
        ("forward", 0.3, 0.2, 3.0),
        ("forward", 0.2, 0.3, 0.0),
        ("forward", -0.3, -0.2, 0.0),
        ("forward", -0.2, -0.3, 3.0),
    ],
)
def test_moments_on_one_way_alone(base, gamma, before, moment):
    # The rate is beyond its reach, if there is one.
    law = ShapedLaw(base, "rate", 0.05, (1.0,), constant=2.0)
    assert evaluated(law.moment(crossing(gamma, before))) == pytest.approx(moment)


@pytest.mark.parametrize(
    ("base", "gamma", "before", "stick", "moment"),
    [
        ("opening above", 0.3, 0.2, 0.0, 3.0),
        ("opening above", 0.2, 0.3, 0.0, 0.0),
        ("opening above", -0.3, -0.2, 0.0, 0.0),
        ("opening below", -0.3, -0.2, 0.0, -3.0),
        ("opening below", -0.2, -0.3, 0.0, 0.0),
        ("closing above", 0.2, 0.3, 0.0, 3.0),
        ("closing above", 0.3, 0.3, 1.0, 0.0),
        ("closing below", -0.3, -0.2, 0.0, 0.0),
        ("closing below", -0.3, -0.3, 0.5, -2.25),
        ("opening", 0.3, 0.2, 0.0, 3.0),
        ("opening", -0.3, -0.2, 0.0, -3.0),
        ("closing", -0.3, -0.2, 0.0, 0.0),
        ("closing", -0.3, -0.3, 0.5, -2.25),
    ],
)
def test_moments_on_one_way_as_a_stick_is_bent(base, gamma, before, stick, moment):
    """Fully after more than the stick's angle, and as it was in a hold."""
    law = ShapedLaw(base, "angle", 0.05, (1.0,), constant=2.0, stick_angle=0.05)
    assert evaluated(law.moment(crossing(gamma, before, {"stick": stick}))) == pytest.approx(moment)


TWO = {"also": "angle", "also_reach": 0.5, "coefficients": [0.5, -0.2, 0.3, 0.4]}
#: Laws of several forms in their other forms: the law, and its values beside those of a sample.
OTHER_FORMS: dict[str, tuple[str, dict[str, Any]]] = {
    "state of rest": ("shaped", {"base": "rest", "constant": 0.02}),
    "staying": ("shaped", {"base": "staying", "variable": "largest_angle"}),
    "wave": ("shaped", {"base": "odd", "variable": "angle", "shape": "periodic", "width": 0.3}),
    "mean square": (
        "shaped",
        {"base": "elastic", "variable": "recent_square_of_angle", "reach": 0.3, "memory_s": 20.0},
    ),
    "since the last turn": (
        "shaped",
        {"base": "dissipative", "variable": "since_reversal", "reach": 0.3, "constant": 0.5},
    ),
    "way out": ("shaped", {"base": "outward", "variable": "rate", "reach": 0.1}),
    "way on": ("shaped", {"base": "forward", "variable": "rate", "reach": 0.1}),
    "flow": (
        "shaped",
        {"base": "flowing", "variable": "angle", "exponent": 3.0, "flow_rate_rad_s": 0.02},
    ),
    "structure": (
        "shaped",
        {"base": "smooth", "variable": "broken", "reach": 1.0, "memory_s": 2.0, "constant": 0.5},
    ),
    "rest": (
        "shaped",
        {"base": "dissipative", "variable": "healed", "reach": 1.0, "wear_angle_deg": 2.0},
    ),
    "one side": (
        "shaped",
        {"base": "above", "variable": "angle", "shape": "corner", "place": 0.2},
    ),
    "one side, one way": (
        "shaped",
        {"base": "closing above", "variable": "angle", "shape": "bump", "place": 0.6},
    ),
    "even and ageing": ("lagging", {"even": True, "growth": 0.5}),
    "cord": ("lagging", {"pulls": 1}),
    "play": ("lagging", {"memory_s": None, "play_deg": 3.0}),
    "late": ("lagging", {"by": "rate", "reach": 0.1}),
    "kept": ("lagging", {"by": "kept", "shape": "saturation", "coefficients_N_mm": [0.02]}),
    "two variables": (
        "shaped",
        TWO | {"base": "odd", "variable": "largest_angle", "powers": [1, 3], "constant": 0.0},
    ),
    "two, by the path": (
        "shaped",
        TWO
        | {"base": "dissipative", "variable": "path", "powers": [0, 1], "constants": [0.1, 0.2]},
    ),
    "two, in a course": (
        "shaped",
        TWO | {"base": "above", "variable": "path", "powers": [0, 1], "course": "saturation"},
    ),
}


@pytest.mark.parametrize("form", OTHER_FORMS)
def test_other_forms_are_the_same_in_both(form):
    """Beside next to nothing of all others."""
    keys = {other: keys_of(sample(law) | own) for other, (law, own) in OTHER_FORMS.items()}
    sizes = {other: 1.0 if other == form else TINY for other in keys}
    all_of_them = [one.build(sizes[other] * SPACING**2) for other, one in keys.items()]
    compare_net_and_crossing(all_of_them, [keys[form].build(1.0)])


def compare_net_and_crossing(of_a_net, of_a_crossing):
    """Laws of a net's crossings, and what acts of them, of a unit of area."""
    path = gammas()
    D = LENGTH * (2.0 * np.cos(np.pi / 4 - path / 2) - np.sqrt(2.0))
    columns = {"time_s": np.arange(len(path), dtype=float), "displacement_mm": D}
    run = Run("run.csv", False, "", {**columns, "force_N": np.zeros(len(path))})
    rig = PictureFrameRig(frame_length_mm=LENGTH, fabric_length_mm=N * SPACING)
    fabric = FabricKeys(areal_density_kg_m2=0.2)
    frame = PictureFrame([Measurement(Path(), "picture_frame", "", fabric, rig, 0.01, (run,))])
    variant = FrameVariant("", (), laws=lambda values: tuple(of_a_crossing))
    single, _ = frame.predict((variant,), {p.name: 0.0 for p in frame.baseline})
    whole = net_force(of_a_net)
    # At the start and where the motion turns there are two rates.
    compared = np.delete(np.arange(len(path)), [0, STEPS[0]])
    np.testing.assert_allclose(
        whole[compared], single[compared], rtol=1e-3, atol=1e-3 * np.abs(single).max()
    )


def test_every_form_of_the_loop_is_a_law_of_a_case():
    """With the numbers that the form fits, and those that it sets."""
    named = {law.name: law for law in LAWS.values()}
    of_laws = [v for e in PICTURE_FRAME_EFFECTS for v in e.variants if v.laws is not None]
    assert len(of_laws) >= 18
    for variant in of_laws:
        for law in variant.laws({p.name: 0.5 for p in variant.parameters}):
            assert LAWS[law.law] is type(law) is named[law.name]


# In a case ----------------------------------------------------------------------------------------


@every_law
def test_the_keys_of_a_law_are_listed_and_written(law, tmp_path):
    rows = {row.name: row for row in documented(DrapeCase)}
    for one in LAWS[law].numbers().values():
        row = rows[f"crossover.laws[{law}].{one.key}"]
        assert row.description and row.allowed != "a group of keys"
    assert rows[f"crossover.laws[{law}].law"].allowed == law
    path = tmp_path / "case.yaml"
    path.write_text(f"test: drape\ncrossover: {{laws: [{sample(law)}]}}\n".replace("'", ""))
    case = load_case(path)
    again = tmp_path / "again.yaml"
    again.write_text(case_text(case, tmp_path))
    assert load_case(again) == case
    assert pickle.loads(pickle.dumps(case)) == case, "goes from rank to rank"
    assert f"law: {law}" in template("drape")


def test_units_of_the_keys_of_laws():
    rows = {row.name: row for row in documented(DrapeCase)}
    for key, unit in {
        "maxwell].cubic_1_rad2": "1/rad²",
        "maxwell].flow_deg": "°",
        "maxwell].relaxation_time_s": "s",
        "sliding_friction].growth_1_rad": "1/rad",
        "sliding_friction].rounding_rad_s": "rad/s",
        "tabulated_dashpot].rates_rad_s": "rad/s",
        "smooth_locking].width_deg": "°",
    }.items():
        assert rows[f"crossover.laws[{key}"].unit == unit


def test_true_is_no_number_of_a_law(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(
        "test: drape\ncrossover: {laws: [{law: locking, angle_deg: 40, k_N_mm: yes}]}\n"
    )
    with pytest.raises(
        InputError, match=r"laws.0.k_N_mm: true, allowed is a number greater than 0"
    ):
        load_case(path)
    path.write_text("test: drape\ncrossover: {laws: [{law: locking, angle_deg: 40, k_N_mm: 1}]}\n")
    with pytest.raises(InputError, match=r"^--set: crossover.laws.0.k_N_mm: -1, allowed is"):
        load_case(path, ["crossover.laws.0.k_N_mm=-1"])


# Of the user's own --------------------------------------------------------------------------------

OWN = Path(__file__).parents[1] / "demos" / "own_effects.py"
VALUES = "values: {m_s_N_mm: 0.02, tight_angle_deg: 3}"


def test_a_law_of_ones_own_in_a_case(tmp_path):
    """It counts from the case's folder, is written with its place, and is the law of the file."""
    (tmp_path / "stitches.py").write_text("from __future__ import annotations\n" + OWN.read_text())
    path, again = tmp_path / "case.yaml", tmp_path / "elsewhere" / "again.yaml"
    path.write_text(
        f"test: drape\ncrossover: {{laws: [{{law: own, file: stitches.py, {VALUES}}}]}}\n"
    )
    case = load_case(path)
    law = case.crossover.laws[0].build(AREA)
    gammas = np.array([0.01, -0.3])
    expected = 0.02 * AREA * np.tanh(gammas / np.radians(3.0))
    assert moments(law, gammas) == pytest.approx(expected)
    again.parent.mkdir()
    again.write_text(case_text(case, tmp_path))
    assert str(tmp_path / "stitches.py") in again.read_text()
    assert load_case(again).crossover.laws == case.crossover.laws
    seen = driven((law, law), CLOSED)
    assert seen.moment == pytest.approx(2.0 * moments(law, seen.gamma), rel=1e-6)
    assert np.abs(seen.column("lost_N_mm")).max() == 0.0
    assert "energy_Stitches_2_N_mm" in seen.rows[0]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("file: mine.py", "file: nothing.py", "nothing.py: no such file"),
        ("m_s_N_mm: 0.02, ", "", "laws.0: values: m_s_N_mm: missing, allowed is a number greater"),
        (
            "tight_angle_deg: 3",
            "tight_angle_deg: 3, tight_angel_deg: 3",
            "did you mean tight_angle_deg?",
        ),
        ("tight_angle_deg: 3", "tight_angle_deg: -3", "tight_angle_deg: -3, allowed is a number"),
        ("tight_angle_deg: 3", "tight_angle_deg: yes", "tight_angle_deg: true, allowed is a num"),
        ("tight_angle_deg: 3", "3: 3", "a key that is no text"),
        ("ln, tanh", "ln, tan_h", "mine.py: ImportError"),
        ("class Stitches(ff.CrossingLaw)", "class Stitches", "none, allowed is one subclass"),
        (
            "# %%\n@data",
            "class B(ff.CrossingLaw):\n    pass\n\n\n@data",
            "B, Stitches, allowed is one",
        ),
        ("# %%\nfrom", "1 / 0\nfrom", "mine.py: ZeroDivisionError"),
        ("(self.limit) * tanh", "(self.limit) * tan", "Stitches cannot be evaluated (NameError"),
        ("* ln(cosh", "* lm(cosh", "Stitches cannot be evaluated (NameError"),
        (
            "* tanh(at.gamma",
            "* __import__('math').tanh(at.gamma",
            "takes a number of an expression",
        ),
    ],
)
def test_a_bad_law_of_ones_own_is_one_line(old, new, says, tmp_path):
    case = f"test: drape\ncrossover: {{laws: [{{law: own, file: mine.py, {VALUES}}}]}}\n"
    text = OWN.read_text()
    assert old in case + text
    (tmp_path / "mine.py").write_text(text.replace(old, new))
    path = tmp_path / "case.yaml"
    path.write_text(case.replace(old, new))
    with pytest.raises(InputError) as error:
        load_case(path)
    line = str(error.value)
    assert line.startswith(f"{path}: crossover.laws.0") and says in line and "\n" not in line


def test_a_new_law_is_a_class(tmp_path):
    """A name of its own, none of the others' numbers, and errors where it has no formula."""

    @dataclass(frozen=True)
    class SomeLaw(CrossingLaw):
        k: Any = per_area("k_N_mm", "of it")

    assert SomeLaw.name == "SomeLaw" and list(SomeLaw.numbers()) == ["k"]
    assert SomeLaw.of_case({"k_N_mm": 0.5}, 4.0).k == 2.0
    with pytest.raises(NotImplementedError):
        SomeLaw(1.0).moment(crossing(0.1))
