"""Earlier sessions on the same machine, plan and jig, and their programs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.atomic import write_bytes
from dbbstation.files.gateway import content_of, digest_of
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.service.session_list import CandidateFormat, candidates

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from dbbstation.files.recordings.session import SessionFolder


@dataclass(frozen=True)
class InForce:
    """Programs that commanded a session's accepted circles.

    Attributes:
        programs: folder of program copies; None for plain circles.
        models: found model files of the programs.
        lost: SHA-256 of missing models.
    """

    circles: int
    compensated: int
    programs: Path | None
    models: tuple[Path, ...] = ()
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class Former:
    """An earlier session."""

    folder: Path
    measured: datetime
    in_force: InForce


@dataclass(frozen=True)
class BeforeAndNow:
    """This session, and the earlier sessions that an acceptance can compare it with.

    Attributes:
        formers: earlier sessions, the last first.
    """

    now: InForce
    formers: tuple[Former, ...]


def before_and_now(folder: Path) -> BeforeAndNow:
    """Return this session and the comparable sessions beside it.

    Raises:
        InputError: the session cannot be read.
    """
    now = read_session(folder)
    under = folder.absolute().parent
    by_sha256 = {digest_of(path): path for path in candidates(CandidateFormat.MODEL, under)}
    formers = (Former(one.folder, at, in_force(one, by_sha256)) for at, one in former_sessions(now, under))
    return BeforeAndNow(in_force(now, by_sha256), tuple(formers))


def in_force(session: SessionFolder, models: dict[str, Path]) -> InForce:
    """Return the programs that commanded a session's accepted circles."""
    runs = session.accepted
    programs = [run.program for run in runs if run.program is not None]
    used = sorted({program.model_sha256 for program in programs if program.model_sha256})
    return InForce(
        circles=len(runs),
        compensated=sum(bool(program.model_sha256) for program in programs),
        programs=programs[0].path.parent if programs else None,
        models=tuple(models[sha256] for sha256 in used if sha256 in models),
        lost=tuple(sha256 for sha256 in used if sha256 not in models),
    )


def keep_models(former: Former, folder: Path) -> tuple[Path, ...]:
    """Copy a former session's models into a folder and return the copies.

    Raises:
        OutputError: one cannot be written.
        OSError: one cannot be read.
    """
    copies = []
    for model in former.in_force.models:
        data = content_of(model)
        copy = folder / f"former-model-{hashlib.sha256(data).hexdigest()[:8]}.yaml"
        if not copy.exists():
            write_bytes(copy, data)
        copies.append(copy)
    return tuple(copies)
