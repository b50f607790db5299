"""The station's judge beside a session that is recorded already."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

from dbbstation.files.formats.session import RunState
from dbbstation.station.judging import RunJudge

if TYPE_CHECKING:
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.files.recordings.session_writer import SessionWriter


def judge_of(session: SessionFolder) -> RunJudge:
    """Return a judge to whom runs have their starts, for the drift since then, and none is accepted yet."""
    begun = [replace(entry, state=RunState.RECORDING) for entry in session.runs]
    return RunJudge(cast("SessionWriter", SimpleNamespace(session=session, runs=begun)))
