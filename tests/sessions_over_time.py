"""Many sessions of one machine over the weeks, made from the small recorded one."""

from __future__ import annotations

import hashlib
import re
import shutil
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.files.places import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

BEGUN = datetime(2017, 1, 2, 8, tzinfo=UTC)
TURN_S = 2.0 * np.pi * 150.0 / 1000.0 * 60.0
"""A circle of 150 mm at 1000 mm/min."""

BEGINS_S, OVERSHOOT_RAD = 1.0, np.pi / 4.0
"""When the feed-in of these recordings is over, about [s], and how far before +X the circle begins then."""


def sessions_over_time(
    folder: Path,
    count: int,
    *,
    seed: int,
    step_at: int,
    step_um: float,
    long_at: int = -1,
    long_um: float = 0.0,
    tests: Sequence[str] = ("a",),
) -> None:
    """Make weekly sessions: each with a centre and a length of its own, 0.7 µm one standard deviation, and 0.4 µm of two undulations.

    Args:
        count: of sessions, `w001` and so on.
        step_at: from this session on, counted from 0, the centre is further in X.
    """
    rng = np.random.default_rng(seed)
    small = shipped_folder("fixtures") / "sessions" / "small"
    for week in range(count):
        place = folder / f"w{week + 1:03d}"
        (place / "runs").mkdir(parents=True)
        for name in ("machine.yaml", "plan.yaml"):
            shutil.copy(small / name, place / name)
        lines = (small / "session.yaml").read_text("utf-8").splitlines(keepends=True)
        text = "".join(one for one in lines if "{test" not in one or _wanted(one, tests))
        own_um = rng.normal((step_um * (week >= step_at), 0.0, long_um * (week == long_at), 0.0), (0.7, 0.7, 0.7, 0.4))
        for source in sorted((small / "runs").glob("*.csv")):
            if source.name not in text:
                continue
            run = place / "runs" / source.name
            sense = -1.0 if "-cw-" in run.name else 1.0
            run.write_text(_changed(source.read_text("utf-8"), own_um, sense), encoding="utf-8")
            text = text.replace(_sha256(source), _sha256(run))
        day = BEGUN + timedelta(weeks=week)
        text = re.sub(r"2026-11-20T(\d\d:\d\d:\d\dZ, state)", rf"{day:%Y-%m-%d}T\1", text)
        (place / "session.yaml").write_text(text, encoding="utf-8")


def _wanted(line: str, tests: Sequence[str]) -> bool:
    test = re.search(r"test: (\w+)", line)
    return "state: accepted" in line and bool(test) and test[1] in tests


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _changed(text: str, own_um: Sequence[float], sense: float) -> str:
    """Move the centre by (x, y), lengthen the bar, add two undulations. Lines lose their checksums."""
    x, y, longer, oval = (1e-3 * value for value in own_um)
    out = []
    for line in text.splitlines():
        cells = line.split(",")
        if line.startswith("t_s"):
            line = ",".join(cells[:-1])  # noqa: PLW2901 - the header loses its last column
        elif re.match(r"[-\d]", line):
            angle = sense * (2.0 * np.pi * (float(cells[0]) - BEGINS_S) / TURN_S - OVERSHOOT_RAD)
            length = float(cells[1]) + longer + x * np.cos(angle) + y * np.sin(angle) + oval * np.cos(2.0 * angle)
            line = ",".join([cells[0], f"{length:.5f}", *cells[2:-1]])  # noqa: PLW2901 - as above
        out.append(line)
    return "\n".join(out) + "\n"
