"""The identity of the program: results depend on it and on their inputs."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from importlib.resources import as_file, files

from dbbstation import __version__
from dbbstation.files.gateway import content_of

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
