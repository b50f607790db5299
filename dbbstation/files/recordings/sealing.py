"""Seal recordings of other programs: add hashes and a chain to the existing session file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from dbbstation.errors import Faults, InputError, refuse
from dbbstation.files.formats.session import LogMark, Seal, SessionFile
from dbbstation.files.gateway import digest_of
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.event_log import impossible_day, read_event_log
from dbbstation.files.recordings.lock import PATIENCE_S, SessionLock
from dbbstation.files.recordings.seal import (
    chained,
    copy_name,
    hash_in,
    hashes,
    keep_copies,
    seal_faults,
    sealed_names,
    sealed_over,
)
from dbbstation.files.recordings.session_state import SEALED, Stands, data_of, mark_of, standing
from dbbstation.files.recordings.session_store import SessionStore, log_faults
from dbbstation.files.source_text import text_in
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import validate
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.event_log import EventLog


@dataclass(frozen=True)
class Sealing:
    """The changes by which a session is sealed.

    Attributes:
        chained: text with hashes and chain, and the old seal.
        files: run files that get a hash.
        logged: whether the session has an event log.
    """

    path: Path
    chained: str
    files: tuple[str, ...]
    linked: tuple[str, ...]
    seal: Seal
    before: str
    logged: bool
    copies: tuple[str, ...]

    @property
    def text(self) -> str:
        """Return the session file's text with hashes, chain and seal."""
        return _with_seal(self.chained, self.seal)

    @property
    def anything(self) -> bool:
        """Return whether any part of the seal is missing."""
        return self.text != self.before or not self.logged or bool(self.copies)


def seal_session(folder: Path) -> Sealing:
    """Seal a session: hashes, event log and copies.

    Raises:
        InputError: as of `sealing`.
        OutputError: another process writes into the session, or the disk refuses; the session file is restored.
    """
    found = sealing(folder)  # no lock is left in what is no session
    with SessionLock(found.path.parent, PATIENCE_S):
        store = SessionStore(found.path.parent)
        found = sealing(folder)
        keep_copies(found.path.parent, found.seal.files)
        document = parse_yaml(found.text, str(found.path), [])
        if document is None:
            raise ValueError("a session file that was sealed cannot be read")
        store.write(document.data, SEALED, lambda said: _with_seal(found.chained, _marked(found.seal, said)))
    return found


def _marked(seal: Seal, said: Mapping[str, Any]) -> Seal:
    mark = mark_of(said)
    return seal if mark is None else replace(seal, log=LogMark(*mark))


def sealing(folder: Path) -> Sealing:
    """Return the missing parts of a seal, and the complete text of the session file, without writing.

    Comments, order and spelling are kept. Runs being recorded get no hash.

    Raises:
        InputError: no session file, no list of runs, a missing file, or a change of what was sealed.
    """
    path = folder if folder.is_file() else folder / SESSION_FILE
    faults = Faults(path)
    text = text_in(path, faults)
    if text is None or parse_yaml(text, str(path), faults) is None:
        raise InputError(faults)
    hashed, files = _with_hashes(text, path)
    runs, seal, log = _chain(hashed, path)
    for run in runs:
        real = not (run.instrument and run.instrument.virtual)
        if run.started is not None and real and (wrong := impossible_day(run.started)):
            faults.add(f"run {run.label} is of {wrong}: it is not sealed", "set its date right")
    refuse(faults)
    whole, linked = _with_links(hashed, path, runs)
    copies = {copy_name(name, digest): digest for name, digest in seal.files.items()}
    spoilt = [copy for copy, digest in copies.items() if hash_in(path.parent, copy) != digest]
    return Sealing(path, whole, files, linked, seal, text, log is not None and bool(log.events), tuple(spoilt))


