"""Zeros of runs as noise: what scatters about nothing, and what is left of a diagnosis."""

from types import SimpleNamespace

import pytest

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Effect, Variant
from fabric_fenicsx.loop.inference.zeros import (
    scatter_about_nothing,
    with_zeros_as_noise,
    with_zeros_of_terms,
    zeros_of_noise,
)

ZEROS = tuple(Parameter(f"run{k}_zero", amplitude=True) for k in (1, 2, 3))


def effect(name, *, zeros=False, listed=True):
    parameters = ZEROS if zeros else (Parameter(name, amplitude=True),)
    variant = Variant("own", parameters, zeros=zeros)
    known = {} if listed else {"acts_on": "reading", "depends_on": ("run",)}
    return Effect(name, "picture_frame", "made up", (variant,), **known)


def found(effects, values, rivals=None):
    """A diagnosis with zeros of three runs, and effects whose amplitude is 1."""
    known = dict(zip((p.name for p in ZEROS), values, strict=True))
    return SimpleNamespace(
        experiment=SimpleNamespace(effects=[effect("friction"), effect("offset")]),
        verdict="effect_found",
        final=SimpleNamespace(
            values=known | {"friction": 1.0, "term": 1.0},
            variants=tuple(v for e in effects for v in e.variants),
        ),
        effects=tuple(effects),
        rivals={e.name: [] for e in effects} | (rivals or {}),
        pairs=[("offset", [], "term", []), ("friction", [], "locking", [])],
        zeros=0.0,
    )


@pytest.mark.parametrize(
    ("zeros", "about"),
    [
        ([0.3, -0.2], True),
        ([0.3, 0.29], False),
        # Student's t of two numbers that are a third apart is 7, and of three 8.8.
        ([0.3, 0.4], True),
        ([0.3, 0.4, 0.35], False),
        ([1.0, -1.2, 0.9, -0.8, 1.1, 0.2], True),
        ([0.5, 1.4, 0.7, 1.1], False),
        ([0.3], False),
    ],
)
def test_what_scatters_about_nothing(zeros, about):
    """Whichever side it is on."""
    assert scatter_about_nothing(zeros) is about
    assert scatter_about_nothing([-zero for zero in zeros]) is about


def test_zeros_alone_are_no_effect():
    only = with_zeros_as_noise(found([effect("offset", zeros=True)], (0.3, -0.4, 0.0)))
    assert (only.verdict, only.effects, only.rivals) == ("no_effect", (), {})
    assert only.zeros == pytest.approx((0.25 / 3) ** 0.5)
    assert only.pairs == [("friction", [], "locking", [])]


@pytest.mark.parametrize(
    ("listed", "verdict"), [(True, "effect_found"), (False, "effect_discovered")]
)
def test_what_is_beside_zeros_is_left(listed, verdict):
    name = "friction" if listed else "term"
    both = [effect(name, listed=listed), effect("offset", zeros=True)]
    diagnosis = found(both, (0.3, -0.4, 0.0), {name: ["offset", "locking"]})
    diagnosis.verdict = verdict
    left = with_zeros_as_noise(diagnosis)
    assert (left.verdict, left.effects) == (verdict, (both[0],))
    assert left.rivals == {name: ["locking"]}
    assert len(left.final.variants) == 2


@pytest.mark.parametrize(
    ("values", "rivals"), [((0.3, 0.4, 0.35), []), ((0.3, -0.4, 0.0), ["friction"])]
)
def test_a_claim_stays_one(values, rivals):
    """On one side; or where an effect with a name is a rival."""
    claimed = [effect("offset", zeros=True)]
    same = with_zeros_as_noise(found(claimed, values, {"offset": rivals}))
    assert (same.verdict, same.effects, same.zeros) == ("effect_found", tuple(claimed), 0.0)


@pytest.mark.parametrize(
    ("values", "of_noise"), [((0.3, -0.4, 0.0), True), ((0.3, 0.4, 0.35), False)]
)
def test_zeros_of_noise_are_those_of_an_effect_of_the_model(values, of_noise):
    zeros = effect("offset", zeros=True)
    model = found([effect("friction"), zeros], values).final
    known = zeros_of_noise([zeros], model)
    assert known == ((zeros, zeros.variants[0]) if of_noise else None)
    assert zeros_of_noise([effect("friction")], model) is None


def test_zeros_of_a_term_are_looked_for_where_no_name_has_them():
    """With its other forms it is one term of many."""
    name, load_cell = effect("friction"), effect("offset", zeros=True)
    (other,) = effect("shape", listed=False).variants
    term = effect("run", zeros=True, listed=False)
    both = Effect(term.name, term.test, term.meaning, (*term.variants, other), acts_on="reading")
    few = with_zeros_of_terms([name], [effect("shape", listed=False), both])
    assert [e.name for e in few] == ["friction", "run"]
    assert few[1].variants == term.variants
    assert not any(e.one_of_many for e in few) and both.one_of_many
    assert with_zeros_of_terms([name, load_cell], [both]) == [name, load_cell]
