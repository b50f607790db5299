"""Compare a session file with its event log, and find which is newer and what differs."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum, auto
from typing import TYPE_CHECKING, Any

from dbbstation.facts.serialise import adapter
from dbbstation.files.formats.session import SessionDetails, SessionFile
from dbbstation.files.recordings.event_log import EVENTS_FILE, EventLog
from dbbstation.files.recordings.seal import changes
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry

READINGS = "set_up_errors"
"""The only list that people write into a session file; additions do not break the seal."""

SEALED = "sealed"
"""First event of a session that had no seal."""

NO_MARK = "the seal names no event log"
"""Message for a seal without log: every seal is written with a log, so the log was removed."""

_MOST_NAMED = 6
"""Greatest number of named changes; an exchanged session file has hundreds."""


def session_state(data: Mapping[str, Any]) -> dict[str, object]:
    """Return a session file's data in normal form, with lists, but without empty values, format and log mark."""
    seal = data.get("seal")
    plain = {key: value for key, value in data.items() if key != "format"}
    if isinstance(seal, dict):
        plain["seal"] = {key: value for key, value in seal.items() if key != "log"}
    return _plain(plain)


def _plain(value: object) -> Any:  # noqa: ANN401 - as plain as it came
    if isinstance(value, dict):
        told = {str(key): _plain(item) for key, item in value.items()}
        return {key: item for key, item in told.items() if item is not None and item not in ("", [], {})}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def mark_of(data: Mapping[str, Any]) -> tuple[int, str] | None:
    """Return the log's position as the session file states it: event count and last link; None without a log."""
    seal = data.get("seal")
    mark = seal.get("log") if isinstance(seal, dict) else None
    return (mark["events"], mark["sha256"]) if isinstance(mark, dict) and {"events", "sha256"} <= mark.keys() else None


class Stands(Enum):
    """Relation of a session file to its event log."""

    ALONE = auto()
    """There is no log: the session has no seal."""
    SAME = auto()
    """File and log agree."""
    BEHIND = auto()
    """The file agrees with an earlier state of the log: its writer was interrupted, or a former copy was restored."""
    UNLIKE = auto()
    """File and log disagree: one of the two was changed."""


@dataclass(frozen=True)
class Standing:
    """Relation of a session file to its event log."""

    stands: Stands
    differences: tuple[str, ...] = ()
    log_sound: bool = True


def standing(data: Mapping[str, Any], log: EventLog | None, *, but_runs: bool = False) -> Standing:
    """Compare a session file with its event log.

    Args:
        but_runs: skip the list of runs, whose chain is checked already.
    """
    mark, state = mark_of(data), session_state(data)
    events = () if log is None else log.events
    if mark is None and log is not None and events:
        return _unmarked(state, log)
    if mark is None:
        return Standing(Stands.UNLIKE, (NO_MARK,)) if "seal" in state else Standing(Stands.ALONE)
    if log is None or mark[0] > len(events) or log.links[mark[0] - 1] != mark[1]:
        return Standing(Stands.UNLIKE, (_log_fault(mark[0], log),), log_sound=False)
    found = differences(log.state(mark[0]), state, but_runs=but_runs)
    if found:
        return Standing(Stands.UNLIKE, found)
    return Standing(Stands.SAME if mark[0] == len(events) else Stands.BEHIND)


def _log_fault(count: int, log: EventLog | None) -> str:
    if log is None:
        return f"{EVENTS_FILE}, which the seal covers, is not there"
    if count > len(log.events):
        cut = "is not as it was written" if log.size > log.end else "is not there"
        return f"{EVENTS_FILE} has {len(log.events)} of {count} events: line {len(log.events) + 1} {cut}"
    return f"{EVENTS_FILE} is not the log that was sealed: event {count} had another link"


def _unmarked(state: Mapping[str, Any], log: EventLog) -> Standing:
    first = log.state(1)
    if len(log.events) == 1 and log.events[0].what == SEALED and not differences(_unsealed(first), _unsealed(state)):
        return Standing(Stands.BEHIND)
    what = "the seal was taken out" if "seal" not in state else f"the seal does not cover {EVENTS_FILE} any more"
    return Standing(Stands.UNLIKE, (f"{what}: {EVENTS_FILE} has {len(log.events)} events of this session",))


def _unsealed(state: Mapping[str, Any]) -> dict[str, object]:
    bare = {key: value for key, value in state.items() if key != "seal"}
    bare["runs"] = [
        {key: run[key] for key in run if key not in {"sha256", "chain_sha256"}} for run in state.get("runs", ())
    ]
    return bare


def differences(before: Mapping[str, Any], after: Mapping[str, Any], *, but_runs: bool = False) -> tuple[str, ...]:
    """Return differences of session file and log in words; added readings do not count."""
    old, new = _by_run(before), _by_run(after)
    for state in (old, new):
        state.pop(READINGS, None)
        if but_runs:
            state.pop("runs", None)
    there = after.get(READINGS, ())
    found = [
        f"{READINGS} of test {one.get('test')} are not as read" for one in before.get(READINGS, ()) if one not in there
    ]
    found += changes(old, new)
    more = len(found) - _MOST_NAMED
    return (*found[:_MOST_NAMED], f"and {more} more") if more > 0 else tuple(found)


def _by_run(state: Mapping[str, Any]) -> dict[str, object]:
    runs = state.get("runs", ())
    if not runs:
        return dict(state)
    named = [{"name": f"{run.get('test')}-{run.get('direction')}-{run.get('repeat')}", **run} for run in runs]
    return {**state, "runs": named}


def with_readings(state: Mapping[str, Any], data: Mapping[str, Any]) -> dict[str, object]:
    """Return a state with the readings of a session file."""
    readings = session_state(data).get(READINGS)
    bare = {key: value for key, value in state.items() if key != READINGS}
    return {**bare, READINGS: readings} if readings else bare


def session_data(
    folder: Path, names: Sequence[str], details: SessionDetails, runs: Sequence[RunEntry]
) -> dict[str, object]:
    """Return a session file's content without its format."""
    noted = {each.name: getattr(details, each.name) for each in fields(SessionDetails)}
    file = SessionFile(**noted, format="dbb-session/1", machine=names[0], plan=names[1], runs=tuple(runs))
    return in_order(data_of(file, folder))


def data_of(record: object, folder: Path | None = None) -> dict[str, object]:
    """Return a part of a session file as plain data, without absent values."""
    return adapter(type(record)).dump_python(record, mode="json", by_alias=True, exclude_none=True, context=folder)


def in_order(data: Mapping[str, object]) -> dict[str, object]:
    """Return the keys of a session file, except its format, in their usual order."""
    keys = ("machine", "plan", *(each.name for each in fields(SessionDetails)), "runs")
    return {key: data[key] for key in keys if key in data}


def text_of(data: Mapping[str, object]) -> str:
    """Return the text of a session file, with keys in their usual order."""
    return yaml_text({"format": format_of(SessionFile), **in_order(data)})
