"""Expressions of scalars on arrays: the chain rule against UFL and by differences, what is kept."""

import numpy as np
import pytest
import ufl
from ufl import conditional, gt, max_value, min_value

from fabric_fenicsx.loop.expressions.marching import MOST_KEPT, Marched, Varying
from fabric_fenicsx.mechanics.chain_rule import CHOICES, CONSTANT, PARTIALS, differentiated
from fabric_fenicsx.mechanics.scalars import (
    OPERATORS,
    Steps,
    derivative_of,
    evaluated,
    lowered,
    numpy_function,
    parted,
    steps_of,
    symbol,
)

WHERE = {"x": np.linspace(0.15, 0.85, 7), "p": 0.7, "q": 1.3}
"""Where every operator has a slope."""

LAWS = {
    "a polynomial": lambda x, p, q: p * x + q * x**3,
    "a quotient": lambda x, p, q: p * x / (q + x**2),
    "a power by a parameter": lambda x, p, q: p * x**q,
    "a parameter to a power": lambda x, p, q: (p + x) ** 2.5 / q,
    "roots and logarithms": lambda x, p, q: ufl.sqrt(p + x) * ufl.ln(q + x),
    "waves": lambda x, p, q: ufl.sin(p * x) + ufl.cos(q * x) * ufl.tan(p * x),
    "arcs": lambda x, p, q: ufl.asin(p * x) + ufl.acos(x / 2 / q) * ufl.atan(q * x),
    "hyperbolic": lambda x, p, q: ufl.sinh(p * x) * ufl.cosh(q * x) + p * ufl.tanh(x / q),
    "exponentials": lambda x, p, q: p * ufl.exp(-q * x),
    "a size and a sign": lambda x, p, q: abs(p - x) * ufl.sign(x - 0.4) * q,
    "a choice": lambda x, p, q: conditional(gt(x, 0.5), p * x, q * x**2),
    "the larger and the smaller": lambda x, p, q: max_value(p * x, q / 3) + min_value(p, q * x),
}


def slopes_of(law):
    """Steps of value and slopes of a law, and where the slopes are."""
    at = {name: symbol() for name in WHERE}
    steps = steps_of([lowered(law(*at.values()))], at)
    return at, *differentiated(steps, tuple(WHERE))


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_the_chain_rule_gives_ufls_derivatives(law):
    at, steps, (partials,) = slopes_of(law)
    found = evaluated(steps)(WHERE)
    expected = numpy_function(
        [law(*at.values()), *(derivative_of(law(*at.values()), at[n]) for n in WHERE)], at
    )(WHERE)
    assert found[0] == pytest.approx(expected[0], rel=1e-14)
    assert set(partials) == set(WHERE)
    for name, exact in zip(WHERE, expected[1:], strict=True):
        assert np.broadcast_to(found[partials[name]], (7,)) == pytest.approx(
            np.broadcast_to(exact, (7,)), rel=1e-12, abs=1e-14
        )


def test_every_operator_that_can_be_evaluated_can_be_differentiated():
    assert set(OPERATORS) == {*PARTIALS, *CHOICES, *CONSTANT}
    one = {k: ("given", k) for k in "xpq"}
    for operator in [*PARTIALS, *CHOICES]:
        two = operator in ("Sum", "Product", "Division", "Power", "Atan2", *CHOICES)
        taken = [0, 1] if two else [0]
        begin = [one["x"], one["p"]]
        if operator == "Conditional":
            begin, taken = [*begin, ("GT", [0, 1])], [2, 0, 1]
        steps, (partials,) = differentiated(Steps([*begin, (operator, taken)], [len(begin)]), "xp")
        evaluate = evaluated(steps)
        for name in partials:
            change = {n: 1e-6 * (n == name) for n in "xp"}
            up, down = (
                evaluate({n: WHERE[n] + s * change[n] for n in "xp"})[0] for s in (1.0, -1.0)
            )
            slope = np.broadcast_to(evaluate(WHERE)[partials[name]], (7,))
            # Of a choice the point where it is made is left out.
            away = np.abs(WHERE["x"] - WHERE["p"]) > 1e-3
            difference = np.broadcast_to((up - down) / 2e-6, (7,))
            assert slope[away] == pytest.approx(difference[away], rel=1e-6, abs=1e-8), operator


def test_what_is_not_chosen_may_have_no_slope():
    _, steps, (partials,) = slopes_of(
        lambda x, p, q: conditional(gt(x, 0.5), ufl.sqrt(x - 0.5) * p, p * x) * q
    )
    values = evaluated(steps)(WHERE | {"x": np.array([0.25, 0.5, 0.75])})
    assert values[partials["x"]] == pytest.approx([0.91, 0.91, 0.91], rel=1e-12)
    assert values[partials["p"]] == pytest.approx([0.325, 0.65, 0.65], rel=1e-12)


