"""A whole diagnosis against the kinematic calibration of the same runs, and how it grows.

    python benchmarks/diagnosis.py [--json]

The simulated machine of the tests records the fifteen circles of [CAL Table II] in both directions with gravity, which
has to be found. The diagnosis looks at every source that is known: single ones, pairs of the best eight, unnamed curves,
verdicts, left-out tests, draws, next tests. Its peer is the kinematic calibration of the runs as read, in the same
process. Growth: with the rate of recording, all sources; with the number of sources, at 50 Hz. Readings are averaged over
half degrees first, so that the growth with samples ends at about 100 Hz.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

from dbbstation.calibration.fit import calibrate
from dbbstation.diagnosed import default_candidates
from dbbstation.diagnosis.diagnose import diagnose, usable_sources
from dbbstation.recorded import Recorded, load_sessions
from dbbstation.sources.registry import known_sources, sources_named
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

if TYPE_CHECKING:
    from dbbstation.sources.contract import ErrorSource

SEED = 5
RATES_HZ = (10.0, 25.0, 50.0, 100.0, 250.0)
COUNTS = (1, 4, 8, 16)


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as made:
        rows = [row for rate in RATES_HZ for row in by_rate(Path(made), rate)]
        rows += by_count(Path(made))
    show("diagnosis of thirty runs", rows, "best of 2 calls after one that warms up")


def by_rate(folder: Path, rate_hz: float) -> list[Row]:
    """Time of a diagnosis with all sources on one session."""
    data = recorded(folder, rate_hz)
    usable = candidates(data, len(known_sources()))
    peer = timed(lambda: calibrate(data.machine, data.observations), 3)
    whole = timed(lambda: diagnose(data.machine, data.observations, usable), 2)
    samples = sum(len(observation.raw) for observation in data.observations)
    said = f"{samples:,} samples, {len(usable)} sources; {whole.best_s / peer.best_s:.0f} calibrations"
    return [
        Row(f"at {rate_hz:g} Hz", whole.best_s, "s", said + ("; wanted: below 30" if rate_hz == RATES_HZ[2] else ""))
    ]


def by_count(folder: Path) -> list[Row]:
    """Time of a diagnosis with few and many sources on one session."""
    data = recorded(folder, RATES_HZ[2])
    rows = []
    for count in COUNTS:
        usable = candidates(data, count)
        whole = timed(partial(diagnose, data.machine, data.observations, usable), 2)
        rows.append(Row(f"{count} sources", whole.best_s, "s", ", ".join(source.name for source in usable[:4])))
    return rows


def recorded(folder: Path, rate_hz: float) -> Recorded:
    """Thirty runs at a rate, made once."""
    session = folder / f"{rate_hz:g}"
    if not session.exists():
        errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
        record(session, seed=SEED, mechanisms=[errors, Gravity()], rate_hz=rate_hz)
    return load_sessions([session])


def candidates(data: Recorded, count: int) -> list[ErrorSource]:
    """So many sources, gravity first."""
    names = sorted(default_candidates(known_sources()), key=lambda name: name != "gravity")
    usable, _ = usable_sources(data.machine, data.observations, sources_named(names))
    return usable[:count]


if __name__ == "__main__":
    main()
