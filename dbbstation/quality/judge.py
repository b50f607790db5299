"""Compute all findings of a session's runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from dbbstation.computing.arrays import norm_of
from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.quality.all_runs import AllForms, bar_of_all, programs_of_all
from dbbstation.quality.between import direction, local_difference, locally_apart_um, other_direction, repeat
from dbbstation.quality.copied import copied
from dbbstation.quality.finding import Finding, Name, stricter
from dbbstation.quality.knowledge import Others, Run, Seen, across, apart_um, seen
from dbbstation.quality.place import bore, form, radius
from dbbstation.quality.single import by_itself, scale
from dbbstation.quality.stated import sigmas_apart
from dbbstation.quality.swapped import of_its_test
from dbbstation.quality.together import expected_beside, together

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis


@dataclass(frozen=True, eq=False)
class Judgement:
    """Findings of one run.

    Attributes:
        analysis: without filter; None without circle.
        findings: in the order of `Name`.
    """

    run: Run
    analysis: CircleAnalysis | None
    findings: tuple[Finding, ...]

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Return findings beyond their limit."""
        return tuple(finding for finding in self.findings if finding.wrong)


@with_one_thread
def judge(runs: Sequence[Run]) -> tuple[Judgement, ...]:
    """Judge each run of a session, using all others."""
    known = list(map(seen, runs))
    session = SessionRuns(known)
    return tuple(session.judge(one) for one in known)


@dataclass(frozen=True, eq=False)
class _Pair:
    one: Seen
    other: Seen

    def has(self, run: Seen) -> bool:
        """Return whether a run belongs to the pair."""
        return run is self.one or run is self.other

    @cached_property
    def apart_um(self) -> tuple[float, float]:
        """Return `knowledge.apart_um` of both runs."""
        return apart_um(self.one, self.other)

    @cached_property
    def sigmas(self) -> float | None:
        """Return `stated.sigmas_apart` of both runs."""
        return sigmas_apart(self.one, self.other)

    @cached_property
    def local_um(self) -> float | None:
        """Return the local difference [µm]; None for too few samples."""
        known = self.one.local_um.any() and self.other.local_um.any()
        return locally_apart_um(self.one, self.other) if known else None


class SessionRuns:
    """Analysed runs of a session and their pairs, to judge one of them or a new run.

    Args:
        known: results for other runs of the same session, whose pairs and forms are reused.
    """

    def __init__(self, runs: Sequence[Seen], known: SessionRuns | None = None) -> None:
        self._runs = [one for one in runs if one.analysis is not None]
        self._of_test = grouped((one.run.test, one) for one in self._runs)
        self._pairs: dict[tuple[Seen, Seen], _Pair] = {} if known is None else known._pairs  # noqa: SLF001 - the same class
        self._without: SessionRuns | None = None if known is None else known._without  # noqa: SLF001
        self._forms: AllForms = AllForms() if known is None else known._forms  # noqa: SLF001
        taken: set[int] = set()
        self._directions, self._repeats = [], []
        for one in self._runs:
            match = self._opposite(one)
            # Different mountings scatter, so they do not show the machine's own reversal.
            if match is not None and id(match) not in taken and match.run.mounting == one.run.mounting:
                taken.add(id(one))
                self._directions.append(self._pair(one, match))
            if (earlier := self._earlier(one)) is not None:
                self._repeats.append(self._pair(one, earlier))

    def _pair(self, one: Seen, other: Seen) -> _Pair:
        return self._pairs.setdefault((one, other), _Pair(one, other))

    @with_one_thread
    def judge(self, one: Seen) -> Judgement:
        """Judge one run of the same session."""
        others = self._others(one)
        findings = list(by_itself(one, others))
        if one.analysis is not None:
            findings.append(copied(one, others.every))
            known = self._beside(one, one.analysis, others)
            if one.run.usual is not None:
                without = self._without_model._beside(one.without_model, one.analysis)  # noqa: SLF001 - the same class
                known = [stricter(by_model, by_usual) for by_model, by_usual in zip(known, without, strict=True)]
            findings += known
        order = list(Name)
        findings.sort(key=lambda finding: order.index(finding.name))
        return Judgement(one.run, one.analysis, tuple(findings))

    @cached_property
    def _without_model(self) -> SessionRuns:
        self._without = SessionRuns([one.without_model for one in self._runs], self._without)
        return self._without

    def _beside(self, one: Seen, analysis: CircleAnalysis, others: Others | None = None) -> list[Finding]:
        others = others or self._others(one)
        both = together(one, self._runs if one in self._runs else [*self._runs, one], self._forms.planned)
        by_others = expected_beside(both)
        expected = by_others or one.run.expected
        by = "" if by_others is None else " by the other tests"
        return [
            direction(one, others, expected),
            of_its_test(one, both),
            radius(analysis, expected, by),
            bore(analysis, expected, by),
            form(one, expected, by),
            scale(one, others),
            other_direction(one, others),
            repeat(one, others),
            local_difference(one, others),
            *(self if one in self._runs else SessionRuns([*self._runs, one], self))._of_all,  # noqa: SLF001 - the same class
        ]

    @cached_property
    def _of_all(self) -> tuple[Finding, Finding]:
        by_model = any(one.run.usual is not None for one in self._runs)
        return programs_of_all(self._runs, self._forms), bar_of_all(self._runs, self._forms, by_model=by_model)

    def _others(self, one: Seen) -> Others:
        directions = [pair for pair in self._directions if not pair.has(one)]
        repeats = [pair for pair in self._repeats if not pair.has(one)]
        analyses = [o.analysis for o in self._runs if o is not one and o.analysis is not None]
        return Others(
            noise_um=tuple(a.noise.reading_um for a in analyses),
            closure_um=tuple((a.closure.height_um, a.closure.u_um) for a in analyses if a.closure is not None),
            drift_um=tuple(o.drift_um for o in self._runs if o is not one and o.drift_um is not None),
            longer_s=tuple(o.longer_s for o in self._runs if o is not one and o.longer_s is not None),
            directions_um=tuple(pair.apart_um for pair in directions),
            repeats_um=tuple(pair.apart_um for pair in repeats),
            directions_stated=tuple(pair.sigmas for pair in directions if pair.sigmas is not None),
            repeats_stated=tuple(pair.sigmas for pair in repeats if pair.sigmas is not None),
            across_um=tuple(norm_of(across(pair.one) - across(pair.other)) for pair in directions),
            local_um=tuple(pair.local_um for pair in directions if pair.local_um is not None),
            opposite=self._opposite(one),
            earlier=self._earlier(one),
            every=tuple(other for other in self._runs if other is not one),
        )

    def _alike(self, one: Seen, *, turned: bool) -> list[Seen]:
        way = one.run.circle.direction
        return [o for o in self._of_test.get(one.run.test, ()) if (o.run.circle.direction is not way) is turned]

    def _opposite(self, one: Seen) -> Seen | None:
        def nearness(other: Seen) -> tuple[bool, bool, int]:
            return other.run.mounting == one.run.mounting, other.run.repeat == one.run.repeat, other.run.repeat

        return max(self._alike(one, turned=True), key=nearness, default=None)

    def _earlier(self, one: Seen) -> Seen | None:
        earlier = [other for other in self._alike(one, turned=False) if other.run.repeat < one.run.repeat]
        return max(earlier, key=lambda other: other.run.repeat, default=None)
