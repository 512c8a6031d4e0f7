"""General forms of effects: that they come near the shapes of their families, by linear algebra.

The moments of a form are linear in its amplitudes. At the readings of a loading to both sides, with
rates and a hold, their columns beside the baseline's are fitted (non-negative least squares where
amplitudes have a sign) to closed forms, for the best of many values of the form's one shape.
"""

from dataclasses import replace
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from test_shear_laws import evaluated
from ufl import as_ufl

from fabric_fenicsx.loop.expressions.marching import Marched, Varying
from fabric_fenicsx.loop.inference.choice import verdict_on
from fabric_fenicsx.loop.inference.effects import scaled
from fabric_fenicsx.loop.kinds.cantilever.effects import CANTILEVER_EFFECTS
from fabric_fenicsx.loop.kinds.cantilever.terms import terms as strip_terms
from fabric_fenicsx.loop.kinds.picture_frame.effects import PICTURE_FRAME_EFFECTS
from fabric_fenicsx.loop.kinds.picture_frame.terms import terms as frame_terms
from fabric_fenicsx.loop.report.content import _effects
from fabric_fenicsx.loop.report.discovered import Discovered, discovered_report
from fabric_fenicsx.loop.report.words import terms_of
from fabric_fenicsx.mechanics.laws.law import Crossing, Times
from fabric_fenicsx.mechanics.laws.locking import Locking

SHARES = dict.fromkeys(("angle", "duration", "rate", "travel", "curvature", "moment"), 1.0)
#: Data whose rates are all alike, too.
SHARES["typical_rate"] = 1.0


@cache
def named(effects, name, label):
    """A form for data whose ranges are all one."""
    (effect,) = (scaled(e, SHARES) for e in effects if e.name == name)
    (found,) = (v for v in effect.variants if v.label == label)
    return found


def left(columns, free, target):
    """Share of a curve, rms, that columns leave of it: free ones of any sign, the others not."""
    J = np.column_stack([*free, *columns])
    J = J / np.maximum(np.abs(J).max(axis=0), 1e-300)
    lower = np.r_[np.full(len(free), -np.inf), np.zeros(len(columns))]
    x = lsq_linear(J, target, (lower, np.inf), method="bvls").x
    return np.linalg.norm(target - J @ x) / np.linalg.norm(target)


def path():
    """Time, angle and rate: out at one rate, a hold, to the other side and back at another."""
    corners = np.array([[0.0, 0.0], [0.15, 1.0], [0.4, 1.0], [0.7, -1.0], [1.0, 1.0]])
    time = np.linspace(0.0, 1.0, 401)
    return time, np.interp(time, *corners.T), np.r_[0.0, np.diff(np.interp(time, *corners.T))] * 400


TIME, GAMMA, RATE = path()
X = np.linspace(-1.0, 1.0, 401)


@cache
def compiled(variant):
    """The moments of a form's laws together."""
    marched = Marched(
        ("gamma", "gamma_n", "rate", "per_time"), tuple(p.name for p in variant.parameters)
    )
    at, moment, history = marched.at, 0.0, {}
    for k, law in enumerate(variant.laws(at)):
        crossing = Crossing(
            at["gamma"],
            at["gamma_n"],
            at["per_time"],
            lambda value: value,
            lambda name, k=k: marched.remembered(f"{k} {name}"),
            at["rate"],
        )
        moment = moment + law.moment(crossing)
        history |= {f"{k} {name}": value for name, value in law.history(crossing).items()}
    return marched.define({"moment": moment}, history)


def columns(variant, shape, gammas=GAMMA, rates=RATE):
    """Moments of a form for each amplitude of one."""
    before = np.r_[0.0, gammas[:-1]]
    inputs = {"gamma": gammas, "gamma_n": before, "rate": rates, "per_time": 400.0 + 0.0 * gammas}
    given = {name: Varying(x[:, None]) for name, x in inputs.items()}
    values = {p.name: 1.0 for p in variant.amplitudes} | shape
    slopes = compiled(variant)(given, values)["moment"].slopes
    return [np.broadcast_to(slopes[p.name], (len(gammas), 1))[:, 0] for p in variant.amplitudes]


