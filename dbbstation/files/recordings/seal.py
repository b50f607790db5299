"""The seal of a session: hashes of machine, plan and jig, and a chain through its runs.

Every sealed run's entry has a link: the SHA-256 of the previous link and of the entry's content. A removed, exchanged
or changed entry breaks a link. The seal's count and last link reveal removed last entries. Copies in the folder
`sealed` show which key changed. The seal reveals mistakes, but cannot prevent a new seal of everything.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, TypeGuard

from dbbstation.errors import Problem
from dbbstation.files.atomic import is_leftover, write_folder
from dbbstation.files.formats.session import Seal
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.source_text import read_bytes
from dbbstation.files.yaml.schema import dotted
from dbbstation.files.yaml.text import load_yaml
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dbbstation.files.formats.session import Amendment, RunEntry
    from dbbstation.files.yaml.text import Location


def changes(before: object, after: object, at: Location = ()) -> list[str]:
    """Return changes, one text per key such as `base_joints_mm[0][1] is 12.2, was 12.0`.

    Args:
        before: lists whose entries all have a `name` are matched by it.
        at: place of both in their documents.
    """
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        gone = [f"{dotted((*at, str(key)))} is gone" for key in before if key not in after]
        new = [f"{dotted((*at, str(key)))} is new" for key in after if key not in before]
        same = [key for key in before if key in after]
        return [*gone, *new, *(text for key in same for text in changes(before[key], after[key], (*at, str(key))))]
    if _is_list(before) and _is_list(after):
        named = _by_name(before), _by_name(after)
        if named[0] is not None and named[1] is not None:
            moved = list(named[0]) != list(named[1]) and set(named[0]) == set(named[1])
            return [*([f"{dotted(at)} has another order"] if moved else []), *changes(*named, at)]
        if len(before) != len(after):
            return [f"{dotted(at)} has {len(after)} values, had {len(before)}"]
        pairs = enumerate(zip(before, after, strict=True))
        return [text for index, (old, new) in pairs for text in changes(old, new, (*at, index))]
    return [] if before == after else [f"{dotted(at)} is {_shown(after)}, was {_shown(before)}"]


def _is_list(value: object) -> TypeGuard[Sequence[object]]:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _by_name(entries: Sequence[object]) -> dict[str, object] | None:
    named: dict[str, object] = {
        str(entry["name"]): entry for entry in entries if isinstance(entry, Mapping) and "name" in entry
    }
    return named if len(named) == len(entries) else None


def _shown(value: object) -> str:
    if isinstance(value, Mapping) or _is_list(value):
        return "a list of values"
    return str(value)


SEALED = "sealed"
"""Folder in the session with a copy of every file that was ever sealed."""

AMEND = "restore it, or say why it was changed: `dbbstation session amend {folder} --reason TEXT`"
"""Advice for a file that differs from the sealed one."""

RUNS = "runs"
"""Name of an amendment of the list of runs."""

_NAMED_DIGITS = 16
"""Number of hex digits of its SHA-256 in the name of a copy."""

_MOST_NAMED = 4
"""Greatest number of named changes; an exchanged file has hundreds."""


def sealed_names(folder: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Return the sealed files' paths: machine, plan and the plan's jig file."""
    plan = load_yaml(folder / names[1], [])
    jig = plan.data.get("jig") if plan is not None and isinstance(plan.data, dict) else None
    beside = names[1].rpartition("/")[0]
    return (*names, f"{beside}/{jig}" if beside else jig) if isinstance(jig, str) else tuple(names)


def hashes(folder: Path, names: Sequence[str]) -> dict[str, str]:
    """Return the SHA-256 of readable files by name."""
    return {name: found for name in names if (found := hash_in(folder, name))}


def hash_in(folder: Path, name: str) -> str:
    """Return the SHA-256 of a file of the session, empty if it cannot be read."""
    data = read_bytes(folder / name, [], is_input=False)
    return "" if data is None else sha256_hex(data)


def copy_name(name: str, sha256: str) -> str:
    """Return the path of a sealed file's copy."""
    stem, dot, ending = name.rpartition("/")[2].rpartition(".")
    part = sha256[:_NAMED_DIGITS]
    return f"{SEALED}/{stem}-{part}{dot}{ending}" if dot else f"{SEALED}/{ending}-{part}"