def test_what_parameters_do_not_change_is_apart():
    _, steps, _ = slopes_of(lambda x, p, q: p * ufl.exp(x) + q * ufl.sin(x))
    still, moving = parted(steps, {"p", "q"})
    assert {operator for operator, _ in still.operations} >= {"Exp", "Sin"}
    assert not {"Exp", "Sin", "Cos"} & {operator for operator, _ in moving.operations}
    kept = {str(k): value for k, value in enumerate(evaluated(still)({"x": WHERE["x"]}))}
    found, whole = evaluated(moving)({**WHERE, **kept}), evaluated(steps)(WHERE)
    for a, b in zip(found, whole, strict=True):
        assert np.array_equal(a, b)


def a_law_with_memory():
    """P times the largest x so far, which no parameter changes, plus a mean that q makes."""
    marched = Marched(("x",), ("p", "q"))
    x, largest, mean = marched.at["x"], marched.remembered("largest"), marched.remembered("mean")
    history = {
        "largest": max_value(largest, x),
        "mean": mean + marched.at["q"] * (x - mean),
    }
    return marched.define({"y": marched.at["p"] * largest + mean}, history)


def by_hand(x, p, q):
    largest, mean, y = np.zeros(x.shape[1]), np.zeros(x.shape[1]), []
    for now in x:
        y.append(p * largest + mean)
        largest, mean = np.maximum(largest, now), mean + q * (now - mean)
    return np.array(y)


def test_what_is_kept_is_of_the_arrays_that_come_in():
    marched, more = a_law_with_memory(), [a_law_with_memory() for _ in range(MOST_KEPT)]
    rng = np.random.default_rng(1)
    records = [Varying(rng.normal(size=(9, 2))) for _ in range(2)]
    for p, q, x in [(1.0, 0.2, 0), (2.0, 0.2, 0), (2.0, 0.5, 1), (2.0, 0.5, 0), (1.0, 0.1, 1)]:
        y = marched({"x": records[x]}, {"p": p, "q": q})["y"]
        assert y.value == pytest.approx(by_hand(records[x].value, p, q), rel=1e-13)
        for name in "pq":
            up, down = (
                by_hand(records[x].value, *({"p": p, "q": q} | {name: v}).values())
                for v in ({"p": p, "q": q}[name] + s * 1e-6 for s in (1.0, -1.0))
            )
            assert y.slopes[name] == pytest.approx((up - down) / 2e-6, rel=1e-5, abs=1e-8)
        for other in more:
            other({"x": records[x]}, {"p": p, "q": q})


def test_what_was_before_the_first_point_is_not_kept_for_another():
    marched = Marched(("x",), ("p",))
    largest = marched.remembered("largest")
    marched.define(
        {"y": marched.at["p"] * largest}, {"largest": max_value(largest, marched.at["x"])}
    )
    x = Varying(np.array([[0.1], [0.5], [0.3]]))
    for first in (np.array([0.0]), np.array([0.4]), np.array([0.9])):
        y = marched({"x": x}, {"p": 2.0}, {"largest": first})["y"].value
        expected = 2.0 * np.maximum.accumulate(np.r_[first, 0.1, 0.5])
        assert y[:, 0] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("columns", [(), (1,), (3,)])
def test_nothing_is_remembered_of_the_record_before(columns):
    """Records one after the other: each is as by itself, with what it remembers at first."""
    x = Varying(np.random.default_rng(2).normal(size=(9, *columns)), {"r": np.ones((9, *columns))})
    values, begins, first = {"p": 2.0, "q": 0.3}, np.array([0, 4, 5]), np.array([0.1, 0.9, 2.0])
    one_by_one = a_law_with_memory()({"x": x}, values, {"largest": first}, begins)["y"]
    assert one_by_one.value.shape == (9, *columns)
    for start, end, largest in zip(begins, (4, 5, 9), first, strict=True):
        own = Varying(x.value[start:end], {"r": x.slopes["r"][start:end]})
        alone = a_law_with_memory()({"x": own}, values, {"largest": np.array([largest])})["y"]
        assert np.array_equal(one_by_one.value[start:end], alone.value)
        for name in "pqr":
            among = np.broadcast_to(one_by_one.slopes[name], one_by_one.value.shape)
            by_itself = np.broadcast_to(alone.slopes[name], alone.value.shape)
            assert np.array_equal(among[start:end], by_itself)
    assert one_by_one.value[4].min() > 1.0