def nearest(name, label, target, free, gammas=GAMMA, rates=RATE, cubic=None, count=13):
    """Least share left over the values of the form's shape; its bounds hold."""
    variant = named(PICTURE_FRAME_EFFECTS, name, label)
    shapes = [p for p in variant.shapes if p.name != "cubic_1_rad2"]
    fixed = {} if cubic is None else {"cubic_1_rad2": cubic}
    grid = [{}]
    for p in shapes:
        lower = max(p.lower, 1e-4)
        space = np.linspace if p.share_of == "" and name == "shear_locking" else np.geomspace
        grid = [{**g, p.name: s} for g in grid for s in space(lower, p.upper, count)]
    return min(left(columns(variant, g | fixed, gammas, rates), free, target) for g in grid)


def exact_steps(target):
    """A moment whose change over a step of the path is a function of it and of the step."""
    M = [0.0]
    for step in np.diff(GAMMA):
        M.append(target(M[-1], step))
    return np.array(M)


def slider(M, step, s=0.03):
    return np.clip(M + step / s, -1.0, 1.0)


def dahl(M, step, s=0.03):
    limit = np.sign(step)
    return limit + (M - limit) * np.exp(-abs(step) / s)


@pytest.mark.parametrize(
    ("law", "most"),
    # First loading and reversal of Dahl's are not of one curve (Masing), those of sliders are.
    [(slider, 0.02), (partial(slider, s=0.013), 0.02), (dahl, 0.04)],
)
def test_sliders_side_by_side_are_near_any_hysteresis(law, most):
    free = [GAMMA, GAMMA**3]
    assert nearest("crossover_friction", "sliders side by side", exact_steps(law), free) < most


@pytest.mark.parametrize(
    ("label", "first"),
    [
        ("sliders spread evenly", lambda x: x * (1.0 - np.log(np.maximum(x, 1e-12)))),
        ("sliders of one stiffness", lambda x: x * (2.0 - x)),
    ],
)
def test_sliders_that_are_spread_are_a_continuum(label, first):
    """First loading in closed form, and on the way back that scaled by two (Masing)."""
    last = 0.3

    def loading(gamma):
        return first(np.minimum(gamma / last, 1.0))

    out, back = np.linspace(0.0, 0.2, 81), np.linspace(0.2, -0.2, 161)[1:]
    moment = np.r_[loading(out), loading(0.2) - 2.0 * loading((0.2 - back) / 2.0)]
    gammas = np.r_[out, back]
    variant = named(PICTURE_FRAME_EFFECTS, "crossover_friction", label)
    (own,) = columns(variant, {"slip_angle_rad": last}, gammas, 0.0 * gammas)
    assert own == pytest.approx(moment, abs=0.04)
    assert np.sqrt(np.mean((own - moment) ** 2)) < 0.015


RATES = np.repeat([-1.0, -0.5, -0.2, -0.07, -0.02, 0.02, 0.07, 0.2, 0.5, 1.0], 3)
STILL = np.zeros_like(RATES)


@pytest.mark.parametrize("v", [1e-3, 0.02, 0.13, 0.25])
def test_twice_rounded_sliding_is_near_other_roundings(v):
    near = partial(nearest, "crossover_friction", "sliding, rounded twice")
    for target in (np.tanh(RATES / v), 2.0 / np.pi * np.arctan(RATES / v)):
        assert near(target, [RATES], STILL, RATES, count=40) < 0.02


@pytest.mark.parametrize(
    ("target", "label", "most"),
    [
        (np.sign(RATES) * np.abs(RATES) ** 0.3, "Ree-Eyring", 0.02),
        (np.sign(RATES) * np.abs(RATES) ** 0.7, "Ree-Eyring", 0.02),
        (np.arcsinh(RATES / 0.05), "Ree-Eyring", 0.02),
        (RATES / (0.2 + np.abs(RATES)), "Ree-Eyring", 0.02),
        (np.sign(RATES) * np.abs(RATES) ** 1.3, "powers 1.5 and 3", 0.02),
        (np.sign(RATES) * np.abs(RATES) ** 2.0, "powers 1.5 and 3", 0.02),
    ],
)
def test_dashpots_that_thin_or_thicken(target, label, most):
    assert nearest("rate_hardening", label, target, [RATES], STILL, RATES, count=40) < most


