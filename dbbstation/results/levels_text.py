"""The three levels in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.inference.levels import RUN, TIME, Differs, FollowsAnswer
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dbbstation.facts.value import Value
    from dbbstation.inference.levels import DifferenceFound, Followed, LawForm, Levels

LIKELY = 0.5
"""Least probability at which the text mentions a property."""

MOST_LISTED = 4
"""Greatest number of variables or laws that are listed by name."""

BAR = 24
"""Characters of the longest bar: a screen of 80 columns then has as many for its label."""

WAYS = {"value": "by value", "direction": "by direction of travel", "late": "late", "in_time": "in time"}


def level_sentences(
    levels: Levels,
    unit: str,
    values: Mapping[str, Mapping[str, Value]],
    *,
    rows: str = "rows",
    what: str = "Measured and simulated values",
) -> list[str]:
    """Return sentences on existence, variables and law of a difference, and on the correction.

    Args:
        values: numbers of laws, by law and number.
    """
    found = [*_difference(levels.differs, unit, what, rows)]
    for one in levels.follows:
        found += _followed(one, unit, values, rows)
    found += _hidden(levels.differs, unit)
    if levels.correction is False:
        found.append(no_correction(levels))
    return found


def short_sentences(levels: Levels, unit: str, what: str) -> tuple[str, ...]:
    """Return two sentences: whether a difference exists, and its main variable with the error in held-out tests."""
    first = next(_difference(levels.differs, unit, what, "tests"))
    largest = max(levels.follows, key=lambda one: one.rms, default=None)
    if largest is None:
        return (first,)
    told = [sentence.strip() for sentence in _followed(largest, unit, {}, "tests")]
    return (first, " ".join(told[:2] if told[1:] and told[1].startswith("Correcting") else told[:1]))


def bars(levels: Levels, unit: str) -> list[str]:
    """Return a chart as text: the error in held-out tests before and after, for each variable and place."""
    classes = [one for one in levels.follows if one.before is not None and one.after is not None]
    sizes = [(word, size, one) for one in classes for word, size in (("before", one.before), ("after", one.after))]
    per = BAR / max((size for _, size, _ in sizes if size), default=1.0)
    return [
        f"{'█' * max(round(per * (size or 0.0)), 1):{BAR}} {size:.2g} {unit} {word}: {place_of(one)}"
        for word, size, one in sizes
    ]


def place_of(one: Followed) -> str:
    """Return the variable and the strut of a class, also from the class's JSON."""
    variables = " and ".join(" or ".join(names) for names in one.variables)
    return ", ".join(text for text in (variables, getattr(one, "where", None)) if text)


def no_correction(levels: Levels) -> str:
    """Return why no correction is offered, as a sentence."""
    if levels.differs.gain is None:
        return "No correction is offered: the corrected values leave more of these rows than the values as simulated."
    return "No correction is offered: the corrected values predict held-out rows no better than as simulated. The refit may be at fault."


def _difference(one: DifferenceFound, unit: str, what: str, rows: str) -> Iterator[str]:
    answer = {
        Differs.YES: f"{what} differ: probability {one.probability:.3f}",
        Differs.NO: f"No effect of {_size(one.matters, unit)} rms or more is there: probability of any effect {one.probability:.2f}",
        Differs.CANNOT_TELL: f"Whether {what[0].lower()}{what[1:]} differ cannot be told: {one.why}",
    }[one.answer]
    if one.answer is Differs.YES and one.why:
        answer += f"; {one.why}"
    elif one.answer is Differs.YES and one.gain is not None:
        answer += f", log density of held-out {rows} {one.gain:+.0f}"
    yield f"{answer}."
    seen = [f"{d.follows} {_size(d.size, unit)}" for d in one.detectable if d.size is not None][:MOST_LISTED]
    if seen and one.answer is not Differs.YES:
        yield f"Smallest effects that are found, rms: {', '.join(seen)}. The noise has {one.independent_samples:.0f} independent samples."
    hidden = [d for d in one.detectable if d.size is not None and d.concealed > LIKELY][:MOST_LISTED]
    for d in (d for d in hidden if d.confirm is None):
        yield f"Fitted parameters take up {100.0 * d.concealed:.0f} % of the squares of an effect over {d.follows}."


