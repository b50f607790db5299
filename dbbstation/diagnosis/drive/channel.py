"""A drive's recordings as a channel of low-passed force."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.sources import force, variable_of
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Base, Channel, Kind, Law, Variable
from dbbstation.inference.forms import Spline, modulated
from dbbstation.inference.levels import SURE, Acts
from dbbstation.inference.patterns import CURVES, Family, Pattern, of_blocks
from dbbstation.inference.triangle import axes_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.diagnosis.drive.signals import Signals
    from dbbstation.laws.contract import Scale, SourceForm, TableSource

MASS, VISCOUS = "mass_kg", "viscous_n_s_m"
BASE_UNITS = {MASS: "kg", VISCOUS: "N·s/m"}
"""Parameters of the base model, F = M a + F_v v, and their units."""

COULOMB, COGGING, TRANSIENT = "coulomb-friction", "cogging", "transient-force"
"""Causes with additional results: friction at one speed, waves over position, stretches of time."""

DRIFT = "friction-drift"

METHOD_SHARE = 0.002
"""Least noise, relative to the force's rms: low-pass and differences leave so much of an exactly simulated drive,
mostly beside stops."""

PERIODS_IN_TRAVEL = 3.0
"""Fewest periods of a searched wave in the travel; longer ones are curves."""

WAVE_STEP = 0.25
"""Step between searched waves, in periods over the travel."""

TIGHT, LOOPS = 28, 14
"""Numbers of functions of curves over position, and by direction of travel: tight spots and friction loops are sharper
than other effects."""

NEAR_STANDSTILL = 0.28
"""Share of the greatest speed, the greatest tried Stribeck speed, below which friction may be any function of speed.
Above it Coulomb and viscous friction apply."""

STRONGEST = 6
"""Number of waves in the comparison."""

SAME = 1e-6
"""Relative singular value below which columns are equal."""


@dataclass(frozen=True, eq=False)
class DriveChannel:
    """A channel and the sources of its laws.

    Attributes:
        scale: sizes, and waves of a first search.
        shortest_wave_mm: shortest searched wave; infinite without a search.
    """

    recordings: Recordings
    channel: Channel
    scale: Scale
    sources: dict[str, TableSource]
    of_law: dict[str, tuple[TableSource, SourceForm]]
    shortest_wave_mm: float


def drive_channel(
    recordings: Recordings,
    sources: Sequence[TableSource],
    base: Sequence[str] = (MASS, VISCOUS),
) -> DriveChannel:
    """Make the channel of recordings."""
    variables = _variables(recordings)
    motion = recordings.motion[:, [(MASS, VISCOUS).index(name) for name in base]]
    simple = [force(one, form) for one in sources for form in one.forms(recordings.scale) if not form.shapes]
    straight = np.hstack([motion, *map(recordings.compared, simple)])
    curves = tuple(_beyond(straight, _curves(recordings)))
    if len(recordings.blocks) > 1:
        curves = (*curves, of_blocks(recordings.blocks, len(recordings.force_n)))
    scale, shortest = _first_look(recordings, np.hstack([straight, *(p.samples for p in curves)]))
    of_law: dict[str, tuple[TableSource, SourceForm]] = {}
    laws = []
    for source in sources:
        for form in source.forms(scale):
            name = f"{source.name} {form.label}".strip()
            of_law[name] = (source, form)
            laws.append(_law(name, source, form, recordings, variables))
    channel = Channel(
        residual=recordings.force_n,
        unit="N",
        blocks=recordings.blocks,
        names=recordings.names,
        variables=(),
        base=Base.flat(tuple(base), motion),
        laws=tuple(laws),
        time=recordings.time_s,
        least_noise=METHOD_SHARE * scale.force_n,
        static=curves,
        surely=SURE,
        grows=np.abs(recordings.motion[:, 0]),
        known_noise=recordings.edge_noise_n,
        interchangeable=EQUIVALENT**2,
        rows_are="samples",
        clock=recordings.clock,
        direction=recordings.compared(lambda s: s.direction),
    )
    return DriveChannel(recordings, channel, scale, {s.name: s for s in sources}, of_law, shortest)


def _beyond(straight: Floats, patterns: Iterator[Pattern]) -> Iterator[Pattern]:
    """Return curves made orthogonal to base and single-parameter causes, which they contain."""
    # Curves near standstill are not orthogonalised, because friction would extend them to full speed. Over position the
    # whole curve also competes with a named law plus its remainder.
    axes = axes_of(straight, SAME)
    for pattern in patterns:
        if isinstance(pattern.form, Spline) and pattern.form.falls:
            yield pattern  # zero at speed, where single-parameter causes are determined
            continue
        samples = pattern.samples - axes @ (axes.T @ pattern.samples)
        norms = np.linalg.norm(samples, axis=0)
        if norms.max(initial=0.0) <= SAME * np.linalg.norm(pattern.samples):
            continue
        rest = samples[:, norms > SAME * norms.max()]
        if pattern.family is not Family.CURVE or pattern.variables[0].name != "position":
            yield replace(pattern, samples=rest)
            continue
        every = rest.shape[1] + pattern.samples.shape[1]
        parts = ((range(rest.shape[1]), "beside what has a name"), (range(rest.shape[1], every), "whole"))
        choices = tuple((tuple(columns), float(np.log(1.0 / len(parts))), label) for columns, label in parts)
        yield replace(pattern, samples=np.hstack([rest, pattern.samples]), choices=choices)


def _variables(recordings: Recordings) -> dict[str, Variable]:
    at = recordings.at
    found = [
        Variable("time", "s", Kind.TIME, recordings.time_s),
        Variable("position", "mm", Kind.LENGTH, 1e3 * at(lambda s: s.position_m)),
        Variable("speed", "mm/s", Kind.SPEED, 1e3 * at(lambda s: s.speed_m_s)),
        Variable("acceleration", "mm/s²", Kind.SPEED, 1e3 * at(lambda s: s.acceleration_m_s2)),
    ]
    return {variable.name: variable for variable in found if np.ptp(variable.values) > 0.0}


def _law(
    name: str, source: TableSource, form: SourceForm, recordings: Recordings, variables: dict[str, Variable]
) -> Law:
    @cache
    def columns(values: tuple[float, ...]) -> Floats:
        return recordings.compared(force(source, form, values))

    positive = [p.name for p in form.amplitudes if p.positive]

    def possible(values: Mapping[str, float]) -> bool:
        # negative values are probably zero
        return min((values[name] for name in positive), default=0.0) >= 0.0 and source.possible(
            values, recordings.scale
        )

    odds = np.log(source.prior_probability / (1.0 - source.prior_probability)) - np.log(form.tried)
    variable = variable_of(source)
    along = "time" if variable.startswith("time") else "position"
    return Law.of(
        name,
        form,
        columns,
        form_uncertainty=source.form_uncertainty,
        discrepancy=lambda effect, _, __: _departure(effect, variables[along].values),
        log_odds=float(odds),
        followed=(variable.removesuffix(" wave").removesuffix(" by direction"),),
        way="direction" if variable.endswith(" by direction") else "",
        acts_once=acts(source.name) is Acts.ONCE,
        confirm=source.texts.confirm,
        possible=possible,
    )


def _departure(effect: Floats, along: Floats) -> Floats:
    """Return formula slack, shape (m, q): the effect times smooth functions, and its shift by a sample for reversals."""
    late = np.gradient(effect)
    return np.column_stack([modulated([effect[:, None]], [along[:, None]], None), late, np.gradient(late)])


def _curves(recordings: Recordings) -> Iterator[Pattern]:
    scale = recordings.scale
    first = (
        (one, recordings.time_s[rows.start]) for rows, one in zip(recordings.blocks, recordings.signals, strict=True)
    )
    starts = {id(one): float(begins - one.t_s[one.kept[0]]) for one, begins in first}
    travels = recordings.at(lambda s: s.since_reversal_m)
    # Nearer to a reversal than all compared samples, a curve stays constant.
    nearest = float(np.min(travels, initial=scale.travel_m, where=travels > 0.0))

    def time(signals: Signals) -> Floats:
        return signals.t_s + starts[id(signals)]

    def since(signals: Signals) -> Floats:
        return np.log(np.clip(signals.since_reversal_m, nearest, scale.travel_m))

    def way(signals: Signals) -> Floats:
        return signals.direction

    every: list[tuple[str, str, Kind, Callable[[Signals], Floats], Callable[[Signals], Floats] | None]] = [
        ("speed", "mm/s", Kind.SPEED, lambda s: 1e3 * s.speed_m_s, None),
        ("acceleration", "mm/s²", Kind.SPEED, lambda s: 1e3 * s.acceleration_m_s2, None),
        ("position", "mm", Kind.LENGTH, lambda s: 1e3 * s.position_m, None),
        ("position", "mm", Kind.LENGTH, lambda s: 1e3 * s.position_m, way),
        ("time", "s", Kind.TIME, time, None),
        ("time", "s", Kind.TIME, time, way),
    ]
    if scale.reverses:
        every.append(
            ("log travel since reversal", "", Kind.ANY, since, lambda s: s.direction * np.isfinite(s.since_reversal_m))
        )
    for name, unit, kind, values, factor in every:
        functions = LOOPS if factor is not None else TIGHT if name == "position" else CURVES
        variable = Variable(name, unit, kind, recordings.at(values))
        if variable.extent > 0.0:
            spline = Spline(variable.low, variable.high, functions)
            yield from _curve_over(recordings, variable, spline, values, factor)
    slowest, slow = max(s.standing_m_s for s in recordings.signals), NEAR_STANDSTILL * scale.speed_m_s

    def low_speed(signals: Signals) -> Floats:
        return np.log(np.clip(np.abs(signals.speed_m_s), slowest, max(slow, slowest)))

    variable = Variable("log speed", "", Kind.ANY, recordings.at(low_speed))
    if slowest < slow and variable.extent > 0.0:
        spline = Spline(float(np.log(slowest)), float(np.log(slow)), CURVES, falls=True)
        yield from _curve_over(recordings, variable, spline, low_speed, way)


def _curve_over(
    recordings: Recordings,
    variable: Variable,
    spline: Spline,
    values: Callable[[Signals], Floats],
    factor: Callable[[Signals], Floats] | None,
) -> Iterator[Pattern]:
    def columns(signals: Signals) -> Floats:
        found = spline.columns(values(signals))
        return found if factor is None else found * factor(signals)[:, None]

    samples = recordings.compared(columns)
    norms = np.linalg.norm(samples, axis=0)
    seen = samples[:, norms > SAME * norms.max()]
    if seen.shape[1]:
        yield Pattern(Family.CURVE if factor is None else Family.BY_DIRECTION, (variable,), seen, spline)


def _first_look(recordings: Recordings, smooth: Floats) -> tuple[Scale, float]:
    """Return sizes with the strongest waves over position, and the shortest searched wave [mm]."""
    # At usual speed the shortest wave takes one period of the cut-off. Waves are found successively.
    scale = recordings.scale
    speed = float(np.median(np.abs(recordings.at(lambda s: s.speed_m_s))))
    highest = min(recordings.scale.cutoff_hz / speed * scale.travel_m, BOUNDS.waves_of_drive * WAVE_STEP)
    periods = np.arange(PERIODS_IN_TRAVEL, highest, WAVE_STEP)
    if len(periods) < 1.0 / WAVE_STEP:
        return scale, np.inf
    axes = axes_of(smooth, SAME)
    left = recordings.force_n - axes @ (axes.T @ recordings.force_n)
    position = recordings.at(lambda s: s.position_m)
    waves = periods / scale.travel_m
    found: list[float] = []
    for _ in range(STRONGEST):
        power = _power(waves, position, left)
        best = float(waves[int(power.argmax())])
        near = best + np.linspace(-1.0, 1.0, 21) * WAVE_STEP / scale.travel_m
        best = float(near[int(_power(near, position, left).argmax())])
        angle = 2.0 * np.pi * best * position
        pair = np.column_stack([np.cos(angle), np.sin(angle)])
        left = left - pair @ np.linalg.lstsq(pair, left, rcond=None)[0]
        if all(abs(best - other) * scale.travel_m > 2.0 * WAVE_STEP for other in found):
            found.append(best)
    return replace(scale, waves_per_m=tuple(found), waves_tried=len(waves) * WAVE_STEP), 1e3 / float(waves[-1])


def _power(waves: Floats, position: Floats, left: Floats) -> Floats:
    return np.concatenate(
        [
            np.abs(np.exp(2j * np.pi * np.outer(waves[k : k + BOUNDS.waves_at_once], position)) @ left)
            for k in range(0, len(waves), BOUNDS.waves_at_once)
        ]
    )


def source_of(drive: DriveChannel, patterns: Mapping[str, Pattern], name: str) -> str:
    """Return a member's source; empty for patterns."""
    if name in drive.of_law:
        return drive.of_law[name][0].name
    pattern = patterns.get(name)
    if pattern is None:
        return ""
    if pattern.family is Family.PULSES:
        return TRANSIENT if TRANSIENT in drive.sources else ""
    if pattern.family is Family.WAVE and [variable.name for variable in pattern.variables] == ["position"]:
        return COGGING if COGGING in drive.sources else ""
    return ""


def acts(source: str) -> Acts:
    """Return whether a cause is a single event, as forces in time and drift."""
    return Acts.ONCE if source in {TRANSIENT, DRIFT} else Acts.ALWAYS