def branch(tau, cubic=0.0):
    """Maxwell's branch along the path, exact for straight steps."""
    spring = GAMMA + cubic * GAMMA**3
    q, h = [0.0], TIME[1]
    for step in np.diff(spring):
        q.append(q[-1] * np.exp(-h / tau) + step * tau / h * (1.0 - np.exp(-h / tau)))
    return np.array(q)


@pytest.mark.parametrize(
    ("target", "label", "cubic"),
    [
        (branch(0.02), "spectrum", None),
        (branch(0.13), "spectrum", None),
        (branch(0.03) + 0.6 * branch(0.2), "spectrum", None),
        # A power law of creep, and what it becomes on a stiffening spring.
        (sum(branch(t) * t**-0.3 for t in np.geomspace(0.003, 3.0, 12)), "spectrum", None),
        (branch(0.05, 2.0), "spectrum, cubic", 2.0),
    ],
)
def test_a_spectrum_is_near_any_fading_memory(target, label, cubic):
    free = [GAMMA, GAMMA**3, RATE]
    assert nearest("crossover_relaxation", label, target, free, cubic=cubic) < 0.02


BEYOND = np.maximum(np.abs(X) - 0.65, 0.0)


@pytest.mark.parametrize(
    "size",
    [BEYOND, BEYOND**2, BEYOND**3, BEYOND**4, np.expm1(BEYOND / 0.1), np.tan(3.0 * BEYOND)],
)
def test_a_series_beyond_an_angle_is_near_any_locking(size):
    target = np.sign(X) * size
    free = [X, X**3]
    assert nearest("shear_locking", "series", target, free, X, 0.0 * X, count=67) < 0.02


@pytest.mark.parametrize(
    "target", [np.abs(X), X**2, np.abs(X) ** 3, X**4, 1.0 / np.cos(X) - 1.0, np.abs(np.sin(X))]
)
def test_even_powers_are_near_any_even_force(target):
    variant = named(PICTURE_FRAME_EFFECTS, "tension_coupling", "powers 1, 2, 4")
    assert left([], columns(variant, {}, X, 0.0 * X), target) < 0.02


K = np.linspace(0.0, 1.0, 201)


@pytest.mark.parametrize("at", [0.04, 0.1, 0.3, 0.7])
@pytest.mark.parametrize(
    "share", [lambda y: y / (1.0 + y), np.tanh, lambda y: np.minimum(y, 1.0), lambda y: y + y**3]
)
def test_bundles_side_by_side_are_near_any_bending(at, share):
    """Beside a stiffness that is left once all have slipped, a tenth of that at rest."""
    variant = named(CANTILEVER_EFFECTS, "nonlinear_bending", "bundles side by side")
    (scale,) = variant.shapes
    names = tuple(p.name for p in variant.parameters)
    bending = Marched(("kappa",), names)
    bending.define({"moment": variant.moment(bending.at, bending.at["kappa"])}, {})
    kappa = {"kappa": Varying(K[:, None])}

    def moments(s):
        slopes = bending(kappa, dict.fromkeys(names, 1.0) | {scale.name: s})["moment"].slopes
        return [slopes[p.name][:, 0] for p in variant.amplitudes]

    target = share(K / at) + 0.1 * K / at
    best = min(
        left([K, *moments(s)], [], target) for s in np.geomspace(scale.lower, scale.upper, 25)
    )
    assert best < 0.02


def travels(form, D):
    """What a form of the free travel makes of the crosshead's, by its three numbers."""
    variant = named(PICTURE_FRAME_EFFECTS, "crosshead_backlash", form)

    def travel(*numbers):
        p = dict(zip((p.name for p in variant.parameters), numbers, strict=True))
        return np.array([evaluated(variant.travel(p, as_ufl(float(d)), None)) for d in D])

    return travel


def test_a_soft_gap_becomes_every_gap_and_none():
    D = np.linspace(-1.0, 1.0, 81)
    travel = travels("soft gap", D)
    for width in (1e-4, 0.05):
        assert travel(0.0, 0.0, width) == pytest.approx(D, abs=1e-14)
    for out, back in ((0.2, 0.2), (0.2, 0.0), (0.0, 0.1)):
        gap = np.maximum(D - out, 0.0) + np.minimum(D + back, 0.0)
        # A rounded corner is off by its width times ln 2, the start likewise.
        assert travel(out, back, 1e-4) == pytest.approx(gap, abs=2.001e-4 * np.log(2.0))
        soft = travel(out, back, 0.03)
        assert soft[40] == 0.0 and (np.diff(soft) > 0.0).all()


