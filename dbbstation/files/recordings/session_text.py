"""A session file's data and text."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from dbbstation.facts.serialise import adapter
from dbbstation.files.formats.session import SessionDetails, SessionFile
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry


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
