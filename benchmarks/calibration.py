"""A whole calibration against reading its files, and how long the program takes to start.

    python benchmarks/calibration.py [SESSION] [--json]

Without a session the simulated machine of the tests records one into a temporary folder: the fifteen circles of
[CAL Table II] in both directions at 1 kHz, 2.2 million samples of which 1.7 million lie on the circles, joints off by
0.1 mm, noise 0.5 µm. The peer is the reading of its files: bytes to circles, with checksums and cutting. The fit is
everything from circles to parameters, covariance and residuals; the evaluation is the table of circles before and
after. As a second peer the same fit is run sample by sample, which long runs are spared (docs/decisions.md, 2).

Starting times are of whole processes: `dbbstation --help`; and `dbbstation calibrate` on a small session with an empty
folder for compiled code, so that everything is compiled, and again with what the first one left there.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.measuring import ROOT, Row, show, timed, timed_once  # isort: skip - sets up the environment

import numpy as np

from dbbstation.calibration.fit import nodes
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

SEED = 5


def main() -> None:
    """Measure and print."""
    given = [Path(argument) for argument in sys.argv[1:] if not argument.startswith("-")]
    with tempfile.TemporaryDirectory() as made:
        rows = measured(given[0] if given else recorded(Path(made) / "long", 1000.0))
        rows += started(recorded(Path(made) / "short", 20.0), Path(made) / "compiled")
    show("calibration of a session, and starting", rows, "best of 5 calls after one that warms up; starts: best of 5")


def recorded(folder: Path, rate_hz: float) -> Path:
    """Make a session of thirty runs."""
    errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
    record(folder, seed=SEED, mechanisms=[errors], rate_hz=rate_hz)
    return folder


def measured(session: Path) -> list[Row]:
    """Times of reading, fitting and evaluating, and how far the two fits are apart."""
    read = timed(lambda: load_sessions([session]), 5)
    data = load_sessions([session])
    samples = sum(len(observation.raw) for observation in data.observations)
    fit = timed(lambda: calibrate(data.machine, data.observations), 5)
    calibration = calibrate(data.machine, data.observations)
    judged = timed(lambda: evaluate(calibration.model, data.observations), 5)
    long, nodes.LONG = nodes.LONG, samples
    every = timed(lambda: calibrate(data.machine, data.observations), 2)
    whole = calibrate(data.machine, data.observations)
    nodes.LONG = long
    sigma = np.sqrt(np.diag(whole.solution.covariance))
    apart = float(np.abs((calibration.x - whole.x)[sigma > 0.0] / sigma[sigma > 0.0]).max())
    return [
        Row("reading", read.best_s, "s", f"median {read.median_s:.2f}, {len(data.observations)} runs"),
        Row("fit", fit.best_s, "s", f"median {fit.median_s:.2f}, {samples:,} samples"),
        Row("evaluation", judged.best_s, "s", f"median {judged.median_s:.2f}"),
        Row("fit, share of reading", fit.best_s / read.best_s, "", "wanted: below 1"),
        Row("fit sample by sample", every.best_s, "s", f"median {every.median_s:.2f}"),
        Row("  estimates apart", apart, "of their uncertainty", "wanted: below 1e-6"),
    ]


def started(session: Path, cache: Path) -> list[Row]:
    """Times of whole processes."""
    program = [sys.executable, "-m", "dbbstation"]

    def run(*arguments: str) -> None:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
        subprocess.run([*program, *arguments], check=True, capture_output=True, cwd=ROOT, env=environment)  # noqa: S603

    first = timed_once(lambda: run("calibrate", str(session)))
    again = timed(lambda: run("calibrate", str(session)), 5)
    asked = timed(lambda: run("--help"), 5)
    return [
        Row("dbbstation --help", asked.best_s, "s", "imports neither SciPy nor the compiler"),
        Row("dbbstation calibrate, first", first, "s", "compiles; 30 runs at 20 Hz"),
        Row("dbbstation calibrate, later", again.best_s, "s", f"median {again.median_s:.2f}"),
    ]


if __name__ == "__main__":
    main()