def test_a_free_travel_that_is_taken_up_gradually_never_goes_back():
    """D − b (1 − e^(−|D|/(d + b))) to each side: b is missing in the end, of which d is none."""
    D = np.linspace(-4.0, 4.0, 161)
    travel = travels("taken up gradually", D)
    assert travel(0.0, 0.0, 0.1) == pytest.approx(D, abs=1e-14)
    for out, back, d in ((0.3, 0.1, 0.2), (0.2, 0.0, 0.05), (0.3, 0.2, 0.0)):
        taken = travel(out, back, d)
        assert taken[80] == 0.0 and (np.diff(taken) > 0.0).all()
        assert taken[[0, -1]] == pytest.approx([-4.0 + back, 4.0 - out], abs=1e-3)
        at = D[100]
        assert taken[100] == pytest.approx(at - out * (1.0 - np.exp(-at / (d + out))), rel=1e-8)


def test_what_laws_share_is_fitted_once():
    variant = named(PICTURE_FRAME_EFFECTS, "crossover_relaxation", "spectrum, cubic")
    names = [p.name for p in variant.parameters]
    assert len(names) == len(set(names)) == 5
    laws = variant.laws(dict.fromkeys(names, 2.0))
    assert [law.relaxation_time for law in laws] == [2.0, 8.0, 32.0]
    assert [law.cubic for law in laws] == [2.0, 2.0, 2.0]


def test_signs_of_general_forms_are_those_of_physics():
    """No negative friction, branch, dashpot, locking or slip; nor is any locking a spring."""
    for effect in (*PICTURE_FRAME_EFFECTS, *CANTILEVER_EFFECTS):
        for variant in effect.variants:
            assert len(variant.parameters) <= 5
            if len(variant.amplitudes) > 1 and effect.name not in (
                "tension_coupling",
                "load_drift",
            ):
                assert all(p.one_sided for p in variant.amplitudes)
    for one in Locking.forms:
        angles = [
            n.parameter if isinstance(n, Times) else n for i in one.instances for n in [i["angle"]]
        ]
        assert all(p.lower >= 1 / 3 and p.share_of == "angle" for p in angles)


REACHED = (
    *("angle", "rate", "path", "time", "displacement", "speed", "acceleration", "force"),
    "force_rate",
)


@pytest.mark.parametrize(
    ("kind", "term", "name"),
    [
        ("cantilever", "bending_moment_of_curvature", "nonlinear_bending"),
        ("cantilever", "bending_moment_of_arc_length", None),
        ("cantilever", "rest_curvature_of_arc_length", "residual_curvature"),
        ("cantilever", "load_of_arc_length", None),
        ("picture_frame", "even_moment_of_angle", "tension_coupling"),
        ("picture_frame", "odd_in_rate_moment_of_rate", "rate_hardening"),
        ("picture_frame", "dissipative_moment_of_direction", "crossover_friction"),
        ("picture_frame", "dissipative_moment_of_angle", "crossover_friction"),
        # What rubs less for having rubbed is more than a friction.
        ("picture_frame", "dissipative_moment_of_path", None),
        # A drift is one, and so is a vibration.
        ("picture_frame", "reading_of_time", None),
        # A moment that rises is no locking.
        ("picture_frame", "odd_moment_of_angle", None),
    ],
)
def test_a_term_that_is_a_listed_effect_says_so(kind, term, name):
    """Whatever its shape: any odd bending law is a nonlinear one. Others are kept apart by it."""
    ranges = dict.fromkeys(REACHED, 1.0)
    ranges |= {"length": 250.0, "curvature": 0.01, "x": 200.0, "z": 100.0}
    ranges |= {"stiffness_per_C1": 1e-5, "runs": 1.0, "overhangs": 3.0}
    both_ways = {"displacement": (-1.0, 1.0)}
    every = strip_terms(ranges, ()) if kind == "cantilever" else frame_terms(ranges, both_ways)
    (effect,) = (e for e in every if e.name == term)
    assert effect.in_general == ((name,) if name else ())
    listed = [*CANTILEVER_EFFECTS, *PICTURE_FRAME_EFFECTS]
    fitted = SimpleNamespace(at_bound=(), errors={})
    diagnosis = SimpleNamespace(
        experiment=SimpleNamespace(effects=listed, terms=every, alike=frozenset()),
        final=fitted,
        rivals={term: ["nonlinear_bending", "crossover_friction"]},
    )
    own = Discovered(
        "discovered_1", effect, replace(effect.variants[0], parameters=()), {}, None, ""
    )
    (said,) = discovered_report(diagnosis, [own])
    names = [rival["name"] for rival in said["rivals"]]
    assert sorted(names) == sorted({name or "nonlinear_bending", *diagnosis.rivals[term]})
    assert [r["name"] for r in said["rivals"] if r.get("in_general")] == [name] * bool(name)


