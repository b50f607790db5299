"""What the verdicts of a session cost by its number of circles: sixty beside thirty, each judged beside those before it.

    python -m benchmarks.judging [--json]

The fifteen circles of [CAL Table II] in both directions, at 50 Hz, once and with a repeat of each: of a machine with errors of
0.05 mm, and of one without any, on which any circle fits any place. Processor time of this process.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show  # isort: skip - sets up the environment

from dbbstation.files.recordings.session import read_session
from dbbstation.station.events import RunAccepted, RunId
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import table_ii_plan
from tests.plant.session import record
from tests.station.judged import judge_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.files.recordings.session import SessionFolder
    from tests.plant.mechanisms.base import Mechanism

SEED = 8
RATE_HZ = 50.0
WANTED = 2.2


def cost_s(session: SessionFolder) -> list[float]:
    """Return what each verdict costs: its circle analysed, and judged beside those before it [s]."""
    judge, costs = judge_of(session), []
    for entry in session.runs:
        recording, run = (
            session.load(entry).recording,
            RunId(entry.test, entry.direction, entry.repeat, entry.mounting or 0),
        )
        begun = time.process_time()
        judge.judge(run, recording)
        judge(RunAccepted(run))
        costs.append(time.process_time() - begun)
    return costs


def main() -> None:
    """Measure and print."""
    rows = [*measured("errors", [RandomKinematics()]), *measured("no errors", [])]
    show("verdicts while a session is measured", rows, "processor time, second of two rounds")


def measured(machine: str, mechanisms: Sequence[Mechanism]) -> list[Row]:
    """Return the cost of verdicts on a machine, named in the rows."""
    plan = table_ii_plan(SEED)
    again = replace(plan, repeat_at_end=tuple(test.name for test in plan.tests))
    costs = []
    with tempfile.TemporaryDirectory() as folder:
        for k, each in enumerate((plan, again)):
            place = Path(folder) / str(k)
            record(place, seed=SEED, plan=each, rate_hz=RATE_HZ, mechanisms=mechanisms)
            cost_s(read_session(place))
            costs.append(cost_s(read_session(place)))
    once, twice = costs
    return [
        Row(f"{machine}: {len(once)} circles", sum(once), "s"),
        Row(f"{machine}: {len(twice)} circles", sum(twice), "s"),
        Row("  ratio", sum(twice) / sum(once), "times", f"wanted: {WANTED:g} at the most"),
        Row("third circle", 1e3 * twice[2], "ms"),
        Row("last circle", 1e3 * twice[-1], "ms"),
    ]


if __name__ == "__main__":
    main()
