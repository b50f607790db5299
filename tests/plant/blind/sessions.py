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
from tests.plant.blind.disturbances import DISTURBANCES
from tests.plant.blind.hide import Hidden, Hider
from tests.plant.blind.listed import CONCEALED, SINGLE
from tests.plant.blind.unlisted import UNLISTED
from tests.plant.session import record
from tests.plant.truth import plain

if TYPE_CHECKING:
    from collections.abc import Callable

FORMAT = "blind-answers/1"
KINDS = ("clean", "single", "pair", "outside", "concealed", "triple", "faint", "disturbed")

TOGETHER = {"pair": 2, "triple": 3}
"""Kinds in which several effects of the list are hidden, and how many."""


@dataclass(frozen=True)
class Task:
    """One session to be made: its number, what kind of thing is hidden, and by which name the drawing begins.

    With `perturbed` what is hidden follows its law only roughly.
    """

    number: int
    kind: str
    name: str | None
    perturbed: bool = False

    @property
    def folder(self) -> str:
        return f"{self.number:04d}"


def tasks(counts: dict[str, int], seed: int, perturbed_share: float = 0.0) -> list[Task]:
    """All sessions of a study, shuffled; the names of each kind come in turn. Kinds that are not counted are left out."""
    rng = np.random.default_rng([seed, 1])
    names = {"single": list(SINGLE), "outside": list(UNLISTED), "concealed": list(CONCEALED)}
    for of_kind in names.values():
        rng.shuffle(of_kind)
    # Streams of their own, so that a study without these is the one that its seed has always made.
    names["faint"] = np.random.default_rng([seed, 4]).permutation(SINGLE).tolist()
    names["disturbed"] = np.random.default_rng([seed, 6]).permutation(list(DISTURBANCES)).tolist()
    wanted = [
        (kind, names[kind][k % len(names[kind])] if kind in names else None)
        for kind in KINDS
        for k in range(counts.get(kind, 0))
    ]
    perturbed = np.random.default_rng([seed, 5]).random(len(wanted)) < perturbed_share
    order = rng.permutation(len(wanted))
    return [
        Task(number, *wanted[place], bool(perturbed[place])) for number, place in enumerate(order.tolist(), start=1)
    ]


def make_session(out: FilePath, seed: int, task: Task) -> dict[str, Any]:
    session_seed = int(np.random.default_rng([seed, task.number]).integers(2**31))
    rng = np.random.default_rng([session_seed, 2])
    circumstances = drawn(rng, session_seed)
    hidden: list[Hidden] = []
    if task.kind != "clean":
        hider = Hider(rng, circumstances)
        hidden = _hidden(hider, task)
        if task.perturbed:
            deviations = np.random.default_rng([session_seed, 3])
            hidden = [hider.perturbed(item, deviations) for item in hidden]
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
        "perturbed": any(item.perturbation is not None for item in hidden),
        "effects": [item.answer for item in hidden],
        "raised_bars": "raised" in circumstances.plan_kind,
        "circumstances": circumstances.told(),
        "truth": truth.as_dict(),
    }


def _hidden(hider: Hider, task: Task) -> list[Hidden]:
    if task.kind in TOGETHER:
        return hider.several(TOGETHER[task.kind])
    if task.name is None:
        raise ValueError(f"{task.kind} needs a name by which the drawing begins")
    by_name = {
        "single": hider.single,
        "faint": hider.faint,
        "outside": hider.outside,
        "concealed": hider.concealed,
        "disturbed": hider.disturbed,
    }
    return by_name[task.kind](task.name)


def make_study(
    out: FilePath,
    counts: dict[str, int],
    seed: int,
    jobs: int | None,
    told: Callable[[int], None],
    *,
    perturbed_share: float = 0.0,
) -> FilePath:
    """Write all sessions and `answers.json`, outside of every session; return its path.

    Of the sessions in which something is hidden, `perturbed_share` have effects that follow their law only roughly.
    """
    out.mkdir(parents=True, exist_ok=True)
    work = partial(make_session, out, seed)
    answers = []
    with ProcessPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        for answer in pool.map(work, tasks(counts, seed, perturbed_share)):
            answers.append(answer)
            told(len(answers))
    sealed = out / "answers.json"
    head = {"format": FORMAT, "seed": seed, "counts": counts, "perturbed_share": perturbed_share}
    text = json.dumps({**head, "sessions": answers}, default=plain)
    sealed.write_text(text + "\n", encoding="utf-8")
    return sealed
