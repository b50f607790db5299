"""Findings on motor currents in a fit: noise, residuals, centre of gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.currents.channel import by_themselves, linearised, motor_noise
from dbbstation.sources.causes.drive_friction import MOTOR_OF_GAIN

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.calibration.currents.channel import CurrentChannel
    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.blocks import Block
    from dbbstation.inference.noise import Noise
    from dbbstation.inference.square_root import Solution

OPEN = 0.1
"""Largest component that a determined parameter may have in held directions."""

MORE_THAN_NOISE = 1.2
"""Ratio of residual to fine noise above which the residual contains a slow misfit."""

SLOW_SAMPLES = 10.0
"""Correlation length of a slow residual, in samples."""

SURE = 5.0
"""Standard deviations above which a gain's sign counts as known."""


@dataclass(frozen=True, eq=False)
class MotorFindings:
    """Findings of the motor currents in a fit.

    Attributes:
        noise: of each motor's readings, or of sector means in long runs; None without readings.
        residual_a: rms per motor; NaN without readings.
        fine_a: noise from differences of neighbours, without slow misfit; NaN without readings.
        held: names of undetermined drive parameters.
        alone: centre of gravity by channel (`circles`, `currents`) and parameter, with standard deviation [mm]; None if
            this channel alone does not determine it. Empty without cog-shift.
    """

    noise: tuple[Noise | None, ...]
    residual_a: tuple[float, ...]
    fine_a: tuple[float, ...]
    samples: tuple[int, ...]
    held: frozenset[str]
    alone: Mapping[str, Mapping[str, tuple[float, float] | None]]
    notes: tuple[str, ...]


def motor_findings(
    layout: Layout,
    channel: CurrentChannel | None,
    x: Floats,
    solution: Solution,
    blocks: Sequence[Block],
    nominal: Sequence[Block],
    noise: Noise,
) -> MotorFindings | None:
    """Return residuals, and results of each channel alone."""
    if channel is None:
        return None
    own, left = linearised(layout, channel, x)
    circles, currents = len(blocks) - len(own), blocks[len(blocks) - len(own) :]
    alone = {
        "circles": by_themselves(blocks[:circles], layout.known, noise.effective, nominal[:circles]),
        "currents": by_themselves(currents, layout.known),
    }
    fitted = np.flatnonzero(~layout.known.random)
    names = layout.names
    open_columns = fitted[np.linalg.norm(solution.held, axis=0) > OPEN]
    held = frozenset(names[column][2] for column in open_columns if names[column][0] in _drives(layout))
    found = motor_noise(left)
    residual = tuple(_rms(of_motor) for of_motor in left)
    fine = tuple(_rms([np.diff(one) for one in of_motor]) / np.sqrt(2.0) for of_motor in left)
    return MotorFindings(
        noise=tuple(found),
        residual_a=residual,
        fine_a=fine,
        samples=tuple(sum(map(len, of_motor)) for of_motor in left),
        held=held,
        alone=_centre_of_gravity(layout, alone),
        notes=(*channel.notes, *_doubts(layout, x, solution, held), *_misfits(residual, fine, found)),
    )


def _rms(parts: Sequence[Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else np.nan


def _drives(layout: Layout) -> set[str]:
    return {term.source.name for term in layout.terms if term.source.of_currents}


def _centre_of_gravity(
    layout: Layout, alone: Mapping[str, tuple[Integers, Solution]]
) -> dict[str, dict[str, tuple[float, float] | None]]:
    term = next((term for term in layout.terms if term.source.name == "cog-shift"), None)
    if term is None:
        return {}
    said: dict[str, dict[str, tuple[float, float] | None]] = {}
    for channel, (columns, solution) in alone.items():
        fitted = np.flatnonzero(~layout.known.random[columns])
        held = dict(zip(columns[fitted].tolist(), np.linalg.norm(solution.held, axis=0), strict=True))
        place = {column: k for k, column in enumerate(columns.tolist())}
        said[channel] = {}
        for parameter, column in zip(term.parameters, np.r_[term.columns].tolist(), strict=True):
            told = column in place and held[column] <= OPEN
            k = place.get(column, 0)
            sigma = float(np.sqrt(solution.variance[k]))
            said[channel][parameter.name] = (float(solution.x[k]), sigma) if told else None
    return said


def _doubts(layout: Layout, x: Floats, solution: Solution, held: frozenset[str]) -> list[str]:
    doubts = []
    sigma = np.sqrt(solution.variance)
    for column, (source, _, name) in enumerate(layout.names):
        if source in _drives(layout) and name in MOTOR_OF_GAIN and name not in held:
            motor = MOTOR_OF_GAIN[name]
            if x[column] < -SURE * sigma[column]:
                doubts.append(f"motor {motor}: its current falls where its load grows; is its sign turned round?")
            elif x[column] < SURE * sigma[column]:
                doubts.append(f"motor {motor}: its current does not follow its load; what is said of it says nothing")
    return doubts


def _misfits(residual_a: Sequence[float], fine_a: Sequence[float], noise: Sequence[Noise | None]) -> list[str]:
    lacking = [
        str(motor + 1)
        for motor, (left, fine, found) in enumerate(zip(residual_a, fine_a, noise, strict=True))
        if found is not None and left > MORE_THAN_NOISE * fine and found.correlation_samples > SLOW_SAMPLES
    ]
    if not lacking:
        return []
    return [_TOO_SLOW.format(motors=f"motor{'s' if len(lacking) > 1 else ''} {', '.join(lacking)}")]


_TOO_SLOW = (
    "{motors}: the currents leave something slow beside noise, so that loads or friction are not as modelled and the "
    "stated uncertainties too small; are the weights of struts and screws in the machine file (strut_masses), does a hose "
    "or a counterbalance pull at the platform?"
)
