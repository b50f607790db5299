"""Read sessions and compute the figures of their runs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.analysis import analyse, analyse_pair, refiltered
from dbbstation.circles.budget import SetUpKnowledge
from dbbstation.computing.counted import counting, uncounted
from dbbstation.computing.grouped import grouped
from dbbstation.errors import TraceError
from dbbstation.files.recordings.judged import judge_session
from dbbstation.results.circles import Circled, MeasuredCircle, MeasuredPair
from dbbstation.tasks.load import no_run_left, with_tests
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.circles.path import Filter
    from dbbstation.computing.counted import Counted
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.bar import Bar
    from dbbstation.plan.plan import Ball
    from dbbstation.quality.judge import Judgement
    from dbbstation.trace.recording import Recording


def load_circles(
    paths: Sequence[Path | SessionFolder],
    chosen: Filter,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    *,
    findings: bool = False,
    model: IdentifiedModel | None = None,
    progress: Counted = uncounted,
) -> Circled:
    """Read sessions and compute the figures of accepted runs.

    Findings compare each run with all accepted runs, also of excluded tests.

    Args:
        chosen: filter of G, F and H.
        model: gives expected circles; None: the nominal machine.

    Raises:
        InputError: every fault of every file; no accepted run; an unknown test.
    """
    sessions = with_tests(paths, tests, exclude)
    circles: list[MeasuredCircle] = []
    pairs: list[MeasuredPair] = []
    warnings: list[str] = []
    for session in sessions:
        accepted = session.accepted
        used = [run for run in accepted if (not tests or run.test in tests) and run.test not in exclude]
        read = session.load_all(accepted if findings else used)
        recordings = {run.path: file.recording for run, file in zip(accepted if findings else used, read, strict=True)}
        judged = judge_session(session, [(run, recordings[run.path]) for run in accepted], model) if findings else ()
        judgements = {run.path: judgement for run, judgement in zip(accepted, judged, strict=False)}
        of_session = []
        for run in counting(used, progress):
            circle = _measured(session, run, recordings[run.path], chosen, judgements.get(run.path))
            of_session.append(circle)
            if circle.problem:
                warnings.append(f"{session.name}: run {run.label} shows no circle: {circle.problem}")
        circles += of_session
        pairs += _pairs(session, of_session)
        warnings += _many(session, used)
    if not circles:
        raise no_run_left(sessions)
    return Circled(tuple(circles), tuple(pairs), tuple(warnings), tuple(sessions))


def _many(session: SessionFolder, runs: Sequence[RunEntry]) -> list[str]:
    of = grouped((f"{run.test} {run.direction}", str(run.repeat)) for run in runs)
    return [
        f"{session.name}: {len(repeats)} runs of {circle} are accepted ({', '.join(sorted(repeats, key=int))}): all are shown, and a fit "
        "takes all of them"
        for circle, repeats in of.items()
        if len(repeats) >= MANY
    ]


MANY = 3
"""Number of accepted runs of one circle and direction from which on a note states them."""


def _measured(
    session: SessionFolder, run: RunEntry, recording: Recording, chosen: Filter, judgement: Judgement | None
) -> MeasuredCircle:
    known = _known(session, run, recording)
    corrected = _corrected(session, recording)
    try:
        if judgement is not None and judgement.analysis is not None and corrected is recording:
            analysis = refiltered(judgement.analysis, chosen)
        else:
            named = replace(corrected, name=run.label)
            analysis = analyse(cut(named, session.circle(run)), named, chosen)
    except TraceError as error:
        problem = f"{error.what}; {error.remedy}" if error.remedy else error.what
        return MeasuredCircle(session.name, run, None, problem, known, judgement)
    return MeasuredCircle(session.name, run, analysis, "", known, judgement)


def _corrected(session: SessionFolder, recording: Recording) -> Recording:
    """Return a recording minus the bar's excess, as a fit treats it (`Setup.bar_reads_long_mm`)."""
    if session.bar is None:
        return recording
    long_mm, _ = session.bar.reads_long_mm(session.bar_temp_c(recording.temperature_degc))
    return recording if long_mm == 0.0 else replace(recording, length_mm=recording.length_mm - long_mm)


def _known(session: SessionFolder, run: RunEntry, recording: Recording) -> SetUpKnowledge:
    bar, setup = session.bar, session.setup(run)
    measured_c = session.bar_temp_c(recording.temperature_degc)
    lacks = ("calibrated length of the bar",) if bar is None else bar.lacks(measured_c)
    grown_mm = None if bar is None else bar.grown_uncertainty_mm(measured_c)
    scatter = np.zeros(3) + setup.mounting_repeatability_mm
    ball_um = 1e3 * np.hypot(scatter, setup.ball_uncertainty_mm)
    return SetUpKnowledge(
        u_bar_um=None if bar is None else 1e3 * bar.calibrator_uncertainty_mm,
        u_temperature_um=None if grown_mm is None else 1e3 * grown_mm,
        not_absolute=f"not absolute, because the session does not state: {', '.join(lacks)}" if lacks else "",
        u_ball_um=float(max(ball_um[:2])) if setup.place_known else None,
        u_ball_z_um=float(ball_um[2]) if setup.place_known else None,
        u_form_um=None if bar is None else _form_um(bar, session.plan.tests[run.test].ball),
    )


def _form_um(bar: Bar, ball: Ball) -> float | None:
    """Return the standard uncertainty due to both balls' form, assumed rectangular [GUM 4.3.7]; None if unknown."""
    if bar.ball_form_um is None or ball.form_um is None:
        return None
    return float(np.hypot(bar.ball_form_um, ball.form_um) / np.sqrt(3.0))


def _pairs(session: SessionFolder, circles: Sequence[MeasuredCircle]) -> list[MeasuredPair]:
    first: dict[tuple[str, int, str], MeasuredCircle] = {}
    pairs = []
    for circle in circles:
        if circle.analysis is None:
            continue
        key = (circle.entry.test, circle.entry.repeat, session.setup(circle.entry).mounting)
        before = first.setdefault(key, circle)
        if before is not circle and before.analysis is not None:
            pairs.append(MeasuredPair(before, circle, analyse_pair(before.analysis, circle.analysis)))
    return pairs
