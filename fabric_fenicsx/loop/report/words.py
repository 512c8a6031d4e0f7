"""What a report says in sentences: no more than the numbers beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...inputs.keys import UNITS, one_of
from ..inference.criteria import CRITERIA

__all__ = ["headline", "parameter_unit", "reasons", "terms_of"]

PARAMETER_UNITS = {
    "N_s_n": "N sⁿ",
    "1_rad2": "1/rad²",
    "rad_per_N": "rad/N",
    "N_mm3": "N mm³",
    "1_mm": "1/mm",
    "rad2_s2": "rad²/s²",
    "rad2_s": "rad²/s",
    "rad2": "rad²",
    "rad_s": "rad/s",
    "rad": "rad",
    "N_s": "N s",
    "mm_s2": "mm/s²",
    "mm_s": "mm/s",
}
OTHER_UNITS = {"drift_N_s": "N/s", "force_rate_N_s": "N/s"}
"""These are written like a dashpot's."""

#: Scatter of specimens below which the headline does not name it. Convention.
SMALL_SCATTER = 0.02
#: Share by which an error is smaller than another one.
SMALLER = 0.01


def parameter_unit(name: str) -> str:
    """Unit that stands at the end of a parameter's name; empty if there is none."""
    if name in OTHER_UNITS:
        return OTHER_UNITS[name]
    endings = PARAMETER_UNITS | UNITS
    return next((text for end, text in endings.items() if name.endswith("_" + end)), "")


