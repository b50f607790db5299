"""Verdicts on single causes, from the answers about their classes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.inference.levels import JOINED, FollowsAnswer
from dbbstation.inference.pushes import too_many, within_a_step
from dbbstation.inference.verdict import OUT, SURE, Acts, Verdict

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.facts.value import Value
    from dbbstation.inference.levels import Followed, Levels
    from dbbstation.inference.settled import Settled
    from dbbstation.laws.contract import Texts

Said = tuple[Verdict, tuple[str, ...], str]
"""A verdict, alternative causes, and the reason."""


def ambiguous(rows: str, others: Sequence[str], otherwise: str) -> Said:
    """Return the verdict on a cause of which the rows do not decide.

    Args:
        others: alternative causes; without any, `otherwise` is the reason.
    """
    text = f"These {rows} cannot tell it from {', '.join(others)}." if others else otherwise
    return Verdict.AMBIGUOUS, tuple(others), text


def with_texts(verdict: Verdict, text: str, texts: Texts) -> str:
    """Return the reason of a verdict, with what a present cause is, and with the measurement that confirms a possible one."""
    what = texts.what if verdict.is_there else ""
    return " ".join(part for part in (what, text, texts.confirm) if part) if verdict.may_be_there else text


def open_to(rows: str) -> Said:
    """Return the verdict on a cause that is neither shown nor excluded."""
    return Verdict.NOT_TESTABLE, (), f"These {rows} leave it open: they neither show nor exclude it."


MAKES_UP = "Held-out parts are predicted worse than as simulated, and something beside it predicts none: this may make up for that."
"""Why a single event is uncertain: its probability assumes effects that other rows refute."""


@dataclass(frozen=True, eq=False)
class VerdictsByLevel:
    """Verdicts on members of the best set and on equivalent causes.

    Attributes:
        pushes: sizes of all stretches of time, by member.
    """

    settled: Settled
    levels: Levels
    pushes: Mapping[str, Sequence[Value]]

    def of_member(self, name: str, probability: float, sigmas: float, acts: Acts) -> Said:
        """Return the verdict on a member, given its size in standard deviations.

        A class may be certain although each of its members is uncertain. Held-out parts cannot refute a single member then.
        """
        rows, classes = self.settled.channel.rows_are, [one for one in self.levels.follows if name in one.members]
        answers = {one.answer for one in classes}
        unsure = probability < SURE and FollowsAnswer.DOES_NOT_PREDICT in answers
        if unsure or FollowsAnswer.UNDECIDED in answers:
            return ambiguous(rows, (), f"These {rows} do not decide it.")
        if sigmas < OUT:
            return Verdict.AMBIGUOUS, (), f"Its effect is only {sigmas:.2g} standard deviations out."
        if acts is Acts.ONCE or any(one.in_time for one in classes):
            return self._happened(name)
        if FollowsAnswer.DOES_NOT_PREDICT in answers:
            why = f"It was found in these {rows}, and held-out parts gain nothing by it."
            return Verdict.DOES_NOT_PREDICT, (), why
        if FollowsAnswer.NOT_TESTED in answers and self.levels.correction is False:
            why = "With everything that was found these rows are left worse than as simulated."
            return Verdict.DOES_NOT_PREDICT, (), why
        return _of_laws(classes, name, rows)

    def instead_of(self, name: str) -> frozenset[str]:
        """Return members that a named law replaces."""
        return frozenset[str]().union(*(one.members for one in self.levels.follows if _named(one, name)))

    def alike(self, name: str) -> str:
        """Return a member equivalent to a cause outside the set, or an empty text."""
        for one in self.levels.follows:
            if one.form is not None and name in (*one.form.not_worse, *one.form.names):
                return next(other for other in (*one.form.names, *sorted(one.members)) if other != name)
        return ""

    def equivalent(self, name: str) -> tuple[str, ...]:
        """Return a named law and its equivalents; empty if no law is named."""
        forms = [one.form for one in self.levels.follows if one.form is not None and one.form.name == name]
        same = dict.fromkeys(other for form in forms for other in form.not_worse)
        return (name, *same) if same else ()

    def _happened(self, name: str) -> Said:
        every = [size for own in self.pushes.values() for size in own]
        if name in self.pushes and (
            why := within_a_step(self.pushes[name], self.settled.channel.step) or too_many(every)
        ):
            return Verdict.AMBIGUOUS, (), why
        refuted = any(one.answer is FollowsAnswer.DOES_NOT_PREDICT for one in self.levels.follows)
        if refuted and self.levels.correction is False:
            return Verdict.AMBIGUOUS, (), MAKES_UP
        return Verdict.HAPPENED, (), ""


def _named(one: Followed, name: str) -> bool:
    return one.form is not None and name in one.form.names


def _of_laws(classes: Sequence[Followed], name: str, rows: str) -> Said:
    if all(_named(one, name) for one in classes):
        return Verdict.IDENTIFIED, (), ""
    forms = [one.form for one in classes if one.form is not None and not _named(one, name)]
    rivals = [form.rivals.get(name) or (*form.names, *form.not_worse) for form in forms]
    others = tuple(dict.fromkeys(n for names in rivals for n in names if n != name and JOINED not in n))
    return ambiguous(rows, others, "No single law was named here.")