def keep_copies(folder: Path, sealed: Mapping[str, str]) -> None:
    """Keep a copy of every sealed file, and repair damaged copies.

    Raises:
        OutputError: the disk refuses.
    """
    copies = {}
    for name, digest in sealed.items():
        copy, data = copy_name(name, digest), read_bytes(folder / name, [])
        sound = data is not None and sha256_hex(data) == digest
        if data is not None and sound and hash_in(folder, copy) != digest:
            copies[copy] = data
    if copies:
        write_folder(folder, copies, force=True, own=True, read_only=is_copy)


def is_copy(name: str) -> bool:
    """Return whether a path belongs to a kept copy."""
    return name.startswith(f"{SEALED}/")


def copy_faults(folder: Path, seal: Seal, amendments: Sequence[Amendment]) -> Iterator[Problem]:
    """Yield faults of kept copies: damaged, missing, or unknown."""
    if (folder / SEALED).is_symlink():  # it may lead to a whole disk
        what = f"{SEALED} is a link: the copies of what was sealed are part of the session"
        yield Problem.of(folder / SEALED, what, "put the folder itself there, not a link")
        return
    known = {copy_name(name, digest): digest for name, digest in seal.files.items()}
    known |= {one.former: one.former_sha256 for one in amendments if is_copy(one.former) and one.what != RUNS}
    there = {path.relative_to(folder).as_posix() for path in (folder / SEALED).rglob("*") if path.is_file()}
    there = {name for name in there if not is_leftover(PurePosixPath(name))}
    now = hashes(folder, sorted(there))
    originals = {digest for name, digest in hashes(folder, tuple(seal.files)).items()}
    for name in sorted(there | known.keys()):
        digest, said = now.get(name), known.get(name, "")
        if name not in there:
            what = f"{name}, a copy of what was sealed, is not there"
        elif digest is None:
            what = f"{name}, a copy of what was sealed, cannot be read"
        elif (said and digest != said) or not fits_name(name, digest):
            what = f"{name} is not the copy that was kept: its SHA-256 is {digest}"
        else:
            continue
        remedy = (
            f"`dbbstation session seal {folder}` puts it right" if said in originals else "restore it from a backup"
        )
        yield Problem.of(folder / name, what, remedy)


def fits_name(name: str, digest: str) -> bool:
    """Return whether a kept copy has the hash in its name."""
    stem = name.rpartition("/")[2].partition(".")[0]
    return stem.endswith(f"-{digest[:_NAMED_DIGITS]}")


def link(before: str, run: RunEntry) -> str:
    """Return the link of a sealed run in the chain.

    The link is the SHA-256 of twelve lines in UTF-8. Each line has a line end; a missing value is an empty line.

    1. The previous sealed run's link.
    2. Test, direction, repeat, mounting, and start in UTC (ISO 8601): five lines.
    3. SHA-256 of the run file, of the program, and of the program's model: three lines.
    4. x, y and z of the programmed centre [mm]: three lines.
    """
    program = ("", "") if run.program is None else (run.program.sha256, run.program.model_sha256)
    started = "" if run.started is None else run.started.astimezone(UTC).isoformat()
    said = (before, run.test, run.direction.value, run.repeat, run.mounting or "", started, run.sha256, *program)
    centre = ("", "", "") if run.centre_mm is None else tuple(repr(float(value)) for value in run.centre_mm)
    return sha256_hex("".join(f"{value}\n" for value in (*said, *centre)))


def chained(runs: Sequence[RunEntry]) -> tuple[RunEntry, ...]:
    """Return the runs; newly sealed ones get links that continue the chain."""
    done = [run for run in runs if run.chain_sha256]
    behind = runs.index(done[-1]) if done else -1
    kept = [run for run in runs if not (run.sha256 and not run.chain_sha256 and runs.index(run) < behind)]
    last, out = "", []
    for run in (*kept, *(run for run in runs if run not in kept)):
        linked = run if run.chain_sha256 or not run.sha256 else replace(run, chain_sha256=link(last, run))
        last = linked.chain_sha256 or last
        out.append(linked)
    return tuple(out)


