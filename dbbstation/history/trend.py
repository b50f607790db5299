"""Trends of figures over all sessions, one per machine, quantity and circle."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import sqrt
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.history.order import by_time
from dbbstation.history.record import ModelFigures
from dbbstation.history.run_length import chart_for
from dbbstation.history.watch import not_watched, watch
from dbbstation.plan.tolerance import CircleFigure

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.history.record import SessionFigures
    from dbbstation.history.run_length import Chart
    from dbbstation.history.watch import Watched
    from dbbstation.plan.tolerance import Tolerance

    _InSession = tuple["Subject", tuple[int, float, float]]  # session, value, its u

FALSE_ALARMS = 1e-3
"""False alarms per session of a machine over all its quantities: one in a thousand sessions, or nineteen years of
weekly ones. The findings about runs have the same rate."""

LIMITED = {
    "G": CircleFigure.CIRCULAR_DEVIATION,
    "R": CircleFigure.MEAN_RADIAL_ERROR,
    "C": CircleFigure.CENTRE_DEVIATION,
}
"""Figures to which the shop's tolerances apply."""

NOT_WATCHED = frozenset({"C"})
"""A distance, folded at zero, is not normal; X and Y, of which it is made, are watched."""

_FIRST = {"G": 0, "X": 1, "Y": 2, "R": 3, "C": 4}


@dataclass(frozen=True)
class Subject:
    """The quantity of a trend.

    Attributes:
        figure: such as `G`, or a parameter.
        test: empty for a parameter.
        direction: `ccw` or `cw`; empty for a parameter.
        of: circle in words, or a parameter's error source.
        beside: other sources of a parameter's models; only models with equal sources are comparable.
    """

    figure: str
    test: str
    direction: str
    of: str
    unit: str = "µm"
    beside: tuple[str, ...] = ()

    @property
    def is_parameter(self) -> bool:
        """Return whether the quantity is a parameter of models."""
        return not self.test


@dataclass(frozen=True, eq=False)
class Trend:
    """One quantity of one machine over its sessions; arrays have shape (n,).

    Attributes:
        label: unique words within the machine.
        u: standard uncertainty; NaN if not known.
        limit: greatest size by the shop's tolerances.
    """

    subject: Subject
    label: str
    at: NDArray[np.intp]
    values: Floats
    u: Floats
    limit: float | None
    watched: Watched
    why_not: str = ""


@dataclass(frozen=True, eq=False)
class MachineHistory:
    """Sessions and trends of one machine.

    Attributes:
        sessions: in time order.
        chart: limits for each quantity; None if no quantity is watched.
        expected: false alarms expected over this history.
    """

    machine: str
    sessions: tuple[SessionFigures, ...]
    trends: tuple[Trend, ...]
    chart: Chart | None
    expected: float


@dataclass(frozen=True)
class TrendOptions:
    """Options of trends.

    Attributes:
        false_alarms: per session, over all quantities of a machine.
    """

    coverage_factor: float
    tolerances: Sequence[Tolerance] = ()
    false_alarms: float = FALSE_ALARMS
    tests: Sequence[str] = ()
    exclude: Sequence[str] = ()

    def takes(self, test: str) -> bool:
        """Return whether a test is selected."""
        return (not self.tests or test in self.tests) and test not in self.exclude


@with_one_thread
def histories(
    sessions: Sequence[SessionFigures], models: Mapping[str, ModelFigures], asked: TrendOptions
) -> tuple[MachineHistory, ...]:
    """Return the history of every machine, by name.

    Args:
        sessions: dated, without duplicates.
        models: by the SHA-256 of their one session.
    """
    machines = sorted({one.machine for one in sessions})
    return tuple(
        _history(machine, sorted((one for one in sessions if one.machine == machine), key=by_time), models, asked)
        for machine in machines
    )


def _history(
    machine: str, sessions: Sequence[SessionFigures], models: Mapping[str, ModelFigures], asked: TrendOptions
) -> MachineHistory:
    circles = sorted(grouped(_of_circles(sessions, asked)).items(), key=lambda one: _order(one[0]))
    series = dict(circles) | grouped(_of_parameters(sessions, models))
    numbers = {subject: tuple(map(np.array, zip(*one, strict=True))) for subject, one in series.items()}
    reasons = {subject: _why_not(subject, u) for subject, (_, _, u) in numbers.items()}
    count = sum(not reason for reason in reasons.values())
    chart = chart_for(asked.false_alarms / count) if count else None
    labels = _labels(list(series))
    trends = []
    for subject, (at, values, u) in numbers.items():
        unseen = not_watched(len(at))
        looked = unseen if reasons[subject] or chart is None else watch(values, u, chart, asked.coverage_factor)
        limit = _limit(subject, asked.tolerances)
        trends.append(Trend(subject, labels[subject], at, values, u, limit, looked, reasons[subject]))
    looked_at = sum(trend.watched.watched for trend in trends)
    return MachineHistory(
        machine, tuple(sessions), tuple(trends), chart, asked.false_alarms * looked_at / count if count else 0.0
    )


def _why_not(subject: Subject, u: Floats) -> str:
    if subject.figure in NOT_WATCHED and not subject.is_parameter:
        return "watched by X and Y"
    if not np.all(u > 0.0):
        return "its uncertainty is not known"
    return ""


def _of_circles(sessions: Sequence[SessionFigures], asked: TrendOptions) -> Iterator[_InSession]:
    for k, session in enumerate(sessions):
        taken = (run for run in session.runs if asked.takes(run.test))
        runs = grouped(((run.test, run.direction, run.circle), run.figures) for run in taken)
        for (test, direction, circle), repeats in runs.items():
            for place, figure in enumerate(repeats[0]):
                value, u = figure.value_um, figure.stated_u_um
                if len(repeats) > 1:  # most runs have one repeat; means would double the time to open a history
                    value = fmean(figures[place].value_um for figures in repeats)
                    # Averaging removes only independent errors; stated uncertainties are mostly errors common to repeats.
                    u = sqrt(fmean(figures[place].stated_u_um ** 2 for figures in repeats))
                yield Subject(figure.name, test, direction, circle), (k, value, u)


def _order(one: Subject) -> tuple[str, str, str, int]:
    return one.test, one.direction, one.of, _FIRST.get(one.figure, len(_FIRST))


def _of_parameters(sessions: Sequence[SessionFigures], models: Mapping[str, ModelFigures]) -> Iterator[_InSession]:
    for k, model in enumerate(models.get(session.sha256, ModelFigures("", "")) for session in sessions):
        for parameter in model.parameters:
            beside = tuple(sorted(source for source in model.sources if source != parameter.source))
            subject = Subject(parameter.name, "", "", parameter.source, parameter.unit, beside)
            yield subject, (k, parameter.value, np.nan if parameter.u is None else parameter.u)


def _labels(subjects: Sequence[Subject]) -> dict[Subject, str]:
    short = {s: f"{s.of} {s.figure}" if s.is_parameter else f"{s.figure} {s.test} {s.direction}" for s in subjects}
    count = Counter(short.values())
    return {s: name if count[name] == 1 else f"{name} ({_apart(s)})" for s, name in short.items()}


def _apart(subject: Subject) -> str:
    if not subject.is_parameter:
        return subject.of
    return f"beside {', '.join(subject.beside)}" if subject.beside else "alone"


def _limit(subject: Subject, tolerances: Sequence[Tolerance]) -> float | None:
    figure = None if subject.is_parameter else LIMITED.get(subject.figure)
    held = [t.largest_um for t in tolerances if t.figure is figure and t.holds_for(subject.test, subject.direction)]
    return min(held, default=None)
