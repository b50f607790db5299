"""Keys of stored results: hashes of all inputs that determine a result."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from functools import cache
from importlib.metadata import version
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dbbstation import __version__
from dbbstation.files.formats.session import RunState
from dbbstation.files.gateway import content_of, digest_of, sha256_hex
from dbbstation.files.places import SESSION_FILE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.files.recordings.session import SessionFolder

ENDINGS = frozenset({".py", ".html", ".css", ".js"})
"""Endings of the package's files that determine results."""

LIBRARIES = ("numpy", "scipy", "numba", "pydantic")
"""Libraries that compute or write numbers."""


@cache
def program_identity() -> dict[str, str]:
    """Return version and content of the program, and versions of Python and numerical libraries.

    The content is a SHA-256 over the package: two checkouts may share a version.
    """
    return {
        "dbbstation": __version__,
        "code": code_digest(),
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: version(name) for name in LIBRARIES},
    }


@cache
def code_digest() -> str:
    """Return a SHA-256 over the names and content of all files that determine results."""
    digest = hashlib.sha256()
    with as_file(files("dbbstation")) as folder:
        for path in sorted(path for path in folder.rglob("*") if path.suffix in ENDINGS):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(content_of(path)).digest())
    return digest.hexdigest()


def differences_of(one: dict[str, str], other: dict[str, str]) -> str:
    """Return the differences of two programs in words, or an empty text."""
    names = [name for name in dict.fromkeys([*one, *other]) if one.get(name) != other.get(name)]
    return ", ".join(f"{name} {_short(other, name)} and not {_short(one, name)}" for name in names)


def _short(identity: dict[str, str], name: str) -> str:
    return identity.get(name, "none")[:12]


def key_of(request: Mapping[str, Any], inputs: Iterable[tuple[str, str]] = ()) -> str:
    """Return a SHA-256 over request, inputs and program.

    Args:
        inputs: name and SHA-256 of each file, in any order.
    """
    what = {"request": request, "inputs": sorted(inputs), "program": program_identity()}
    return sha256_hex(json.dumps(what, sort_keys=True, default=str))


def digests_of(paths: Iterable[Path], folder: Path) -> list[tuple[str, str]]:
    """Return name and SHA-256 of files; names within a folder are relative to it.

    Raises:
        OSError: one cannot be read.
    """
    return [(Path(os.path.relpath(path, folder)).as_posix(), digest_of(path)) for path in dict.fromkeys(paths)]


def files_of_session(session: SessionFolder) -> list[Path]:
    """Return the files that determine a session's results: session file, machine, plan, accepted runs, programs."""
    runs = [run for run in session.runs if run.state is RunState.ACCEPTED]
    programs = [run.program.path for run in runs if run.program is not None]
    return [
        session.folder / SESSION_FILE,
        session.machine_path,
        session.plan_path,
        *(run.path for run in runs),
        *programs,
    ]
