"""A process that records runs into a session as fast as it can and says what it has done, to be killed at any moment."""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import Counts, Note, RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from dbbstation.station.storage import COLUMNS
from tests.station.bench import MACHINE_FILE

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from dbbstation.files.recordings.session import SessionFolder

PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
SAMPLES = 700
STEP_S = 0.1


def length_mm(run: str, sample: int) -> float:
    """What a sample of a run was, so that a wrong one is known."""
    return round(150.0 + 1e-5 * ((sum(run.encode()) * 31 + sample * 7) % 9973), 5)


def missing(session: SessionFolder, said: Iterable[str]) -> list[str]:
    runs = {f"{run.test}-{run.direction}-{run.repeat}": run for run in session.runs}
    notes = {note.text for note in session.notes}
    last: dict[str, str] = {}
    gone = []
    for line in said:
        kind, _, name = line.partition(" ")
        if kind in {"sealed", "accepted", "rejected"}:
            last[name] = kind
        elif kind == "noted" and name not in notes:
            gone.append(line)
    for name, kind in last.items():
        # What came behind may be noted and not told yet.
        run, later = runs.get(name), {"sealed": ("complete", "accepted"), "accepted": ("accepted", "rejected")}
        if run is None or run.state.value not in later.get(kind, ("rejected",)):
            gone.append(f"{kind} {name}")
        elif run.state is RunState.REJECTED and run.reason != name:
            gone.append(f"reason of {name}")
    return gone


def opened(folder: Path) -> SessionWriter:
    if (folder / "session.yaml").exists():
        return SessionWriter.open(folder)
    return SessionWriter.create(folder, read_machine(MACHINE_FILE), read_inline_plan(PLAN))


def record(folder: Path, told: int, pace_s: float = 0.0) -> None:
    """Record run after run; each line to `told` is about something that is done.

    `sample RUN N`: it was handed to the journal, which has written it. `sealed RUN`, `accepted RUN`, `rejected RUN`, `noted RUN`:
    event log and session file say so.

    Args:
        told: file descriptor that takes the lines.
    """

    def tell(line: str) -> None:
        os.write(told, f"{line}\n".encode())

    writer = opened(folder)
    tell("opened")
    while True:
        for direction in Direction:
            with writer.start_run("low", direction, COLUMNS, started=datetime.now(UTC), mounting=1) as journal:
                name = journal.sealed_path.stem
                for sample in range(SAMPLES):
                    journal.append((sample * STEP_S, length_mm(name, sample), "ok"))
                    tell(f"sample {name} {sample}")
                    if pace_s:
                        time.sleep(pace_s)
                done = writer.finish_run(journal, Counts(SAMPLES, 0, {}))
            tell(f"sealed {name}")
            done = writer.judge(done, accepted=True)
            tell(f"accepted {name}")
            writer.note(Note(datetime.now(UTC), name))
            tell(f"noted {name}")
            if direction is Direction.CW:
                writer.judge(done, accepted=False, reason=name)
                tell(f"rejected {name}")