@pytest.mark.parametrize(
    ("names", "left", "verdict"),
    [
        (("rate_hardening",), 1.0, "effect_found"),
        # The rougher limit of terms is for what has no name.
        (("rate_hardening",), 1.3, "effect_discovered"),
        (("",), 1.0, "effect_discovered"),
        (("rate_hardening", ""), 1.0, "effect_discovered"),
        (("rate_hardening", "tension_coupling"), 1.0, "effect_found"),
        # Two of one name are more than it says.
        (("rate_hardening", "rate_hardening"), 1.0, "effect_discovered"),
        (("rate_hardening",), 2.0, "unexplained"),
    ],
)
def test_what_is_a_listed_effect_by_definition_is_found(names, left, verdict):
    def explains(model, baseline, *, roughly=False):
        return left < (1.4 if roughly else 1.25)

    judge = SimpleNamespace(experiment=SimpleNamespace(curves_only=False), explains=explains)
    of = {"name": "a", "listed": False, "acts_on": "moment", "depends_on": ("rate",)}
    effects = [SimpleNamespace(**of, by_definition=name) for name in names]
    assert verdict_on(judge, None, SimpleNamespace(effects=effects)) == verdict


def test_it_is_reported_with_its_name_and_its_curve():
    by_name = {e.name: e for e in frame_terms(dict.fromkeys(REACHED, 1.0))}
    effect = by_name["odd_in_rate_moment_of_rate"]
    term = {
        "name": "discovered_1",
        "of": effect.name,
        "shape": "discovered_1.csv",
        "rivals": [{"name": "rate_hardening", "in_general": True}],
        "rival_names": ["rate_hardening", "reading_of_speed"],
    }
    (found,) = _effects(SimpleNamespace(effects=(effect,)), [term])
    assert found["name"] == "rate_hardening" and found["shape"] == "discovered_1.csv"
    assert found["rivals"] == ["reading_of_speed"]
    assert terms_of({"discovered": [], "effects": [found, {"name": "load_drift"}]}) == [found]


@pytest.mark.parametrize(
    ("term", "label", "also"),
    [
        ("reading_of_distance", "scale, linear", ["height", "distance"]),
        ("reading_of_distance", "turned", None),
        ("reading_of_length", "scale, linear", ["height", "length"]),
        ("reading_of_height", "scale, linear", None),
    ],
)
def test_a_scale_of_heights_says_that_it_goes_by_the_height(term, label, also):
    ranges = {"length": 250.0, "curvature": 0.01, "x": 200.0, "z": 100.0, "overhangs": 3.0}
    every = strip_terms(ranges, ())
    (effect,) = (e for e in every if e.name == term)
    form = next(v for v in effect.variants if v.label == label)
    diagnosis = SimpleNamespace(
        experiment=SimpleNamespace(effects=CANTILEVER_EFFECTS, terms=every, alike=frozenset()),
        final=SimpleNamespace(at_bound=(), errors={}),
        # What is so in any case is not said twice.
        rivals={term: ["reading_of_height_and_distance"]},
    )
    own = Discovered("discovered_1", effect, replace(form, parameters=()), {}, None, "")
    (said,) = discovered_report(diagnosis, [own])
    lens = {"acts_on": "reading", "depends_on": ["height", "distance"]}
    general = [{"acts_on": "reading", "depends_on": also, "in_general": True}] if also else []
    assert said["rivals"] == general + [lens] * (also != lens["depends_on"])
