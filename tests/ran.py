"""Calls that `tests.mutants` puts at chosen places of the package: they note which tests run a place, and put its mutant in force.

The test is known from the environment that pytest sets, and the mutant from it too: programs that a test starts inherit both.
As a plugin this notes how long tests take. Given a plan, it collects tests once and shows each mutant to its own in a fork.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import time
from contextlib import suppress
from pathlib import Path

from _pytest.main import pytest_runtestloop as run_tests

NOTES, PLAN, MUTANT = "MUTANTS_NOTES", "MUTANTS_PLAN", "MUTANTS_NUMBER"
LONGEST_S = 300
"""Tests that take as much processor time, many times their bound, are held up by the mutant: killed."""

_active = int(os.environ.get(MUTANT, "-1"))
_seen: set[tuple[int, str]] = set()
_open, _write, _close = os.open, os.write, os.close


def ran(number: int) -> bool:
    """Note that a place runs and return whether its mutant is in force."""
    test = os.environ.get("PYTEST_CURRENT_TEST", "")
    if (number, test) not in _seen and PLAN not in os.environ:
        _seen.add((number, test))
        _note("ran", number, *test.removesuffix(")").rsplit(" (", 1))
    return number == _active


def pytest_runtest_logreport(report) -> None:
    if PLAN in os.environ:
        if report.failed:
            _note("killed", _active, report.nodeid)
    elif "PYTEST_XDIST_WORKER" not in os.environ:  # the one that shares out the tests hears of all
        _note("took", report.nodeid, report.when, report.outcome, f"{report.duration:.4f}")


def pytest_runtestloop(session) -> bool | None:
    if PLAN not in os.environ:
        return None
    of_id = {item.nodeid: item for item in session.items}
    for number, tests in json.loads(Path(os.environ[PLAN]).read_text(encoding="utf-8")):
        began = time.monotonic()
        child = os.fork()
        if child == 0:
            _show(session, number, [of_id[test] for test in tests if test in of_id])
        _, status = os.waitpid(child, 0)
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what a test that failed had started
        if os.WIFSIGNALED(status):
            _note("killed", number, f"signal {os.WTERMSIG(status)}")
        _note("shown", number, len(tests), f"{time.monotonic() - began:.0f}")
    return True


def _show(session, number: int, items: list) -> None:
    global _active  # noqa: PLW0603 - of this process
    _active = number
    os.environ[MUTANT] = str(number)
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S))
    session.items[:] = items
    try:
        with suppress(session.Failed):
            run_tests(session)
    finally:
        os._exit(0)


def _note(*cells: object) -> None:
    path = os.environ.get(NOTES)
    if path:
        file = _open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        _write(file, ("\t".join(map(str, cells)) + "\n").encode())
        _close(file)