def _hidden(one: DifferenceFound, unit: str) -> Iterator[str]:
    named = [d for d in one.detectable if d.size is not None and d.confirm is not None]
    for d in [d for d in named if d.concealed > LIKELY][:MOST_LISTED]:
        share = f"{100.0 * d.concealed:.0f} %"
        if share == "100 %":
            yield f"Fitted parameters can hide {d.follows} wholly. {d.confirm}"
        else:
            yield f"Up to {_size(d.size, unit)} rms of {d.follows} may be hidden: fitted parameters take up {share} of its squares. {d.confirm}"


def _followed(one: Followed, unit: str, values: Mapping[str, Mapping[str, Value]], rows: str) -> Iterator[str]:
    ways = [WAYS[way] for way, probability in one.ways.items() if probability >= LIKELY]
    how = f"probability {one.probability:.3f}{''.join(f', {way}' for way in ways)}, {_size(one.rms, unit)} rms"
    also = f" These {rows} cannot tell it from {_listed(one.or_variables)}." if one.or_variables else ""
    name = place_of(one)
    happened = "Something happened in time" if one.name == TIME else f"It happened once: {name}"
    what = {
        FollowsAnswer.FOLLOWS: f"The difference follows {name}",
        FollowsAnswer.GOES_ON: "The difference goes on in time; no listed variable says it",
        FollowsAnswer.HAPPENED: "Runs differ by an offset" if name == RUN else happened,
        FollowsAnswer.DOES_NOT_PREDICT: f"In these {rows} the difference follows {name}; other {rows} gain nothing by it",
        FollowsAnswer.NOT_TESTED: f"The difference follows {name}; this was not tested on held-out {rows}",
        FollowsAnswer.UNDECIDED: f"The difference may follow {name}; these {rows} do not decide it",
    }[one.answer]
    yield f"{what}: {how}.{also}"
    if (
        one.answer in (FollowsAnswer.FOLLOWS, FollowsAnswer.GOES_ON)
        and one.before is not None
        and one.after is not None
    ):
        yield f"  Correcting it leaves {one.after:.3g} of {_size(one.before, unit)} rms in {rows} that took no part."
    if one.consequence:
        yield f"  {one.name} results from what is simulated: it shows the difference, and is no cause of it."
    elif one.may_result:
        yield f"  {one.name} carries the difference itself: it may be its cause, or result from it. These rows cannot tell."
    if one.form is not None:
        yield f"  {_law(one.form, values, rows)}"
        # A law that is straight states its own slope; beside another law it is only a part of the line.
        stated = len(one.form.names) == 1 and "slope" in values.get(one.form.names[0], {})
        if one.slope is not None and one.straight >= LIKELY and not stated:
            yield f"  The straight line through it over {one.variables[0][0]} has {one.slope.in_words}: {100.0 * one.straight:.0f} % of its squares."


def _law(form: LawForm, values: Mapping[str, Mapping[str, Value]], rows: str) -> str:
    if form.names:
        same = f" These {rows} cannot tell it from {_listed(form.not_worse)}." if form.name and form.not_worse else ""
        laws = "; and ".join(f"{name}{_numbers(values.get(name, {}))}" for name in form.names)
        return f"{'Law' if len(form.names) == 1 else 'Laws, together'}: {laws}.{same}"
    if len(form.not_worse) == 1:
        return f"Law: open. Nothing else is as probable as {form.not_worse[0]}."
    return f"Law: open. These {rows} cannot tell {_listed(form.not_worse)} apart."


def _numbers(values: Mapping[str, Value]) -> str:
    if not values or len(values) > MOST_LISTED:
        return ""
    return f", {', '.join(f'{name} {value.in_words}' for name, value in values.items())}"


def _listed(names: tuple[str, ...]) -> str:
    if len(names) > MOST_LISTED:
        return listed(names, MOST_LISTED)
    return " and ".join(names) if len(names) < 3 else f"{', '.join(names[:-1])} and {names[-1]}"  # noqa: PLR2004 - a pair


def _size(value: float | None, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip() if value is not None else "any size"
