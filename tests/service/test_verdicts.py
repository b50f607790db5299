"""Verdicts that are given when the plan is through, and results that stand there when a session is opened again."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import OutputError
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.plan import Direction
from dbbstation.service.after import After
from dbbstation.service.session_notes import give_verdict
from dbbstation.service.work import Call, SessionTask, WorkProgress
from dbbstation.station.commands import Judge

if TYPE_CHECKING:
    from pathlib import Path

VIRTUAL = shipped_folder("fixtures") / "sessions" / "virtual"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return shutil.copytree(VIRTUAL, tmp_path / "session")


class Done:
    """Work that is done at once and wrote what it was asked for."""

    progress, stage, passed_s = WorkProgress.DONE, "", 2.5

    def __init__(self, call: Call, folder: Path) -> None:
        (folder / (call.outputs.get("out") or call.given["page"])).write_text("written", encoding="utf-8")

    def answer(self) -> dict[str, object]:
        return {"parameters": 42}

    def close(self) -> None:
        pass


def test_a_verdict_is_given_to_a_session_that_nobody_measures(session: Path) -> None:
    give_verdict(session, Judge("a", Direction.CW, 1, accepted=False, reason="the bar slipped"))
    ccw, cw = read_session(session).runs
    assert (ccw.state, cw.state, cw.reason) == (RunState.ACCEPTED, RunState.REJECTED, "the bar slipped")
    with pytest.raises(OutputError, match="the session has no run a-cw-7"):
        give_verdict(session, Judge("a", Direction.CW, 7, accepted=True))


@pytest.mark.parametrize("name", ["session", "s[1]", "s*?"])
def test_what_was_worked_out_stands_there_again_until_other_runs_count(session: Path, name: str) -> None:
    session = session.rename(session.parent / name)
    first = After(session, start=Done)
    assert first.results[SessionTask.CALIBRATE].progress is None
    first.do(SessionTask.CALIBRATE)
    first.look()
    assert first.folder.name == f"{name}-results"
    again = After(session, start=Done)
    found = again.results[SessionTask.CALIBRATE]
    assert (found.progress, found.answer, found.passed_s) == (WorkProgress.DONE, {"parameters": 42}, 2.5)
    assert again.model == found.path == first.folder / "model.yaml"
    assert again.folder == first.folder  # no second folder
    assert again.results[SessionTask.DIAGNOSE].progress is None
    assert not again.outdated
    give_verdict(session, Judge("a", Direction.CW, 1, accepted=False, reason="the bar slipped"))
    assert again.outdated
    other = After(session, start=Done)
    assert (other.results[SessionTask.CALIBRATE].progress, other.folder.name) == (None, f"{name}-results-2")
    give_verdict(session, Judge("a", Direction.CW, 1, accepted=True))
    (first.folder / "model.yaml").unlink()  # a file that is gone was not worked out
    assert After(session, start=Done).results[SessionTask.CALIBRATE].progress is None


def test_two_screens_on_one_session_lose_nothing_of_each_other(session: Path) -> None:
    """Each opened before the other has done anything: their results lie apart, or in one folder that keeps both."""
    first, second = After(session, start=Done), After(session, start=Done)
    for one, step in ((first, SessionTask.CALIBRATE), (second, SessionTask.REPORT)):
        one.do(step)
        one.look()
    assert first.folder != second.folder
    again, beside = After(session, start=Done), After(session, start=Done)
    assert again.folder == beside.folder
    for one, step in ((again, SessionTask.DIAGNOSE), (beside, SessionTask.CALIBRATE), (beside, SessionTask.REPORT)):
        one.do(step)
        one.look()
    done = {step for step, one in After(session, start=Done).results.items() if one.progress is WorkProgress.DONE}
    assert {SessionTask.DIAGNOSE, SessionTask.CALIBRATE, SessionTask.REPORT} <= done


def test_verdicts_of_two_screens_at_once_are_both_noted(session: Path) -> None:
    given = [
        Judge("a", Direction.CW, 1, accepted=False, reason="slip"),
        Judge("a", Direction.CCW, 1, accepted=False, reason="cable"),
    ]
    with ThreadPoolExecutor(2) as screens:
        list(screens.map(lambda one: give_verdict(session, one), given))
    assert [run.reason for run in read_session(session).runs] == ["cable", "slip"]
