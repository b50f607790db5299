"""The diagnosis of one drive against reading and filtering of the same recording.

    python benchmarks/drive.py [--quick] [--json]

The simulated drive of the tests travels to and fro for 25 s at 1 kHz with Coulomb friction that differs by direction, which has
to be found. Its peer is what every identification does first: speed, acceleration and the band, in the same process. `--quick`
is a third of the recording, once, to see that it works.
"""

from __future__ import annotations

import sys
from functools import partial

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.recordings import recordings_of
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, record, to_and_fro

SECONDS, QUICK_SECONDS = 25.0, 8.0
WANTED_S = 6.0
"""A diagnosis of 25 s at 1 kHz on one core."""


def main() -> None:
    """Measure and print."""
    quick = "--quick" in sys.argv
    calls = 1 if quick else 2
    truth = Truth(coulomb=20.0, viscous_asymmetry=-40.0)
    columns = record(truth, to_and_fro(seconds=QUICK_SECONDS if quick else SECONDS))  # type: ignore[no-untyped-call]
    recordings = [DriveRecording("simulated", *columns)]
    sources = list(known_drive_sources().values())
    found = identify(recordings, sources)
    if not {"coulomb-friction", "friction-asymmetry"} <= set(found.chosen):
        raise SystemExit(f"found {', '.join(found.chosen)} only")
    peer, whole = timed(partial(recordings_of, recordings), calls), timed(partial(identify, recordings, sources), calls)
    rows = [
        Row("speed, acceleration, band", peer.best_s, "s"),
        Row("diagnosis", whole.best_s, "s", f"{whole.best_s / peer.best_s:.0f} times that; wanted {WANTED_S:g} s"),
    ]
    show("diagnosis of a drive" + (", quick form" if quick else ""), rows, f"best of {calls} after one that warms up")


if __name__ == "__main__":
    main()
