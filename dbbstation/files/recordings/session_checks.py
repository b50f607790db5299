"""Check a session file against its plan and the disk."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.facts.quantities import USUAL_STROKE_MM, twice
from dbbstation.files.formats.session import SessionFile, sealed_or_part
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.recordings.run_csv import changed
from dbbstation.files.source_text import read_bytes
from dbbstation.files.yaml.schema import dotted, read_document, validate
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from dbbstation.errors import Problem
    from dbbstation.files.formats.session import SetUpReadings
    from dbbstation.files.yaml.text import Location, YamlDocument
    from dbbstation.plan.bar import Bar
    from dbbstation.plan.plan import Plan

_RECORDING = "recording"


def check_runs(document: YamlDocument, plan: Plan | None, folder: Path) -> None:
    """Check runs in the raw data, with plan and disk, independently of other faults."""
    runs = document.entries("runs")
    for key, what in ((("test", "direction", "repeat"), "this run"), (("file",), "this file")):
        values = [tuple(map(str, map(run.get, key))) for _, run in runs]
        for index in twice(values):
            shown = " ".join(values[index])
            text = f"{what} ({shown}) stands here a second time"
            document.fault(runs[index][0], text, "give each run its own repeat and file")
    for location, run in runs:
        test, direction = run.get("test"), run.get("direction")
        if plan is not None and isinstance(test, str):
            if test not in plan.tests:
                what = f"the plan has no test `{test}`: this is a run of another plan"
                document.fault((*location, "test"), what, f"its tests: {', '.join(plan.tests)}")
            elif direction in ("ccw", "cw") and direction not in plan.tests[test].directions:
                what = f"the plan does not run test {test} {direction}: this is a run of another plan"
                document.fault((*location, "direction"), what, "check plan and run")
        _check_file(document, location, run, folder)
        if isinstance(run.get("program"), dict):
            _check_file(document, (*location, "program"), run["program"], folder)


def check_bar(document: YamlDocument, bar: Bar | None, plan: Plan) -> None:
    """Check that the bar can run the circles of the plan."""
    fault = None if bar is None else unlike_bar(bar.calibrated_length_mm, bar.stroke_mm, plan)
    if fault is not None:
        document.fault(("bar", "calibrated_length_mm"), *fault)


def _check_file(document: YamlDocument, location: Location, entry: dict[str, object], folder: Path) -> None:
    file, expected = entry.get("file"), entry.get("sha256")
    if not isinstance(file, str):
        return
    path = sealed_or_part(folder / file)
    if not path.is_file() and entry.get("state") == _RECORDING:
        return  # a run that died: nothing is worked out of it, `check` names it
    if not path.is_file():
        what = f"there is no file `{file}` in the session folder"
        document.fault((*location, "file"), what, "restore it, or take the entry out")
    elif isinstance(expected, str):
        data = read_bytes(path, document.faults, is_input=False)
        if data is not None and sha256_hex(data) != expected:
            document.faults.append(changed(str(path)))


def unlike_bar(length_mm: float, stroke_mm: float | None, plan: Plan) -> tuple[str, str] | None:
    """Return fault and remedy if tests need another bar, or None.

    Args:
        stroke_mm: travel of the gauge either way; None if not known.
    """
    stroke = USUAL_STROKE_MM if stroke_mm is None else stroke_mm
    out = {
        name: test.circle.bar_mm for name, test in plan.tests.items() if abs(test.circle.bar_mm - length_mm) > stroke
    }
    if not out:
        return None
    radii = ", ".join(f"{radius:g}" for radius in sorted(set(out.values())))
    names = listed(list(out), _MOST_NAMED)
    source = "" if stroke_mm is not None else ", as none is stated"
    what = (
        f"a bar of {length_mm:g} mm with a stroke of {stroke:g} mm either way{source} cannot run circles of radius_mm "
        f"{radii} (test {names})"
    )
    return what, "give the calibrated length of the bar that is used (it is held against the plan only), or its plan"


_MOST_NAMED = 4


def readings_in(file: Path, plan: Plan) -> tuple[SetUpReadings, ...]:
    """Return the current readings of a session file, without checking its runs.

    Raises:
        InputError: every fault of the file's text and of its readings.
    """
    faults: list[Problem] = []
    document = read_document(file, SessionFile, faults)
    session = None if document is None else validate(document, SessionFile)
    if document is not None:
        check_set_up_errors(document, plan)
    if session is None or faults:
        raise InputError(faults)
    return session.set_up_errors


def mounted_name(plan: Plan, test: str, mounting: int | None) -> str:
    """Return a mounting's name in its session, by its number, else by the test."""
    return f"{plan.tests[test].ball.name}, {f'test {test}' if mounting is None else f'mounting {mounting}'}"


def check_set_up_errors(document: YamlDocument, plan: Plan | None) -> None:
    """Check readings in the raw data, with runs and plan, independently of other faults."""
    mountings: dict[str, list[Any]] = {}
    for _, run in document.entries("runs"):
        test = run.get("test")
        if isinstance(test, str):
            mountings.setdefault(test, []).append(run.get("mounting"))
    first: dict[str, Location] = {}
    for location, entry in document.entries("set_up_errors"):
        test, mounting = entry.get("test"), entry.get("mounting")
        if plan is None or not isinstance(test, str):
            continue
        if test not in plan.tests:
            what = f"{dotted(location)}: the plan has no test `{test}`"
            document.fault((*location, "test"), what, f"its tests: {', '.join(plan.tests)}")
            continue
        ball = plan.tests[test].ball
        if ball.place_known:
            what = f"{dotted(location)}: the ball `{ball.name}` of test {test} was measured by the CMM"
            remedy = "set-up errors are read of balls that the plan puts up under the spindle"
            document.fault((*location, "test"), what, remedy)
        if mounting not in mountings.get(test, []):
            _tell_mounting(document, location, test, mounting, mountings.get(test, []))
        other = first.setdefault(mounted_name(plan, test, mounting), location)
        if other is not location:
            what = f"{dotted(location)}: this is the mounting of {dotted(other)} a second time"
            document.fault(location, what, "keep one of the two")


def _tell_mounting(document: YamlDocument, location: Location, test: str, mounting: object, there: list[Any]) -> None:
    numbers = ", ".join(dict.fromkeys(str(number) for number in there if number is not None))
    if not there:
        document.fault((*location, "test"), f"{dotted(location)}: test {test} has no run", "check the test")
    elif mounting is None:
        what = f"{dotted(location)}: the runs of test {test} have mounting numbers, the entry has none"
        document.fault(location, what, f"give `mounting`: {numbers}")
    else:
        what = f"{dotted(location)}: no run of test {test} has the mounting {mounting}"
        remedy = f"its mountings: {numbers}" if numbers else "its runs have no numbers: leave `mounting` out"
        document.fault((*location, "mounting"), what, remedy)