def terms_of(report: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What a report says of terms without a formula, with another's name or with none."""
    return [*report["discovered"], *(e for e in report["effects"] if "shape" in e)]


def headline(report: Mapping[str, Any]) -> str:
    """The verdict in a few plain sentences: effects, specimens, noise, laboratories.

    What a model scatters by that does not explain the data is not the readings' or specimens' own.
    """
    sentences = [_verdict(report)]
    if report["verdict"] != "unexplained":
        sentences += [*_specimens(report), *_noise(report)]
    return " ".join([*sentences, *_laboratories(report)])


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def _value(report: Mapping[str, Any], number: float | None) -> str:
    unit = parameter_unit(report["error"]["quantity"])
    return "unknown" if number is None else f"{number:.2g} {unit}"


def _verdict(report: Mapping[str, Any]) -> str:
    error = report["error"]
    before, after = (_value(report, error[when]["holdout"]) for when in ("before", "after"))
    scatter = f"a reading scatters by {_value(report, error['noise'])}"
    if report["verdict"] == "no_effect":
        says = "The baseline model explains the data, no effect has to be added"
        if report["in_scatter"]:
            says = f"The baseline model explains the data if specimens differ{_by(report)}"
        errors = f"held-out error {before}{_foreseen(report)}; {scatter}"
        if report["noise_model"]["zeros"]:
            says = (
                "The baseline model explains the data but for zeros of the runs, which scatter "
                "about nothing; no effect has to be added"
            )
            errors = f"held-out error {after}, {before} without zeros; {scatter}"
        return f"{says}: {errors}.{_if_alike(report)}"
    if report["verdict"] == "effect_found":
        names = _listed([effect["name"] for effect in report["effects"]])
        verb = "explain" if len(report["effects"]) > 1 else "explains"
        text = (
            f"{names} {verb} the residual: held-out error {before} before, {after} "
            f"after{_foreseen(report)}; {scatter}."
        )
        for effect in report["effects"]:
            if effect["rivals"]:
                text += f" This data cannot tell {effect['name']} from {one_of(effect['rivals'])}."
        for term in terms_of(report):
            text += f" {term['name']} has a form that is on no list: {term['formula']}."
        return text + _differing(report)
    if report["verdict"] == "effect_discovered":
        return _discovered(report, before, after, scatter)
    fitted = error["before"]["fit"]
    if report["curve"] is not None:
        text = (
            "The readings go one way at one rate: they know the curve of the moment against the "
            f"angle, which the baseline is not (error {_value(report, fitted)}; {scatter}), "
            "and not what makes it."
        )
        return text + (f" It may be {one_of(report['may_be'])}." if report["may_be"] else "")
    if report["may_be"]:
        return (
            "The residual is not noise, and readings that go one way at one rate do not know what "
            f"makes it: held-out error {before}; {scatter}. Nearest to it is "
            f"{one_of(report['may_be'])}."
        )
    nor = "and no known effect explains it, nor do several of them"
    if report["instead"]:
        nor = "and no effect is known to explain it"
    text = f"The residual is not noise, {nor}: held-out error {before}; {scatter}."
    noise, held = CRITERIA.scatter * error["noise"], error["before"]["holdout"]
    if fitted is not None and fitted <= noise:
        left = f"error {_value(report, fitted)} and {before}; {scatter}"
        text = (
            "What the baseline leaves is of the size of noise, but has structure that noise has "
            f"not, {nor}: {left}."
        )
        if held is None or held > noise:
            text = (
                "The fitted readings are what the baseline says within their noise, the held-out "
                f"ones are not, {nor}: {left}."
            )
    best = report["best"]
    if best is not None and best["effects"]:
        names = _listed([effect["name"] for effect in best["effects"]])
        left = _value(report, best["error_fit"])
        text += f" Nearest came {names}, with {left} left in the fitted runs"
        after = best["error_holdout"]
        if after is not None and best["error_fit"] <= noise < after:
            # Else a reader would wonder what it lacks.
            text += f", but {_value(report, after)} in the held-out ones"
        text += "."
        for other in report["instead"]:
            also = _listed([effect["name"] for effect in other["effects"]])
            text += (
                f" What was fitted does not tell it from {also}, which the held-out readings do "
                f"not contradict ({_value(report, other['error_holdout'])}): fit one of these runs "
                "as well to have it decided."
            )
    elif report["candidates"]:
        text += " None comes nearer than the baseline itself, for what it adds."
    return text


def _discovered(report: Mapping[str, Any], before: str, after: str, scatter: str) -> str:
    terms = report["discovered"]
    found = []
    for term in terms:
        depends = f" and depends on the {_variables(term)}" if not term["one_curve"] else ""
        found.append(f"something that acts on the {_acts_on(term)}{depends} ({term['name']})")
    names = [effect["name"] for effect in report["beside"]]
    beside = f", beside {_listed(names)}, which may be part of it" if names else ""
    fitted, noise = report["error"]["after"]["fit"], report["error"]["noise"]
    roughly = fitted > CRITERIA.scatter * noise
    text = (
        f"No known effect explains the residual; {_listed(found)} does{' roughly' * roughly}"
        f"{beside}: held-out error {before} before, {after} after{_foreseen(report)}; {scatter}."
    )
    if roughly:
        text += (
            f" The {_value(report, fitted)} that are left in the fitted runs are more than that: "
            "the law is near such a shape and not of it, or something smaller acts as well."
        )
    text += "".join(_not_told(term) for term in terms if term["rivals"])
    return text + _differing(report)


def _by(report: Mapping[str, Any]) -> str:
    """How much specimens have to differ if no effect makes it, in parameters."""
    groups = dict.fromkeys(group for one in report["in_scatter"] for group in one["groups"])
    shares = [
        f"{100.0 * report['scatter'][group]['share']:.0f} % ({_called(report, group)})"
        for group in groups
        if group in report["scatter"]
    ]
    return f" by {_listed(shares)}" if shares else ""


def _if_alike(report: Mapping[str, Any], *, also: bool = False) -> str:
    """What is not known where one more effect may be what specimens differ by."""
    if not report["in_scatter"]:
        return ""
    names = one_of([one["name"] for one in report["in_scatter"]])
    most = max(one["gain"] for one in report["in_scatter"])
    return (
        f" If they do not, there is {names}{' as well' * also}: that is likelier by {most:.1f} in "
        "−2 log evidence, which does not decide. One specimen, tested both ways and said to be "
        "one, would tell."
    )


def _differing(report: Mapping[str, Any]) -> str:
    """The same beside effects that were found."""
    if not report["in_scatter"]:
        return ""
    return f" Specimens have to differ{_by(report)} for that.{_if_alike(report, also=True)}"


def _not_told(term: Mapping[str, Any]) -> str:
    """What readings cannot tell a term from, in a sentence."""
    whatever = [r for r in term["rivals"] if r.get("in_general")]
    in_general = [r["name"] for r in whatever if "name" in r]
    listed = [r["name"] for r in term["rivals"] if "name" in r and r["name"] not in in_general]
    others = [r for r in term["rivals"] if "name" not in r and r not in whatever]
    if not term["one_curve"]:
        words = [*listed, *(f"the {_acts_on(r)} by {_variables(r)}" for r in others)]
        words = list(dict.fromkeys(words))
        text = f" This data cannot tell {term['name']} from {one_of(words)}." if words else ""
        is_one = f" It is {one_of(in_general)} in a form that is on no list." if in_general else ""
        is_one += "".join(
            f" As a factor of the {r['depends_on'][0]} it is a {_acts_on(r)} by {_variables(r)}."
            for r in whatever
            if "name" not in r
        )
        return is_one + text
    # Laws of all kinds: a long list would only hide that nothing is known of it.
    of = [*term["depends_on"], *(name for r in others for name in r["depends_on"])]
    variables = _listed([v.replace("_", " ") for v in dict.fromkeys(of)])
    listed = list(dict.fromkeys([*in_general, *listed]))
    known = f" It may be {one_of(listed)} in a form that was not tried." if listed else ""
    return (
        f" The readings go one way at one speed: they know the curve of that {_acts_on(term)}, and "
        f"not on which of {variables} it depends.{known}"
    )


def _acts_on(term: Mapping[str, Any]) -> str:
    return str(term["acts_on"]).replace("_", " ")


def _variables(term: Mapping[str, Any]) -> str:
    return _listed([v.replace("_", " ") for v in term["depends_on"]])


def _foreseen(report: Mapping[str, Any]) -> str:
    """What the model expects of a held-out error that is more than noise."""
    expected, found = report["holdout_expected"], report["error"]["after"]["holdout"]
    if expected is None or found is None or found <= CRITERIA.scatter * report["error"]["noise"]:
        return ""
    return f" ({_value(report, expected)} expected)"


def _specimens(report: Mapping[str, Any]) -> Iterator[str]:
    doubtful = {group for one in report["in_scatter"] for group in one["groups"]}
    differ = [
        f"{100.0 * s['share']:.0f} ± {100.0 * s['std']:.0f} % ({_called(report, group)})"
        for group, s in report["scatter"].items()
        if s["share"] > max(SMALL_SCATTER, CRITERIA.significant * s["std"])
        and group not in doubtful
    ]
    if differ:
        yield f"Specimens differ by {', '.join(differ)}."


def _called(report: Mapping[str, Any], group: str) -> str:
    """What specimens differ in together: a parameter, or the effect that several are of."""
    names = group.split()
    every = [*report["effects"], *report["discovered"]]
    of = [effect["name"] for effect in every if set(names) <= set(effect["parameters"])]
    return of[0] if len(names) > 1 and of else ", ".join(names)


def _noise(report: Mapping[str, Any]) -> Iterator[str]:
    noise = report["noise_model"]
    if noise["other_than_stated"]:
        yield f"Readings scatter by other than the {_value(report, noise['stated'])} stated."
    if noise["other_than_white"]:
        yield f"The noise is {noise['words']}."
    if noise["smoothed_over"] is not None:
        return
    if noise["correlation"] > CRITERIA.slow_noise:
        yield "Noise as slow as that cannot be told from a smooth misfit of the model."
    elif (
        report["verdict"] == "no_effect"
        and noise["stated"] is None
        and noise["correlation"] > CRITERIA.slow_beside
    ):
        yield "Nobody has stated it, and some of it may be a smooth misfit of the model."


def _laboratories(report: Mapping[str, Any]) -> Iterator[str]:
    found = []
    for lab in report["laboratories"]:
        name = Path(lab["folder"]).name
        if lab["foretold"] is None or not lab["size"]:
            found.append(f"{name} not at all")
            continue
        error, expected = (100.0 * lab[key] / lab["size"] for key in ("foretold", "expected"))
        found.append(f"{name} within {error:.0f} % (expected {expected:.0f} %)")
    if found:
        zero = ", but for zeros, places and moments of its runs," if report["own_of_runs"] else ""
        yield (
            f"Of each folder's readings{zero} the others foretell, of their size: {_listed(found)}."
        )


def reasons(report: Mapping[str, Any]) -> list[str]:
    """Why the reported model, and no candidate that has a smaller error or a better criterion."""
    own = report["criterion"]["after"]
    tried = [c for c in report["candidates"] if c["criterion"] is not None]
    if own is None or not tried or report["verdict"] == "unexplained":
        return []
    if report["verdict"] == "no_effect":
        added = [effect["name"] for effect in report["model"]["effects"]]
        others = [c for c in tried if c["name"] not in added]
        if not others:
            return []
        best = min(others, key=lambda c: float(c["criterion"]))
        gain = own - best["criterion"]
        if gain < CRITERIA.decisive:
            return [
                f"No effect gains the {CRITERIA.decisive:g} in −2 log evidence that decide: the "
                f"most is {gain:.1f}".replace("-", "−")
                + f", of {best['name']}."
            ]
        return [
            f"{best['name']} gains {gain:.1f}, but its amplitude is not {CRITERIA.significant:g} "
            "standard errors from nothing, or it predicts stretches that are left out no better."
        ]
    terms = terms_of(report)
    named = [e for e in (*report["effects"], *report["beside"]) if e not in terms]
    chosen = [effect["name"] for effect in named] + [term["of"] for term in terms]
    rivals = [name for effect in report["effects"] for name in effect.get("rivals", ())]
    found = []
    for c in (c for c in tried if c["name"] not in chosen):
        smaller = [
            f"{words} {_value(report, c[f'error_{kind}'])} against {_value(report, mine)}"
            for kind, words in (("fit", "fitted"), ("holdout", "held out"))
            if (mine := report["error"]["after"][kind]) is not None
            and c[f"error_{kind}"] is not None
            and c[f"error_{kind}"] < (1.0 - SMALLER) * mine
        ]
        if smaller:
            rival = c["name"] in rivals
            found.append(_weighed(c, ", ".join(smaller), c["criterion"] - own, rival=rival))
    return found


def _weighed(candidate: Mapping[str, Any], smaller: str, loses: float, *, rival: bool) -> str:
    """Why a candidate with a smaller error was not chosen."""
    text = f"{candidate['name']} has a smaller error ({smaller}), "
    if loses < 0.0:
        why = "the data do not decide" if rival else "it did not bear scrutiny"
        return text + f"and its criterion is better by {-loses:.1f}: {why}."
    if loses < CRITERIA.decisive:
        return text + f"its criterion is worse by {loses:.1f}: the data do not decide."
    return text + (
        f"its criterion is worse by {loses:.0f}: with the parameters, forms, noise and scatter "
        "that it needs the fitted readings are less likely."
    )
