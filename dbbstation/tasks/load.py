"""Load recorded sessions as observations: files, traces and NC programs."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.counted import counting, uncounted
from dbbstation.errors import InputError, Problem, StationError, refuse
from dbbstation.files.formats.session import RunEntry, RunState
from dbbstation.files.recordings.session import SessionFolder, opened
from dbbstation.files.source_text import text_of
from dbbstation.machine.geometry import differences, in_words
from dbbstation.model.observation import Observation
from dbbstation.sources.contract import Thermometer
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.declare import paths_of
from dbbstation.tasks.telling import READING, Telling, never, silent
from dbbstation.trace.cut import cut
from dbbstation.trace.recording import logged_curve

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.counted import Counted
    from dbbstation.machine.geometry import Machine
    from dbbstation.tasks.telling import Progress
    from dbbstation.trace.recording import RawCircle, Recording


@dataclass(frozen=True, eq=False)
class Recorded:
    """Accepted runs of one or more sessions of one machine.

    Attributes:
        machine: nominal machine, equal in all sessions; it has the first session's name.
    """

    machine: Machine
    observations: tuple[Observation, ...]
    sessions: Mapping[str, str]
    warnings: tuple[str, ...]


Sessions = str | PathLike[str] | Iterable[str | PathLike[str]]
"""One session or several: folders or session files."""


def load(
    sessions: Sessions,
    *,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> Recorded:
    """Read sessions of one machine: accepted runs cut to circles, with their commands.

    Args:
        sessions: folders or session files.
        tests: names; empty for all.
        exclude: names of tests.
        progress: called with each stage.
        stop: called after each run.
        say: called with notes.

    Raises:
        InputError: as `load_sessions`.
        StoppedError: `stop` returned True.
    """
    return loaded(sessions, tests, exclude, Telling(progress, stop, say))


def loaded(sessions: Sessions | Recorded, tests: Sequence[str], exclude: Sequence[str], telling: Telling) -> Recorded:
    """Return sessions with the chosen tests; paths are read.

    Args:
        tests: names; empty for all.

    Raises:
        InputError: as `load_sessions`; or no run is left.
    """
    if not isinstance(sessions, Recorded):
        found = load_sessions(paths_of(sessions), exclude, telling.counted(READING), tests)
        telling.note(*found.warnings)
        return found
    if not tests and not exclude:
        return sessions
    left = [o for o in sessions.observations if (not tests or o.test in tests) and o.test not in exclude]
    unknown = [name for name in (*tests, *exclude) if name not in {o.test for o in sessions.observations}]
    if unknown or not left:
        what = f"no session has a test {', '.join(unknown)}" if unknown else "no accepted run is left"
        raise InputError.of(", ".join(sessions.sessions), what, "name others")
    return replace(sessions, observations=tuple(left))


def load_sessions(
    paths: Sequence[Path | SessionFolder],
    exclude: Sequence[str] = (),
    progress: Counted = uncounted,
    only: Sequence[str] = (),
) -> Recorded:
    """Read sessions, cut accepted runs to circles and attach commands.

    Args:
        paths: folders or session files, or their content.
        only: tests; empty for all.

    Raises:
        InputError: faults of files and traces; a repeated session; different machines; no accepted run; unknown tests.
    """
    sessions = _unique_names(with_tests(paths, only, exclude))
    warnings = _check_one_machine(sessions)
    exclude = [*exclude, *(test for one in sessions for test in one.plan.tests if only and test not in only)]
    observations: list[Observation] = []
    problems: list[Problem] = []
    logs: dict[str, list[tuple[float, Recording]]] = {}
    readings: dict[bytes, SessionFolder] = {}
    copied: Counter[tuple[Path, Path]] = Counter()
    for session in sessions:
        wanted = [run for run in session.accepted if run.test not in exclude]
        unjudged = session.in_state(RunState.COMPLETE, RunState.RECORDING)
        warnings += [f"{session.name}: run {run.label} is {run.state}, not accepted: left out" for run in unjudged]
        logged: list[tuple[float, Recording]] = []
        for run in counting(wanted, progress):
            try:
                # One recording at a time is in memory; its turn is what stays.
                read = session.load(run)
                warnings += [str(warning) for warning in (*read.warnings, *session.loss(run, read.recording))]
                # Equal for copies with other comments. A copy that counts twice would wrongly halve the variance.
                samples = read.recording.t_s.tobytes() + read.recording.length_mm.tobytes()
                same = readings.setdefault(hashlib.sha256(samples).digest(), session)
                if same is not session:
                    copied[session.folder, same.folder] += 1
                began = session.started_s(run)
                if began is not None and read.recording.temperature_degc:
                    logged.append((began, read.recording))
                lost = 0 if run.counts is None else run.counts.lost
                raw = cut(replace(read.recording, name=str(run.path)), session.circle(run), counted_lost=lost)
                observations.append(_observation(session, run, raw))
            except InputError as error:
                problems += error.problems
            except StationError as error:
                problems.append(Problem.of(run.path, error.what, error.remedy))
        warnings += _under_spindle(session, wanted)
        logs[session.name] = [*logged, *_left_out(session, exclude)] if logged else []
    problems += [
        Problem.of(copy, f"{count} runs repeat recordings of {first}", "give every recording once")
        for (copy, first), count in copied.items()
    ]
    refuse(problems)
    if not observations:
        raise no_run_left(sessions)
    under_correction = {session.name: session.machine for session in sessions if session.machine.control is not None}
    observations = [_under(under_correction.get(one.setup.session), one) for one in observations]
    warnings += [
        f"{name}: its control corrects by itself: {one.control.said}"
        for name, one in under_correction.items()
        if one.control
    ]
    observations = _with_thermometers(_with_shared_balls(observations, sessions), logs)
    hashes = {session.name: session.sha256 for session in sessions}
    return Recorded(sessions[0].machine, tuple(observations), hashes, tuple(warnings))


def _observation(session: SessionFolder, run: RunEntry, raw: RawCircle) -> Observation:
    observation = Observation(
        run.test, run.repeat, raw, session.setup(run, raw.temperature_degc), session.started_s(run)
    )
    if run.program is None:
        return observation
    from dbbstation.nc.commanded import commanded_poses

    path = run.program.path
    text = text_of(path, is_input=False)  # its hash stands in the session
    poses = commanded_poses(text, str(path), observation, session.machine.hexapod.rotation)
    return replace(observation, commanded=poses)


def _under(machine: Machine | None, observation: Observation) -> Observation:
    if machine is None:
        return observation
    from dbbstation.control.commands import nominal_commands

    poses = np.vstack([observation.motion().poses, observation.standing_pose])
    commands = nominal_commands(machine, poses, known_sources())
    return replace(observation, commanded=commands[:-1], stood=commands[-1])


def _under_spindle(session: SessionFolder, runs: Sequence[RunEntry]) -> list[str]:
    """Return a note on balls under the spindle, whose centres contain no position errors of the machine [CAL III-A]."""
    tests = dict.fromkeys(run.test for run in runs if not session.plan.tests[run.test].ball.place_known)
    if not tests:
        return []
    where = "every test" if len(tests) == len({run.test for run in runs}) else f"test {', '.join(tests)}"
    what = f"{session.name}: the ball was put up under the spindle in {where}"
    shows = (
        "centre deviations there, and rms values with them, show how it was put up, less what a micrometer read of that"
    )
    return [f"{what}: {shows}, and not how far the machine is off; circularity counts"]


def _with_shared_balls(observations: Sequence[Observation], sessions: Sequence[SessionFolder]) -> list[Observation]:
    """Give a ball of one CMM sheet the same name in all sessions, so that it has a single error."""
    names: dict[tuple[object, ...], str] = {}
    of = {session.name: session for session in sessions}
    shared = []
    for observation in observations:
        ball = of[observation.setup.session].plan.tests[observation.test].ball
        sheet = (ball.name, ball.bore, ball.holder, ball.centre_mm, ball.uncertainty_mm)
        name = names.setdefault(sheet, observation.setup.ball)
        shared.append(replace(observation, setup=replace(observation.setup, ball=name)))
    return shared


def _with_thermometers(
    observations: Sequence[Observation], logs: Mapping[str, Sequence[tuple[float, Recording]]]
) -> list[Observation]:
    of = {}
    for session, runs in logs.items():
        known = (set(o.raw.temperature_degc) for o in observations if o.setup.session == session)
        names = sorted(set.intersection(*known)) if runs else []
        of[session] = {name: _thermometer(name, runs) for name in names}
    return [replace(o, setup=replace(o.setup, thermometers=of[o.setup.session])) for o in observations]


def _thermometer(name: str, runs: Sequence[tuple[float, Recording]]) -> Thermometer:
    logs = [(began + run.t_s, run.temperature_degc) for began, run in runs]
    return Thermometer(*logged_curve([(time_s, degc[name]) for time_s, degc in logs if name in degc]))


def _left_out(session: SessionFolder, exclude: Sequence[str]) -> list[tuple[float, Recording]]:
    found = []
    for run in session.accepted:
        began = session.started_s(run)
        if run.test not in exclude or began is None:
            continue
        try:
            found.append((began, session.load(run).recording))
        except InputError:
            continue  # its faults are why it was left out
    return found


def _unique_names(sessions: list[SessionFolder]) -> list[SessionFolder]:
    names = [session.name for session in sessions]
    return [
        replace(session, name=f"{session.name} ({names[: k + 1].count(session.name)})")
        if names.count(session.name) > 1
        else session
        for k, session in enumerate(sessions)
    ]


def _check_one_machine(sessions: Sequence[SessionFolder]) -> list[str]:
    first = sessions[0]
    told, faults = [], []
    for other in sessions[1:]:
        serials = first.serial_number, other.serial_number
        if all(serials) and serials[0] != serials[1]:
            what = f"it is of machine {serials[1]}, {first.folder} of machine {serials[0]}"
            faults.append(Problem.of(other.folder, what, "choose sessions of one machine"))
        elif unlike := differences(first.machine, other.machine):
            what = (
                f"its machine file is not that of {first.folder}: {in_words(unlike)}, in {first.name} and {other.name}"
            )
            remedy = (
                "fit sessions together only where the control had the same joints and reference lengths; where it had, "
                "correct the wrong machine.yaml, so that both say the same"
            )
            faults.append(Problem.of(other.machine_path, what, remedy))
        elif first.machine.name != other.machine.name:
            names = f"{first.machine.name} in {first.name}, {other.machine.name} in {other.name}"
            told.append(f"the machine files have two names ({names}) and agree in all values: taken for one machine")
    refuse(faults)
    return told


def with_tests(
    paths: Sequence[Path | SessionFolder], tests: Sequence[str], exclude: Sequence[str]
) -> list[SessionFolder]:
    """Read session files; refuse unknown names of tests."""
    sessions = [opened(path) for path in paths]
    every = {test for session in sessions for test in session.plan.tests}
    for named, why in ((exclude, " to exclude"), (tests, "")):
        if unknown := [name for name in named if name not in every]:
            what = f"no session has a test {', '.join(unknown)}{why}"
            raise InputError.of(sessions[0].folder, what, f"tests are {', '.join(sorted(every))}")
    return sessions


def no_run_left(sessions: Sequence[SessionFolder]) -> InputError:
    """Return the error of sessions without a run to work on."""
    places = ", ".join(str(session.folder) for session in sessions)
    return InputError.of(places, "no accepted run is left", "accept a run, or exclude fewer tests")
