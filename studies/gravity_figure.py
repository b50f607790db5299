"""Circularity against tilt [GRAV Fig 6]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from dbbstation.report.drawing import AFTER, BEFORE, MEASURED, in_style
from dbbstation.report.figure_format import FigureFormat, Stamped, in_format
from studies.gravity import JOINT, PUBLISHED_UM, SEQUENTIAL, WITHOUT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from studies.gravity import GravityStudy

TICKS_UM = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)


def gravity_figure(study: GravityStudy, wanted: FigureFormat | Stamped = FigureFormat.SVG) -> bytes:
    """Draw circularity of one centre's conditions against tilt, for both identifications."""
    with in_style():
        figure = Figure(figsize=(9.6, 4.2), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        _panel(left, study, SEQUENTIAL)
        _panel(right, study, JOINT)
        left.set_title("kinematics first, gravity from A and B then")
        right.set_title("kinematics and gravity together")
        left.set_ylabel("circularity, µm")
        return in_format(figure, wanted)


def same_place(study: GravityStudy) -> list[str]:
    """Return conditions about the centre of A, by tilt; [GRAV Fig 6] omits B and C."""
    names = [name for name in PUBLISHED_UM if study.centre_mm[name] == study.centre_mm["A"]]
    return sorted(names, key=lambda name: study.tilt_deg[name][0])


def _panel(axes: Axes, study: GravityStudy, way: str) -> None:
    names = same_place(study)
    tilt = [study.tilt_deg[name][0] for name in names]

    def median(of: str, kind: str) -> list[float]:
        return [float(np.median(study.figure(of, kind, name))) for name in names]

    published = np.array([PUBLISHED_UM[name] for name in names])
    axes.plot(tilt, published[:, 0], "o", color=BEFORE, fillstyle="none", label="published, without")
    axes.plot(tilt, published[:, 1], "s", color=AFTER, fillstyle="none", label="published, with")
    axes.plot(tilt, median(WITHOUT, "circularity_um"), "-", color=BEFORE, label="without compensation")
    axes.plot(tilt, median(way, "circularity_um"), "-", color=AFTER, label="with compensation")
    axes.plot(tilt, median(way, "expected_um"), "--", color=MEASURED, label="expected")
    axes.plot(tilt, median(way, "left_um"), ":", color=AFTER, label="with compensation, no noise")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator(TICKS_UM))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(0.05, 300.0)
    for name, at in zip(names, tilt, strict=True):
        axes.annotate(name, (at, 220.0), ha="center", va="center", fontsize=8)
    axes.set_xlabel("tilt A about X, degrees")
    axes.legend(fontsize=7, loc="upper right", bbox_to_anchor=(1.0, 0.93))
