"""Figure of the study on concealed gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, in_style
from dbbstation.report.figure_format import FigureFormat, Stamped, in_format

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from studies.concealed_gravity import ConcealedGravity

COLOURS = (MEASURED, BEFORE, AFTER)


def concealed_figure(study: ConcealedGravity, wanted: FigureFormat | Stamped = FigureFormat.SVG) -> bytes:
    """Draw residuals on the jig, the tilted circle and the pull on the joints, as SVG."""
    with in_style():
        figure = Figure(figsize=(11.0, 5.4), layout="constrained")
        jig, pull = figure.add_subplot(1, 3, 1), figure.add_subplot(1, 3, 3)
        _residuals(jig, study)
        _circle(figure.add_subplot(1, 3, 2, projection="polar"), study)
        _pull(pull, study)
        return in_format(figure, wanted)


def _residuals(axes: Axes, study: ConcealedGravity) -> None:
    names = [name for name, _, _ in study.per_test_um]
    place = np.arange(len(names))
    axes.bar(place - 0.2, [before for _, before, _ in study.per_test_um], 0.4, color=COLOURS[1], label="kinematic")
    axes.bar(place + 0.2, [after for _, _, after in study.per_test_um], 0.4, color=COLOURS[2], label="with gravity")
    axes.set_xticks(place, names)
    axes.set_ylabel("residual within mountings, µm rms")
    axes.set_title("on the jig: looks almost fine")
    axes.legend()


def _circle(axes: Axes, study: ConcealedGravity) -> None:
    angle = np.radians(np.append(study.theta_deg, 360.0))
    reach = max(float(np.abs(curve).max()) for curve in study.left_um.values())
    for colour, (name, curve) in zip(COLOURS, study.left_um.items(), strict=True):
        label = f"{name}: {np.ptp(curve):.1f} µm"
        axes.plot(angle, 1.6 * reach + np.append(curve, curve[0]), color=colour, label=label, linewidth=1.2)
    axes.plot(angle, np.full(len(angle), 1.6 * reach), color="black", linewidth=0.5, linestyle=":")
    axes.set_yticks([])
    axes.set_title("tilted by -23°: circularity left after", pad=14)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08))


def _pull(axes: Axes, study: ConcealedGravity) -> None:
    shifts = study.diagnosis.shifts[:10][::-1]
    names = [
        shift.parameter.replace("base-joints joint_", "joint ").replace("strut-reference-length ", "")
        for shift in shifts
    ]
    axes.barh(range(len(shifts)), [shift.shift_um for shift in shifts], color=COLOURS[1])
    axes.set_yticks(range(len(shifts)), [name.replace("_", " ") for name in names])
    axes.axvline(0.0, color="black", linewidth=0.5)
    axes.set_xlabel("pulled by, µm")
    axes.set_title("what gravity did to the calibration")
