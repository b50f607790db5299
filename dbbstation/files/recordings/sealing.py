"""Hashes for recordings that were made elsewhere: they are written into the session file as it stands."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from dbbstation.errors import InputError, Problem
from dbbstation.files.recordings.session import SESSION_FILE
from dbbstation.files.source_text import decode, read_bytes
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Sealing:
    """What sealing a session would do.

    Attributes:
        path: of the session file.
        text: its text with all hashes.
        files: run files that got one, as the session file names them.
    """

    path: Path
    text: str
    files: tuple[str, ...]


def sealing(folder: Path) -> Sealing:
    """Find the runs of a session file that have no hash, and the text that has them all; nothing is written.

    Comments, order and spelling of the file stay: each hash stands behind the run's `file`. Runs that are being recorded
    have none.

    Args:
        folder: of the session, or its session file.

    Raises:
        InputError: no session file, no list of runs in it, or a run's file that is missing.
    """
    path = folder if folder.is_file() else folder / SESSION_FILE
    faults: list[Problem] = []
    data = read_bytes(path, faults)
    text = None if data is None else decode(data, str(path), faults)
    if text is None or parse_yaml(text, str(path), faults) is None:
        raise InputError(faults)
    runs = _entry(YAML(typ="safe", pure=True).compose(text), "runs")
    if not isinstance(runs, SequenceNode) or not runs.value:
        what = "the session file lists no runs"
        raise InputError([Problem(str(path), 0, 0, what, "name each recording under `runs`")])
    additions: list[tuple[int, str]] = []
    named = []
    for run in runs.value:
        file, state = _entry(run, "file"), _entry(run, "state")
        recording = isinstance(state, ScalarNode) and state.value == "recording"
        if not isinstance(file, ScalarNode) or recording or _entry(run, "sha256") is not None:
            continue
        recorded = path.parent / file.value
        if not recorded.is_file():
            place = (file.start_mark.line + 1, file.start_mark.column + 1)
            what = f"the run file {file.value} is missing"
            faults.append(Problem(str(path), *place, what, "put it there or leave the run out"))
            continue
        hashed = f"sha256: {hashlib.sha256(recorded.read_bytes()).hexdigest()}"
        indent = next(key.start_mark.column for key, value in run.value if value is file)
        end = file.end_mark.index
        if run.flow_style:
            additions.append((end, f", {hashed}"))
        else:
            # Behind a comment, where one stands on the line.
            newline = text.find("\n", end)
            additions.append((len(text) if newline < 0 else newline, f"\n{' ' * indent}{hashed}"))
        named.append(file.value)
    if faults:
        raise InputError(faults)
    for at, addition in sorted(additions, reverse=True):
        text = text[:at] + addition + text[at:]
    return Sealing(path, text, tuple(named))


def _entry(node: Node | None, key: str) -> Node | None:
    """Value of a key of a mapping; None where there is none."""
    if not isinstance(node, MappingNode):
        return None
    return next((value for name, value in node.value if name.value == key), None)
