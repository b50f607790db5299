"""A blind study: hidden effects are diagnosed, then compared with answers.

Each verdict is kept at once and rests on the session alone; `blind_score` opens the answers.
"""

from __future__ import annotations

import hashlib
import json
import time
from concurrent.futures import as_completed
from functools import partial
from typing import TYPE_CHECKING, Any

from dbbstation.errors import InputError, Problem, StationError
from dbbstation.files.atomic import write_text
from dbbstation.system.processes import processes
from dbbstation.system.signals import starting
from studies.diagnosed import diagnose_sessions
from studies.memory import forget_largest_memory, largest_memory_mb

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

ANSWERS = "answers.json"
FORMAT = "blind-answers/1"
SECONDS_PER_HOUR = 3600.0


def verdict_folder(folder: Path, candidates: Sequence[str]) -> Path:
    """Return the folder of verdicts with these candidates."""
    names = ",".join(sorted(candidates))
    return folder / "verdicts" / hashlib.sha256(names.encode()).hexdigest()[:12]


def judge_sessions(
    folder: Path,
    candidates: Sequence[str],
    jobs: int,
    progress: Callable[[int, int], None],
    *,
    again: bool = False,
) -> dict[str, dict[str, Any]]:
    """Diagnose every unjudged session of a folder.

    Args:
        candidates: source names.
        again: judge all anew.

    Returns:
        By session, `seconds` it took and `summary` of the diagnosis, or `error` where there was none; `processor_s`, and `memory_mb`,
        the largest memory of the process during it, with all that it had loaded before (None where the system does not say).

    Raises:
        InputError: a folder without sessions.
    """
    sessions = sorted(path.parent for path in folder.glob("*/session.yaml"))
    if not sessions:
        what = "no session folders in here"
        raise InputError([Problem(str(folder), 0, 0, what, "make some: python -m tests.plant.blind FOLDER")])
    kept = verdict_folder(folder, candidates)
    kept.mkdir(parents=True, exist_ok=True)
    waiting = [path for path in sessions if again or not (kept / f"{path.name}.json").exists()]
    done = len(sessions) - len(waiting)
    progress(done, len(sessions))
    work = partial(_judge, candidates=tuple(candidates), kept=kept)
    if jobs == 1 or len(waiting) <= 1:
        for path in waiting:
            work(path)
            done += 1
            progress(done, len(sessions))
    else:
        with processes(jobs) as pool:
            with starting():
                handed = [pool.submit(work, path) for path in waiting]
            for one in as_completed(handed):
                one.result()
                done += 1
                progress(done, len(sessions))
    return {path.name: json.loads((kept / f"{path.name}.json").read_text(encoding="utf-8")) for path in sessions}


def read_answers(folder: Path) -> dict[str, dict[str, Any]]:
    """Answers by session.

    Raises:
        InputError: no file of answers, or another format.
    """
    path = folder / ANSWERS
    try:
        answers = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        what = f"the answers cannot be read: {error}"
        raise InputError([Problem(str(path), 0, 0, what, "put the file of answers beside the sessions")]) from error
    if answers.get("format") != FORMAT:
        what = f"format is {answers.get('format')!r}, not {FORMAT}"
        raise InputError([Problem(str(path), 0, 0, what, "make the study anew")])
    return {answer["session"]: answer for answer in answers["sessions"]}


def cost(verdicts: Sequence[dict[str, Any]]) -> dict[str, float | None] | None:
    """Return processor time and memory of diagnoses; None if not measured."""
    seconds = [verdict["processor_s"] for verdict in verdicts if "processor_s" in verdict]
    memory_mb = [verdict["memory_mb"] for verdict in verdicts if verdict.get("memory_mb")]
    if not seconds:
        return None
    return {
        "processor_s_mean": sum(seconds) / len(seconds),
        "processor_s_greatest": max(seconds),
        "processor_h": sum(seconds) / SECONDS_PER_HOUR,
        "memory_mb_greatest": max(memory_mb, default=None),
    }


def _judge(path: Path, *, candidates: tuple[str, ...], kept: Path) -> None:
    forget_largest_memory()
    begun, begun_processor = time.perf_counter(), time.process_time()
    verdict: dict[str, Any] = {"session": path.name}
    try:
        verdict["summary"] = diagnose_sessions([path], candidates, (), _quiet).summary()
    except StationError as error:
        verdict["error"] = str(error)
    except Exception as error:  # noqa: BLE001 - a diagnosis that breaks is a result of the study, and the worst one
        verdict["error"] = f"{type(error).__name__}: {error}"
    verdict["seconds"] = time.perf_counter() - begun
    verdict["processor_s"] = time.process_time() - begun_processor
    verdict["memory_mb"] = largest_memory_mb()
    write_text(kept / f"{path.name}.json", json.dumps(verdict, indent=1) + "\n", force=True)


def _quiet(_: str) -> None: ...