def _with_hashes(text: str, path: Path) -> tuple[str, tuple[str, ...]]:
    faults = Faults(path)
    additions: list[tuple[MappingNode, str, str]] = []
    named = []
    for run in _runs(text, path):
        file, state = _entry(run, "file"), _entry(run, "state")
        recording = isinstance(state, ScalarNode) and state.value == "recording"
        if not isinstance(file, ScalarNode) or recording or _entry(run, "sha256") is not None:
            continue
        recorded = path.parent / file.value
        if not recorded.is_file():
            place = (file.start_mark.line + 1, file.start_mark.column + 1)
            faults.add(f"the run file {file.value} is missing", "put it there or leave the run out", *place)
            continue
        additions.append((run, "file", f"sha256: {digest_of(recorded)}"))
        named.append(file.value)
    refuse(faults)
    return _added(text, additions), tuple(named)


def _chain(text: str, path: Path) -> tuple[tuple[RunEntry, ...], Seal, EventLog | None]:
    faults = Faults(path)
    document = parse_yaml(text, str(path), faults)
    session = None if document is None else validate(document, SessionFile, path.parent)
    if session is None:
        raise InputError(faults)
    folder, names = path.parent, (session.machine, session.plan)
    runs, seal, log = session.runs, session.seal, read_event_log(folder, faults)
    # Hashes that are added now are no change of what was sealed.
    if document is not None and standing(document.data, log, but_runs=True).stands is Stands.UNLIKE:
        faults += log_faults(path, document.data, log, but_runs=True)
    if seal is None:
        sealed = sealed_names(folder, names)
        found = hashes(folder, sealed)
        for name in sealed:
            if name not in found:
                faults.add(f"there is no file `{name}` to be sealed", "put it there")
    else:
        found = dict(seal.files)
        faults += seal_faults(folder, path, seal, names, [run for run in runs if run.chain_sha256 or not run.sha256])
    linked = chained(runs)
    if [run.label for run in linked] != [run.label for run in runs]:
        what = "runs without a link in the chain stand before runs that have one"
        faults.add(what, "put them behind the runs that are sealed")
    refuse(faults)
    over = sealed_over(found, linked)
    return linked, over if seal is None else replace(over, log=seal.log), log


def _with_links(text: str, path: Path, runs: Sequence[RunEntry]) -> tuple[str, tuple[str, ...]]:
    pairs = zip(_runs(text, path), runs, strict=True)
    new = [(node, run) for node, run in pairs if run.chain_sha256 and _entry(node, "chain_sha256") is None]
    lines = [(node, "sha256", f"chain_sha256: {run.chain_sha256}") for node, run in new]
    return _added(text, lines), tuple(run.name for _, run in new)


def _with_seal(text: str, seal: Seal) -> str:
    root = YAML(typ="safe", pure=True).compose(text)
    starts = {name.value: name.start_mark.index for name, _ in root.value}
    begin = starts.get("seal", starts.get("set_up_errors", starts["runs"]))
    after = [start for start in starts.values() if start > begin]
    end = begin if "seal" not in starts else min(after, default=len(text))
    line = yaml_text({"seal": data_of(seal)})
    return text[:begin] + line + text[end:]


def _runs(text: str, path: Path) -> Sequence[MappingNode]:
    root = YAML(typ="safe", pure=True).compose(text)
    runs = _entry(root, "runs")
    if not isinstance(runs, SequenceNode) or not runs.value:
        what = "the session file lists no runs"
        raise InputError.of(path, what, "name each recording under `runs`")
    if root.flow_style:
        what = "the whole session file stands in brackets"
        raise InputError.of(path, what, "write one key a line", line=1, column=1)
    return list(runs.value)


def _behind(run: MappingNode, key: str, addition: str, text: str) -> tuple[int, str]:
    name, value = next((name, value) for name, value in run.value if name.value == key)
    end = value.end_mark.index
    if run.flow_style:
        return end, f", {addition}"
    # Behind a comment, where one stands on the line.
    newline = text.find("\n", end)
    return len(text) if newline < 0 else newline, f"\n{' ' * name.start_mark.column}{addition}"


def _added(text: str, additions: Sequence[tuple[MappingNode, str, str]]) -> str:
    for at, addition in sorted((_behind(*one, text) for one in additions), reverse=True):
        text = text[:at] + addition + text[at:]
    return text


def _entry(node: Node | None, key: str) -> Node | None:
    if not isinstance(node, MappingNode):
        return None
    return next((value for name, value in node.value if name.value == key), None)
