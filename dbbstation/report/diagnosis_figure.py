"""Figure of a diagnosis."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.checks.scatter import fine_noise_mm
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.calibration.reporting.residual_map import residual_map
from dbbstation.computing.arrays import largest_size
from dbbstation.diagnosis.shapes import EVERY, PULL, SIGNED, TOWARDS
from dbbstation.inference.levels import Verdict
from dbbstation.plan.plan import Direction
from dbbstation.report.drawing import (
    AFTER,
    BEFORE,
    DIRECTIONS,
    LINE_OF_DIRECTION,
    MEASURED,
    QUARTERS,
    ROW_IN,
    WIDTH_IN,
    ShownFigure,
    draw_maps,
    heading,
    in_style,
    labelled,
    legend_above,
    zero_line,
)
from dbbstation.report.figure_format import FigureFormat, Wanted, in_format
from dbbstation.results.frame import OnePanel
from dbbstation.results.levels_text import place_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drawn import Branch, GainOfTest, SourceCurves
    from dbbstation.diagnosis.findings import Curve, Diagnosis
    from dbbstation.inference.levels import Followed
    from dbbstation.report.drawing import LineStyle


PER_WAVE = 24
"""Number of points of a drawn wave."""

SENSES = {-1.0: "shortening", 1.0: "lengthening"}


def draw_unexplained(part: SubFigure, curve: Curve) -> None:
    """Draw one curve; the two directions of travel are points with bars."""
    axes: Axes = part.subplots()
    at, value, sigma = _between(curve)
    if curve.unit == "sign":
        axes.errorbar(at, value, 2.0 * sigma, color=AFTER, marker="o", markersize=4.0, linewidth=0.0, elinewidth=1.2)
        axes.set_xticks(list(SENSES), [*SENSES.values()])
        axes.set_xlim(-2.0, 2.0)
        axes.set_xlabel("sense of travel")
    else:
        axes.fill_between(at, value - 2.0 * sigma, value + 2.0 * sigma, color=AFTER, alpha=0.3, linewidth=0.0)
        axes.plot(at, value, color=AFTER, linewidth=1.0)
        axes.set_xlim(at[0], at[-1])
        axes.set_xlabel(f"{curve.follows.variable.replace('-', ' ')}, {'°' if curve.unit == 'deg' else curve.unit}")
    zero_line(axes)
    axes.set_ylabel("µm, ±2u")
    axes.set_title(curve.convention, loc="right")
    heading(part, f"without a name: {_whose(curve)}, cause unknown")


def _whose(curve: Curve) -> str:
    wave = "" if curve.period_mm is None else f"a wave of {curve.period_mm:.2f} mm: "
    if curve.strut is not None:
        return f"{wave}error of strut {curve.strut}"
    return f"{wave}error of {WHOSE.get(curve.follows.moves, f'the {curve.follows.moves}')}"


WHOSE = {EVERY: EVERY, SIGNED: EVERY, PULL: "every strut by a pull", TOWARDS: "every strut by a pull towards a place"}
"""The moving part, for titles; bodies have their own names."""


def _between(curve: Curve) -> tuple[Floats, ...]:
    """Return positions, values and uncertainties, shape (n,) each [µm]; waves are interpolated."""
    at, value, sigma = np.array([(p.at, p.value_um, p.uncertainty_um) for p in curve.points]).T
    if curve.period_mm is None or len(at) < 3:  # noqa: PLR2004 (amplitudes need as many points)
        return at, value, sigma
    # A wave is one of cosine and sine; its variance is one of twice the angle beside a constant.
    fine = np.linspace(at[0], at[-1], 1 + int(np.ceil(PER_WAVE * (at[-1] - at[0]) / curve.period_mm)))
    turn = 2.0 * np.pi / curve.period_mm
    wave = _cosine_and_sine(turn * fine) @ np.linalg.lstsq(_cosine_and_sine(turn * at), value, rcond=None)[0]
    given, wanted = (np.column_stack([np.ones(len(x)), _cosine_and_sine(2.0 * turn * x)]) for x in (at, fine))
    variance = wanted @ np.linalg.lstsq(given, sigma**2, rcond=None)[0]
    return fine, wave, np.sqrt(np.maximum(variance, 0.0))


def _cosine_and_sine(angle_rad: Floats) -> Floats:
    return np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])


TRACES = 4
"""Number of tests whose traces are drawn."""

LINE_OF = {"": "-", "lengthening": "-", "shortening": "--"}
MARKER_OF = {"": "o", "lengthening": "^", "shortening": "v"}


def diagnosis_figure(
    diagnosis: Diagnosis, gains: Sequence[GainOfTest], curves: Sequence[SourceCurves], wanted: Wanted = FigureFormat.SVG
) -> Any:  # noqa: ANN401 - as `in_format`
    """Draw maps, errors over their variables, traces and gains, as SVG."""
    with in_style():
        if isinstance(wanted, OnePanel):
            found = diagnosis.after is not diagnosis.before
            draw = partial(_pairs, names=[one.name for one in gains], found=found)
            return wanted.draw(
                {
                    "residual": partial(draw, values=[one.residual_um for one in gains]),
                    "circularity": partial(draw, values=[one.circularity_um for one in gains]),
                    "levels": partial(_levels, classes=_tested(diagnosis)),
                }
            )
        return in_format(draw_diagnosis(diagnosis, gains, curves), wanted)


def draw_diagnosis(diagnosis: Diagnosis, gains: Sequence[GainOfTest], curves: Sequence[SourceCurves]) -> ShownFigure:
    """Draw all non-empty parts, one below the other."""
    found = diagnosis.after is not diagnosis.before
    unnamed = diagnosis.unexplained.curve
    classes = _tested(diagnosis)
    own = [1.0 + 2.0 * ROW_IN * len(classes)] if classes else []
    heights = [1.0 + ROW_IN * len(gains), *(2.1 for _ in curves), *([2.1] if unnamed else []), 4.6, 2.4, *own]
    figure = ShownFigure(figsize=(WIDTH_IN, sum(heights) + 0.4), layout="constrained")
    figure.suptitle(_headline(diagnosis, [one.source for one in curves if one.source]), fontsize=11, fontweight="bold")
    parts: Any = figure.subfigures(len(heights), 1, height_ratios=heights, hspace=0.03)
    _maps(parts[0], diagnosis, found=found)
    for part, one in zip(parts[1:], curves, strict=False):
        _curves(part, one, None if one.source else diagnosis.unexplained.strut, found=found)
    if classes:
        _levels(parts[-1].subplots(), classes)
        parts = parts[:-1]
    if unnamed is not None:
        draw_unexplained(parts[-3], unnamed)
    _traces(parts[-2], gains, found=found)
    _bars(parts[-1], diagnosis, gains, found=found)
    return figure


def _tested(diagnosis: Diagnosis) -> list[Followed]:
    return [one for one in diagnosis.levels.follows if one.before is not None and one.after is not None]


def _levels(axes: Axes, classes: Sequence[Followed]) -> None:
    place = np.arange(len(classes))
    for off, colour, label in ((-0.2, BEFORE, "before"), (0.2, AFTER, "after")):
        axes.barh(place + off, [getattr(one, label) for one in classes], 0.4, color=colour, label=label)
    axes.set_yticks(place, [place_of(one) for one in classes])
    axes.invert_yaxis()
    axes.set_xlabel("error in tests left out, µm rms")
    axes.set_title("what the difference follows, and where", loc="left")
    axes.legend(loc="lower right")


def _headline(diagnosis: Diagnosis, modelled: Sequence[str]) -> str:
    if not diagnosis.mismatch:
        return "The recordings agree with the kinematic model"
    told = [s for s in diagnosis.sources if s.verdict.rank <= Verdict.AMBIGUOUS.rank]
    # What is only mistaken for one of them stands in the table, and may be many.
    named = [f"{s.name} ({s.verdict})" for s in told if s.name in modelled or not modelled]
    return "Found: " + ", ".join(named) if named else diagnosis.unexplained.text


def _maps(part: SubFigure, diagnosis: Diagnosis, *, found: bool) -> None:
    fits = [("kinematic model", diagnosis.before)] + [("with causes found", diagnosis.after)] * found
    maps = [residual_map(fit.observations, fit.residual_mm) for _, fit in fits]
    panels: Any = part.subplots(1, 2 * len(fits), sharey=True)
    mesh = draw_maps(panels, [title for title, _ in fits], maps, 1e3 * fine_noise_mm(diagnosis.after))
    part.colorbar(mesh, ax=list(panels), label="measured less model, µm", pad=0.01)


def _curves(part: SubFigure, one: SourceCurves, marked: int | None, *, found: bool) -> None:
    what = "strut-length error" if one.struts else "error of the reading"
    over = one.variable.replace("-", " ")
    heading(part, f"{one.source or 'without a name'}: {what} over {over}")
    panels: Any = part.subplots(1, len(one.struts) or 1, sharey=True, squeeze=False)[0]
    for k, axes in enumerate(panels):
        for branch in one.struts[k] if one.struts else one.reading:
            _branch(axes, branch, found=found, fine=one.fine)
        if one.struts:
            axes.set_title(f"strut {k + 1}", fontweight="bold" if k + 1 == marked else "normal")
        zero_line(axes)
        axes.locator_params(axis="x", nbins=4 if one.struts else 10)
        axes.set_xlabel(f"{over}, {one.unit}")
    panels[0].set_ylabel("µm" if one.fine else "µm, bars ±2σ")
    _legend_of_curves(part, panels[0], (one.struts or (one.reading,))[0], found=found)


def _branch(axes: Axes, branch: Branch, *, found: bool, fine: bool) -> None:
    x = branch.variable
    if fine:
        axes.plot(x, branch.after_um, color=AFTER if found else BEFORE, linewidth=0.6)
        return
    marks: LineStyle = {"markersize": 3.0, "linewidth": 0.0, "elinewidth": 0.8, "marker": MARKER_OF[branch.sense]}
    axes.errorbar(x, branch.before_um, 2.0 * branch.sigma_um, color=BEFORE, **marks)
    if found:
        axes.errorbar(x, branch.after_um, 2.0 * branch.sigma_um, color=AFTER, **marks)
        axes.plot(x, branch.model_um, color="black", linewidth=1.0, linestyle=LINE_OF[branch.sense])


def _legend_of_curves(part: SubFigure, axes: Axes, branches: Sequence[Branch], *, found: bool) -> None:
    dot: LineStyle = {"linewidth": 0.0, "marker": "o", "markersize": 3.0}
    lines: dict[str, LineStyle] = {"residual of the kinematic model": {"color": BEFORE, **dot}}
    black: LineStyle = {"color": "black", "linewidth": 1.0}
    if found:
        lines |= {"joint model and its residual": {"color": AFTER, **dot}, "joint model": black}
    for sense in (branch.sense for branch in branches if branch.sense):
        lines[sense] = black | {"marker": MARKER_OF[sense], "markersize": 3.0, "linestyle": LINE_OF[sense]}
    legend_above(part, axes, lines)


def _traces(part: SubFigure, gains: Sequence[GainOfTest], *, found: bool) -> None:
    key = (lambda one: -one.gain_um) if found else (lambda one: -one.residual_um[0])
    chosen = sorted(gains, key=key)[:TRACES]
    which = "tests that gained most" if found else "tests with the largest residual"
    heading(part, f"traces of the {which}")
    panels: Any = part.subplots(3, len(chosen), sharex=True, sharey="row", squeeze=False)
    for column, one in zip(panels.T, chosen, strict=True):
        before, after = one.residual_um
        column[0].set_title(f"test {one.name}: {before:.1f} → {after:.1f} µm rms" if found else f"test {one.name}")
        for trace in one.traces:
            line = LINE_OF_DIRECTION[trace.direction]
            left = column[1 + list(Direction).index(trace.direction)]
            column[0].plot(trace.theta_deg, trace.measured_um, color=MEASURED, linewidth=2.0, linestyle=line, alpha=0.5)
            for values, colour in ((trace.before_um, BEFORE), (trace.after_um, AFTER))[: 1 + found]:
                column[0].plot(trace.theta_deg, values, color=colour, linewidth=0.9, linestyle=line)
                left.plot(trace.theta_deg, trace.measured_um - values, color=colour, linewidth=0.8)
        for axes in column:
            zero_line(axes)
            axes.set_xticks(QUARTERS)
            axes.set_xlim(0.0, 360.0)
        column[-1].set_xlabel("angle from +X to +Y, °")
    reach = 1.05 * max(largest_size(axes.get_ylim()) for axes in panels[1:, 0])
    panels[1, 0].set_ylim(-reach, reach)
    panels[2, 0].set_ylim(-reach, reach)
    panels[0, 0].set_ylabel("off the commanded\ncircle, µm")
    for row, direction in zip(panels[1:], Direction, strict=True):
        row[0].set_ylabel(f"less model,\n{str(direction).upper()}, µm")
    _legend_of_traces(part, panels[0, 0], found=found)


def _legend_of_traces(part: SubFigure, axes: Axes, *, found: bool) -> None:
    lines: dict[str, LineStyle] = {"measured": {"color": MEASURED, "linewidth": 2.0, "alpha": 0.5}}
    lines["kinematic model"] = {"color": BEFORE, "linewidth": 1.0}
    lines |= {"with causes found": {"color": AFTER, "linewidth": 1.0}} if found else {}
    legend_above(part, axes, lines | DIRECTIONS)


def _bars(part: SubFigure, diagnosis: Diagnosis, gains: Sequence[GainOfTest], *, found: bool) -> None:
    panels: Any = part.subplots(1, 3, width_ratios=(0.32 * len(gains) + 0.6, 0.32 * len(gains) + 0.6, 2.2))
    names = [one.name for one in gains]
    _pairs(panels[0], names, [one.residual_um for one in gains], found=found)
    panels[0].axhline(1e3 * fine_noise_mm(diagnosis.after), color="black", linewidth=0.8, linestyle="--", label="noise")
    labelled(panels[0], "", "µm rms", "residual of each test within its mounting")
    _pairs(panels[1], names, [one.circularity_um for one in gains], found=found)
    labelled(panels[1], "", "µm", "circularity left of each test")
    whole = (rms_um(diagnosis.before.residual_mm), rms_um(diagnosis.after.residual_mm))
    before, after = diagnosis.held_out
    held_out = (1e3 * before.rms, 1e3 * after.rms)
    _pairs(panels[2], ["residual", "tests left out,\npredicted"], [whole, held_out], found=found)
    labelled(panels[2], "", "µm rms", "all tests")
    for axes in panels[:2]:
        axes.set_xlabel("test")
    heading(part, "residual, circularity, prediction")
    part.legend(*panels[0].get_legend_handles_labels(), loc="upper right", ncols=3, borderpad=0.0)


def _pairs(axes: Axes, names: Sequence[str], values: Sequence[tuple[float, float]], *, found: bool) -> None:
    place = np.arange(len(names))
    before, after = zip(*values, strict=True)
    axes.bar(place - 0.2 * found, before, 0.4 if found else 0.6, color=BEFORE, label="kinematic model")
    if found:
        axes.bar(place + 0.2, after, 0.4, color=AFTER, label="with causes found")
    axes.set_xticks(place, names, rotation=90 if max(map(len, names)) > 3 and len(names) > 4 else 0)  # noqa: PLR2004
