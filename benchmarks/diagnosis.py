"""A whole diagnosis against the kinematic calibration of the same runs, and how it grows.

    python benchmarks/diagnosis.py [--quick] [--json]

The simulated machine of the tests records the fifteen circles of [CAL Table II] in both directions with gravity, which
has to be found. The diagnosis compares sets of all causes that are known and of unmodelled effects, fits the best set
exactly, reads verdicts off, predicts left-out tests, draws parts of the tests, and asks for next tests. Its peer is the kinematic calibration of the runs as read, in the same
process, minutes before. Growth: with the rate of recording, all sources; with the number of sources, at 50 Hz. Readings
are averaged over half degrees first, so that the growth with samples ends at about 100 Hz. `--quick` is a tenth of it,
once, to see that it works.
"""

from __future__ import annotations

import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.diagnosis.diagnose import diagnose, usable_sources
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.diagnosed import default_candidates
from dbbstation.tasks.load import Recorded, load_sessions
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.sources.contract import ErrorSource

SEED = 5
RATES_HZ = (10.0, 25.0, 50.0, 100.0, 250.0)
COUNTS = (1, 4, 8, 16)
FEW = 4
"""Sources that are named beside their number."""

USUAL_HZ, QUICK_HZ = 50.0, 10.0
WANTED_S = 10.0
"""A diagnosis of thirty runs at the usual rate, with all sources."""


def main() -> None:
    """Measure and print."""
    quick = "--quick" in sys.argv
    rates, usual, counts, calls = ((QUICK_HZ,), QUICK_HZ, COUNTS[:2], 1) if quick else (RATES_HZ, USUAL_HZ, COUNTS, 2)
    with tempfile.TemporaryDirectory() as made:
        sessions = {rate: recorded(Path(made), rate) for rate in rates}
        rows = [row for rate, data in sessions.items() for row in by_rate(data, rate, calls)]
        rows += by_count(sessions[usual], counts, calls)
    title = "diagnosis of thirty runs" + (", quick form" if quick else "")
    show(title, rows, f"best of {calls} after one that warms up; calibration: best of 3")


def by_rate(data: Recorded, rate_hz: float, calls: int) -> list[Row]:
    """Time of a diagnosis with all sources on one session."""
    usable = candidates(data)
    whole, ratio = against_calibration(data, usable, calls)
    samples = sum(len(observation.raw) for observation in data.observations)
    wanted = f"; wanted: below {WANTED_S:g}" if rate_hz == USUAL_HZ else ""
    return [
        Row(f"all sources at {rate_hz:g} Hz", whole, "s", f"{samples:,} samples, {len(usable)} sources{wanted}"),
        Row("  over the calibration", ratio, "times"),
    ]


def by_count(data: Recorded, counts: Sequence[int], calls: int) -> list[Row]:
    """Time of a diagnosis with few and many sources on one session."""
    rows = []
    for count in counts:
        usable = candidates(data)[:count]
        whole, ratio = against_calibration(data, usable, calls)
        more = ", ..." if count > FEW else ""
        rows.append(
            Row(
                f"{count} source{'s' * (count > 1)}",
                whole,
                "s",
                ", ".join(source.name for source in usable[:FEW]) + more,
            )
        )
        rows.append(Row("  over the calibration", ratio, "times"))
    return rows


def against_calibration(data: Recorded, usable: Sequence[ErrorSource], calls: int) -> tuple[float, float]:
    """Seconds of a diagnosis, and how many times those of its peer that is; gravity must be found."""
    peer = timed(partial(calibrate, data.machine, data.observations), 3)
    verdicts: dict[str, Verdict] = {}

    def work() -> None:
        found = diagnose(data.machine, data.observations, usable)
        verdicts.update({finding.name: finding.verdict for finding in found.sources})

    whole = timed(work, calls)
    if verdicts["gravity"] is not Verdict.IDENTIFIED:
        raise SystemExit(f"gravity is {verdicts['gravity']}: this is not the work that was to be measured")
    return whole.best_s, whole.best_s / peer.best_s


def recorded(folder: Path, rate_hz: float) -> Recorded:
    """Thirty runs at a rate, made once."""
    session = folder / f"{rate_hz:g}"
    if not session.exists():
        errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
        record(session, seed=SEED, mechanisms=[errors, Gravity()], rate_hz=rate_hz)
    return load_sessions([session])


def candidates(data: Recorded) -> list[ErrorSource]:
    """All sources that these runs can be searched for, gravity first."""
    names = sorted(default_candidates(known_sources()), key=lambda name: name != "gravity")
    usable, _ = usable_sources(data.machine, data.observations, sources_named(names))
    return list(usable)


if __name__ == "__main__":
    main()
