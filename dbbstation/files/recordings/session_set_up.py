"""Read micrometer readings of balls under the spindle, one entry per mounting."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.session import SessionFile
from dbbstation.files.yaml.schema import dotted, read_document, validate

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from dbbstation.errors import Problem
    from dbbstation.files.formats.session import SetUpReadings
    from dbbstation.files.yaml.text import Location, YamlDocument
    from dbbstation.plan.plan import Plan


def readings_in(file: Path, plan: Plan) -> tuple[SetUpReadings, ...]:
    """Return the current readings of a session file, without checking its runs.

    Raises:
        InputError: every fault of the file's text and of its readings.
    """
    faults: list[Problem] = []
    document = read_document(file, SessionFile, faults)
    session = None if document is None else validate(document, SessionFile, faults)
    if document is not None:
        check_set_up_errors(document, plan, faults)
    if session is None or faults:
        raise InputError(faults)
    return session.set_up_errors


def mounted_name(plan: Plan, test: str, mounting: int | None) -> str:
    """Return a mounting's name in its session, by its number, else by the test."""
    return f"{plan.tests[test].ball.name}, {f'test {test}' if mounting is None else f'mounting {mounting}'}"


def check_set_up_errors(document: YamlDocument, plan: Plan | None, faults: list[Problem]) -> None:
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
            faults.append(document.problem((*location, "test"), what, f"its tests: {', '.join(plan.tests)}"))
            continue
        ball = plan.tests[test].ball
        if ball.place_known:
            what = f"{dotted(location)}: the ball `{ball.name}` of test {test} was measured by the CMM"
            remedy = "set-up errors are read of balls that the plan puts up under the spindle"
            faults.append(document.problem((*location, "test"), what, remedy))
        if mounting not in mountings.get(test, []):
            faults.append(_no_such_mounting(document, location, test, mounting, mountings.get(test, [])))
        other = first.setdefault(mounted_name(plan, test, mounting), location)
        if other is not location:
            what = f"{dotted(location)}: this is the mounting of {dotted(other)} a second time"
            faults.append(document.problem(location, what, "keep one of the two"))


def _no_such_mounting(
    document: YamlDocument, location: Location, test: str, mounting: object, there: list[Any]
) -> Problem:
    numbers = ", ".join(dict.fromkeys(str(number) for number in there if number is not None))
    if not there:
        return document.problem((*location, "test"), f"{dotted(location)}: test {test} has no run", "check the test")
    if mounting is None:
        what = f"{dotted(location)}: the runs of test {test} have mounting numbers, the entry has none"
        return document.problem(location, what, f"give `mounting`: {numbers}")
    what = f"{dotted(location)}: no run of test {test} has the mounting {mounting}"
    remedy = f"its mountings: {numbers}" if numbers else "its runs have no numbers: leave `mounting` out"
    return document.problem((*location, "mounting"), what, remedy)