def sealed_over(files: Mapping[str, str], runs: Sequence[RunEntry]) -> Seal:
    """Return the seal of files and linked runs."""
    links = [run.chain_sha256 for run in runs if run.chain_sha256]
    return Seal(dict(files), len(links), links[-1] if links else "")


def seal_faults(folder: Path, file: Path, seal: Seal, names: Sequence[str], runs: Sequence[RunEntry]) -> list[Problem]:
    """Return changes since sealing: files with their keys, and runs."""
    faults = [*_file_faults(folder, file, seal, names)]
    faults += [Problem.of(file, what, remedy) for what, remedy in chain_faults(folder, seal, runs)]
    return faults


def _file_faults(folder: Path, file: Path, seal: Seal, names: Sequence[str]) -> Iterator[Problem]:
    now = hashes(folder, tuple(dict.fromkeys((*seal.files, *sealed_names(folder, names)))))
    for name, stored in seal.files.items():
        if name not in now:
            what = f"{name}, which was sealed, is not there"
            yield Problem.of(file, what, f"restore it{_from(folder, name, stored)}")
        elif now[name] != stored:
            what = f"the file is not the one that was sealed: its SHA-256 was {stored}, is {now[name]}"
            keys = _changed_keys(folder / copy_name(name, stored), folder / name)
            remedy = AMEND.format(folder=folder).replace("restore it", f"restore it{_from(folder, name, stored)}")
            yield Problem.of(folder / name, f"{what}; {keys}" if keys else what, remedy)
    for name in now:
        if name not in seal.files:
            what = f"{name} was not sealed: the session named another file then"
            yield Problem.of(file, what, AMEND.format(folder=folder).replace("restore it", "name that one"))


def _from(folder: Path, name: str, stored: str) -> str:
    copy = copy_name(name, stored)
    return f" from {copy}" if hash_in(folder, copy) == stored else ""


def _changed_keys(before: Path, after: Path) -> str:
    documents = load_yaml(before, []), load_yaml(after, [])
    if documents[0] is None or documents[1] is None:
        return ""
    found = changes(documents[0].data, documents[1].data)
    return listed(found, _MOST_NAMED) or "no value differs, only how it is written"


def chain_faults(folder: Path, seal: Seal, runs: Sequence[RunEntry]) -> Iterator[tuple[str, str]]:
    """Yield faults of the chain of runs with remedies; arguments as of `seal_faults`."""
    sealed = [run for run in runs if run.sha256]
    linked = [run for run in sealed if run.chain_sha256]
    remedy = AMEND.format(folder=folder).replace("restore it", "restore the list of runs").replace("it was", "that was")
    missing = seal.runs - len(linked)
    if missing > 0:
        yield f"the list of runs lacks {missing} of {seal.runs} sealed runs: {_run_s(missing)} taken out", remedy
    elif missing < 0:
        yield f"the list has {len(linked)} sealed runs, the seal counts {seal.runs}", remedy
    links = {run.chain_sha256: run for run in linked}
    before = ""
    for run in linked:
        if run.chain_sha256 != link(before, run):
            after = next((one for one in ("", *links) if link(one, run) == run.chain_sha256), None)
            if after is not None:
                place = f"was sealed after run {links[after].label}" if after else "was sealed as the first"
                now = f"stands after run {links[before].label}" if before else "stands first"
                yield f"run {run.label} {place} and {now}: runs were exchanged or taken out", remedy
            elif missing > 0:
                yield f"run {run.label} was sealed after a run that is not in the list any more", remedy
            else:
                yield f"the entry of run {run.label} is not the one that was sealed", remedy
        before = run.chain_sha256
    if not missing and linked and linked[-1].chain_sha256 != seal.chain_sha256:
        yield f"run {linked[-1].label} stands last, and another run was the last that was sealed", remedy
    for run in sealed:
        if not run.chain_sha256:
            what = f"run {run.label} was put into the list after the session was sealed"
            yield what, f"`dbbstation session seal {folder}` takes it into the chain"


def _run_s(count: int) -> str:
    return "it was" if count == 1 else "they were"
