"""Draw docs/images/circles.svg: two circles before and after calibration, in the manner of [CAL Fig 6].

Run from the checkout: .venv/bin/python -m docs.figures.circles

The machine is simulated by tests/plant, which shares no code with the package. Its errors are drawn with standard
deviations of 0.05 mm for struts and 0.1 mm for base joints; ball holders, CMM, bar and readings scatter. The fifteen
circles of [CAL Table II] are recorded and calibrated; then they are recorded anew, balls put up anew, with every pose
commanded through the inverse of the calibrated model.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.model.compensation import compensated
from dbbstation.sources.contract import Motion
from dbbstation.tasks.load import load_sessions
from dbbstation.trace.analysis import figures
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from dbbstation.model.observation import Observation
    from tests.plant.run import Slot

SHOWN = {"d": "d: corner of the jig, tilted by -10° and 10°", "k": "k: centre of the jig, upper level"}
DIVISION_UM = 50.0
REFERENCE_UM = 4 * DIVISION_UM
POINTS = 360
"""Drawn of each circle."""
BEFORE, AFTER = "#c0392b", "#1f5f99"
TARGET = Path(__file__).parent.parent / "images" / "circles.svg"


def sessions(folder: Path) -> tuple[list[Observation], list[Observation]]:
    """Record, calibrate and record again; return the shown circles before and after."""
    rng = np.random.default_rng(7)
    errors = Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=rng.normal(0, 0.1, (6, 3)))
    plan = table_ii_plan(7)
    record(folder / "before", seed=1, plan=plan, mechanisms=[errors])
    before = load_sessions([folder / "before"])
    model = calibrate(before.machine, before.observations).model

    def reprogrammed(slot: Slot, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        del slot
        return compensated(model, Motion(poses, is_path=True))

    again = subset(plan, list(SHOWN))
    record(folder / "after", seed=2, plan=again, mechanisms=[errors], reprogram=reprogrammed, rate_hz=20.0, angles=True)
    after = load_sessions([folder / "after"])
    return [o for o in before.observations if o.test in SHOWN], list(after.observations)


def draw(axes: Axes, title: str, before: list[Observation], after: list[Observation]) -> None:
    """Draw both directions of one circle, deviations magnified, about the circle as commanded."""
    turn = np.radians(np.linspace(0.0, 360.0, 361))
    for ring in np.arange(1, 7) * DIVISION_UM:
        wanted = ring == REFERENCE_UM
        axes.plot(
            ring * np.cos(turn),
            ring * np.sin(turn),
            color="0.45" if wanted else "0.85",
            lw=1.0 if wanted else 0.5,
        )
    for observations, colour, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        for k, o in enumerate(observations):
            every = len(o.raw) // POINTS
            deviation_um = 1e3 * (o.raw.length_mm - o.raw.circle.bar_mm)
            angle, radius = np.radians(o.raw.theta_deg)[::every], REFERENCE_UM + deviation_um[::every]
            axes.plot(radius * np.cos(angle), radius * np.sin(angle), color=colour, lw=1.2, label=None if k else label)
    axes.set_title(title, fontsize=9)
    axes.set_aspect("equal")
    axes.axis("off")


def main() -> None:
    """Make the figure and say its numbers."""
    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "dbbstation"
    with tempfile.TemporaryDirectory() as folder:
        before, after = sessions(Path(folder))
    drawing, panels = plt.subplots(1, 2, figsize=(7.5, 4.3))
    for axes, (test, title) in zip(panels, SHOWN.items(), strict=True):
        draw(axes, title, *([o for o in runs if o.test == test] for runs in (before, after)))
    drawing.legend(*panels[0].get_legend_handles_labels(), loc="lower center", ncols=2, frameon=False, fontsize=9)
    drawing.text(
        0.5,
        0.09,
        f"one ring is {DIVISION_UM:.0f} µm; the dark ring is the circle as commanded",
        ha="center",
        fontsize=8,
    )
    drawing.subplots_adjust(left=0.01, right=0.99, top=0.93, bottom=0.13, wspace=0.03)
    drawing.savefig(TARGET, metadata={"Date": None})
    for o in [*before, *after]:
        f = figures(o.raw)
        sys.stdout.write(
            f"{o.label:10} centre deviation {f.centre_deviation_um:6.1f} µm, mean radial error "
            f"{f.mean_radial_error_um:6.1f} µm, circularity {f.circularity_um:5.1f} µm\n"
        )


if __name__ == "__main__":
    main()
