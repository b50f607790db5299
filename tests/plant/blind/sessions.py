"""A whole blind study: session folders in an order that says nothing, and one file of answers beside them."""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.circumstances import drawn, recorded_currents
from tests.plant.blind.hide import Hider
from tests.plant.blind.listed import CONCEALED, SINGLE
from tests.plant.blind.unlisted import UNLISTED
from tests.plant.session import record

if TYPE_CHECKING:
    from collections.abc import Callable

FORMAT = "blind-answers/1"
KINDS = ("clean", "single", "pair", "outside", "concealed")


@dataclass(frozen=True)
class Task:
    """One session to be made: its number, what kind of thing is hidden, and by which name the drawing begins."""

    number: int
    kind: str
    name: str | None

    @property
    def folder(self) -> str:
        """Name of the session's folder."""
        return f"{self.number:04d}"


def tasks(counts: dict[str, int], seed: int) -> list[Task]:
    """All sessions of a study, shuffled; the names of each kind come in turn."""
    rng = np.random.default_rng([seed, 1])
    names = {"single": list(SINGLE), "outside": list(UNLISTED), "concealed": list(CONCEALED)}
    for of_kind in names.values():
        rng.shuffle(of_kind)
    wanted = [
        (kind, names[kind][k % len(names[kind])] if kind in names else None)
        for kind in KINDS
        for k in range(counts[kind])
    ]
    order = rng.permutation(len(wanted))
    return [Task(number, *wanted[place]) for number, place in enumerate(order.tolist(), start=1)]


def make_session(out: FilePath, seed: int, task: Task) -> dict[str, Any]:
    """Write one session; return the answer to it. The same seed and task make the same bytes."""
    session_seed = int(np.random.default_rng([seed, task.number]).integers(2**31))
    rng = np.random.default_rng([session_seed, 2])
    circumstances = drawn(rng, session_seed)
    hidden = []
    if task.kind != "clean":
        hider = Hider(rng, circumstances)
        if task.kind == "pair":
            hidden = hider.pair()
        elif task.name is not None:
            hidden = {"single": hider.single, "outside": hider.outside, "concealed": hider.concealed}[task.kind](
                task.name
            )
    mechanisms = [circumstances.kinematics, *(item.mechanism for item in hidden)]
    truth = record(
        out / task.folder,
        seed=session_seed,
        plan=circumstances.plan,
        machine=circumstances.machine,
        mechanisms=[*mechanisms, *(recorded_currents() if circumstances.currents else ())],
        setup=circumstances.setup,
        noise=circumstances.noise,
        rate_hz=circumstances.rate_hz,
        timing=circumstances.timing,
        angles=circumstances.angles,
        crc=circumstances.crc,
        breaks_s=circumstances.breaks_s,
    )
    return {
        "session": task.folder,
        "seed": session_seed,
        "kind": task.kind,
        "effects": [item.answer for item in hidden],
        "raised_bars": "raised" in circumstances.plan_kind,
        "circumstances": circumstances.told(),
        "truth": truth.as_dict(),
    }


def make_study(
    out: FilePath, counts: dict[str, int], seed: int, jobs: int | None, told: Callable[[int], None]
) -> FilePath:
    """Write all sessions and `answers.json`, outside of every session; return its path."""
    out.mkdir(parents=True, exist_ok=True)
    work = partial(make_session, out, seed)
    answers = []
    with ProcessPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        for answer in pool.map(work, tasks(counts, seed)):
            answers.append(answer)
            told(len(answers))
    sealed = out / "answers.json"
    text = json.dumps({"format": FORMAT, "seed": seed, "counts": counts, "sessions": answers}, default=_plain)
    sealed.write_text(text + "\n", encoding="utf-8")
    return sealed


def _plain(value: object) -> object:
    if isinstance(value, (np.ndarray, np.floating, np.integer, np.bool_)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in an answer")
