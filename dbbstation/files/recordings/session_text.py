"""A session file's data and text."""

from __future__ import annotations

from dataclasses import asdict, fields
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dbbstation.files.formats.session import SessionFile
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.recordings.entries import Note, ReadBy, RunEntry
    from dbbstation.files.recordings.seal import Amendment, Seal
    from dbbstation.files.recordings.session_details import SessionDetails


def session_data(
    folder: Path, names: Sequence[str], details: SessionDetails, runs: Sequence[RunEntry]
) -> dict[str, object]:
    """Return a session file's content without its format."""
    bar, seal = details.bar, details.seal
    data: dict[str, object] = {
        "machine": names[0],
        "plan": names[1],
        "serial_number": details.serial_number,
        "operator": details.operator,
        "job": details.job or None,
        "ambient_temp_c": details.ambient_temp_c,
        "instrument": details.instrument and _instrument_data(details.instrument),
        "bar": bar and {each.name: _plain(getattr(bar, each.name)) for each in fields(bar)},
        "bar_waiver": details.bar_waiver or None,
        "seal": seal and seal_data(seal),
        "amendments": [_amendment_data(amendment) for amendment in details.amendments] or None,
        "notes": [_note_data(note) for note in details.notes] or None,
        # Directly above the runs, where people write them in.
        "set_up_errors": [_without_none(asdict(readings)) for readings in details.set_up_errors] or None,
    }
    data = {key: _without_none(value) for key, value in data.items() if value is not None}
    return {**data, "runs": [_without_none(_run_data(folder, run)) for run in runs]}


def text_of(data: Mapping[str, object]) -> str:
    """Return the text of a session file, with keys in their usual order."""
    ordered = {key: data[key] for key in SessionFile.model_fields if key in data}
    return yaml_text({"format": format_of(SessionFile), **ordered})


def seal_data(seal: Seal) -> dict[str, object]:
    """Return a seal for its file."""
    log = {"events": seal.events, "sha256": seal.anchor} if seal.anchor else None
    data = {"files": dict(seal.files), "runs": seal.runs, "chain_sha256": seal.chain_sha256 or None, "log": log}
    return {key: value for key, value in data.items() if value is not None}


def _amendment_data(amendment: Amendment) -> object:
    return _without_none({each.name: _plain(getattr(amendment, each.name)) or None for each in fields(amendment)})


def _note_data(note: Note) -> object:
    return _without_none({**asdict(note), "made": _plain(note.made), "text": note.text or None})


def _instrument_data(instrument: ReadBy) -> dict[str, object]:
    told = asdict(instrument)
    return {key: value for key, value in told.items() if value != ""}


def _run_data(folder: Path, run: RunEntry) -> dict[str, object]:
    program = run.program and {
        "file": run.program.path.relative_to(folder).as_posix(),
        "sha256": run.program.sha256,
        "model_sha256": run.program.model_sha256 or None,
    }
    return {
        "test": run.test,
        "direction": run.direction.value,
        "repeat": run.repeat,
        "mounting": run.mounting,
        "file": run.path.relative_to(folder).as_posix(),
        "started": _plain(run.started),
        "state": run.state.value,
        "reason": run.reason or None,
        "sha256": run.sha256 or None,
        "chain_sha256": run.chain_sha256 or None,
        "counts": run.counts and run.counts.data(),
        "centre_mm": run.centre_mm,
        "instrument": run.instrument and _instrument_data(run.instrument),
        "program": _without_none(program),
    }


def _without_none(value: object) -> object:
    return {key: item for key, item in value.items() if item is not None} if isinstance(value, dict) else value


def _plain(value: object) -> object:
    if not isinstance(value, datetime):
        return value
    return value.astimezone(UTC).isoformat().replace("+00:00", "Z")
