"""Fit motor currents, which show strut loads, together with circles [GRAV 3.2], and what the fit finds of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import average_of
from dbbstation.computing.compiled import in_parallel
from dbbstation.errors import CalibrationError
from dbbstation.inference.harmonics import Noise, noise_of
from dbbstation.inference.square_root import Block, Columns, Solution, compress, lost_directions, solve
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import inverse
from dbbstation.sources.causes.drive_friction import MOTOR_OF_GAIN, PER_MOTOR, driven_directions
from dbbstation.sources.contract import Effect, Fitted, Motion
from dbbstation.sources.laws.weights import stated_loads
from dbbstation.text.written import listed
from dbbstation.trace.columns import currents
from dbbstation.trace.recording import averaged

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.model.machine_model import Actual, MachineModel
    from dbbstation.model.observation import Observation


@dataclass(frozen=True, eq=False)
class MotorCurrents:
    """Predicted currents of one run.

    Attributes:
        there: the actual machine along the run.
        current_a: kept rows, shape (n, 6).
    """

    model: MachineModel
    driven: Motion
    there: Actual
    current_a: Floats

    def by_parameters(self, fitted: Fitted) -> Floats | None:
        """Return currents' derivative by a source's parameters, shape (n, 6, p), kept rows."""
        kept = self.driven.kept
        if fitted.source.of_currents:
            own = fitted.source.derivative(self.driven, self.model.as_found, fitted.values).current_a
            return None if own is None else own[kept]
        if not fitted.source.loads_struts:
            return None
        by_load = self.there.derivative(fitted).load_n
        if by_load is None:
            return None
        total = np.zeros_like(by_load)
        for drive in drives(self.model):
            per_load = drive.source.current_per_load(self.driven, self.model.as_found, drive.values)
            total += 0.0 if per_load is None else per_load[:, :, None] * by_load
        return total[kept]


def motor_currents(model: MachineModel, motion: Motion) -> MotorCurrents:
    """Predict a run's currents from loads at actual poses.

    Strut masses of the machine file are ignored if a source fits them.

    Raises:
        KinematicsError: a pose is impossible or loose.
        ModelError: a source needs missing data; the machine file has no masses.
    """
    there = model.actual(motion)
    weighing = any(f.source.weighs_struts for f in model.sources)
    stated = replace(there.machine, strut_masses=None) if weighing else there.machine
    total = Effect(
        load_n=stated_loads("drive-friction", stated, there.frames, inverse(there.hexapod, there.frames)),
        current_a=np.zeros(STRUTS),
    )
    for fitted in model.acting(motion):
        if fitted.source.loads_struts:
            total += Effect(load_n=there.by(fitted).load_n)
    driven = replace(motion, load_n=total.load_n)
    for drive in drives(model):
        total += drive.source.effect(driven, model.as_found, drive.values)
    current = np.broadcast_to(np.asarray(total.current_a), (len(motion), STRUTS))
    return MotorCurrents(model, driven, there, current[motion.kept])


def drives(model: MachineModel) -> tuple[Fitted, ...]:
    """Return the model's sources of motor currents."""
    return tuple(f for f in model.sources if f.source.of_currents)


FEWEST = 20
"""Fewest usable readings of a motor."""

MOST_NAMED = 3
"""Greatest number of motors that a note names."""

CLIPPED_SAMPLES = 20
CLIPPED_RATIO = 5.0
"""A current is clipped if so many readings are at one limit, this multiple of those at the next value. At the crest of
a quantised wave the last step has two or three times the readings of the step before. A saturated amplifier gives all
of them at the limit."""


def cleaned(labels: Sequence[str], current_a: Sequence[Floats]) -> tuple[list[Floats], list[str]]:
    """Return currents with NaN at unusable readings, and notes by motor.

    Args:
        current_a: per run, shape (n, 6), NaN for a motor without log.
    """
    kept = [current.copy() for current in current_a]
    notes: list[str] = []
    for motor in range(STRUTS):
        notes += _of_motor(f"motor {motor + 1}", labels, [current[:, motor] for current in kept])
    return kept, notes


def one_way(growing: Sequence[Flags], usable: Sequence[Flags]) -> list[str]:
    """Return notes on motors whose struts never reverse; flags have shape (n, 6) per run."""
    notes = []
    for motor in range(STRUTS):
        ways = np.unique(
            np.concatenate([way[rows[:, motor], motor] for way, rows in zip(growing, usable, strict=True)])
        )
        if len(ways) == 1:
            notes.append(
                f"motor {motor + 1}: its strut only {'grows' if ways[0] else 'shrinks'} in these recordings: constant "
                "friction and asymmetry are known as one, gain and friction by load as well where the load keeps its "
                "sign; measure both directions of a circle to take them apart"
            )
    return notes


def _of_motor(name: str, labels: Sequence[str], current: Sequence[Floats]) -> list[str]:
    logged = [k for k, values in enumerate(current) if np.isfinite(values).any()]
    if not logged:
        return [f"{name}: its current was not logged; nothing is said of its drive, the other motors count"]
    notes = []
    if len(logged) < len(labels):
        notes.append(
            f"{name}: not logged in {listed([label for k, label in enumerate(labels) if k not in logged], MOST_NAMED)}"
        )
    dead = [k for k in logged if np.nanmax(current[k]) == np.nanmin(current[k])]
    if len(dead) == len(logged):
        stands = (
            f"{name}: its current stands still at {np.nanmax(current[dead[0]]):g} A throughout, a channel that is dead"
        )
        notes.append(f"{stands} or not connected; nothing is said of its drive, the other motors count")
    elif dead:
        notes.append(
            f"{name}: its current stands still in {listed([labels[k] for k in dead], MOST_NAMED)}; left out there"
        )
    for k in dead:
        current[k][:] = np.nan
    every = np.concatenate([values[np.isfinite(values)] for values in current])
    for limit in _limits(every):
        notes.append(
            f"{name}: its current stops at {limit:g} A, in {100.0 * average_of(every == limit):.1f} % of the "
            "readings: the channel saturates; these readings are left out"
        )
        for values in current:
            values[values == limit] = np.nan
    return notes


def _limits(values: Floats) -> list[float]:
    levels, count = np.unique(values, return_counts=True)
    few = 3
    if len(levels) < few:
        return []
    ends = ((levels[-1], count[-1], count[-2]), (levels[0], count[0], count[1]))
    return [float(at) for at, there, next_to in ends if there >= CLIPPED_SAMPLES and there > CLIPPED_RATIO * next_to]


MOST_STEPS = 20
SETTLED_SIGMA = 1e-2
"""Convergence limit of the fit to currents alone: largest last step, in standard deviations."""

SECTORS = 1440
"""Sectors of a turn, a quarter of a degree each, over which currents of long runs are averaged. Within a sector loads
change by a thousandth; samples of reversing friction are excluded."""

LONG = 2
"""Fewest readings per sector of a long run."""

FULLY = 1.0 - 1e-9
"""Direction of fully reversed friction, less rounding."""

ROUNDING = 1e-6
"""Rounding, relative to a parameter's prior standard deviation."""

SMALLEST_NOISE_A = 1e-6
"""Least noise of a current, which prevents division by zero in noise-free simulations."""


@dataclass(frozen=True, eq=False)
class CurrentChannel:
    """Motor currents of all runs that have them.

    Attributes:
        current_a: one array of shape (n, 6) per run.
        usable: samples to fit: logged, unclipped, with fully reversed friction; shape (n, 6) per run.
    """

    motions: tuple[Motion, ...]
    current_a: tuple[Floats, ...]
    usable: tuple[Flags, ...]
    notes: tuple[str, ...]


def current_channel(layout: Layout, observations: Sequence[Observation]) -> CurrentChannel | None:
    """Return the currents of all runs that have them; None if no source of currents is fitted.

    Raises:
        CalibrationError: no motor has usable currents.
    """
    if not any(term.source.of_currents for term in layout.terms):
        return None
    runs = [run for run in observations if run.raw.motor_current_a is not None]
    clean, notes = cleaned([run.label for run in runs], [np.asarray(run.raw.motor_current_a) for run in runs])
    motions = tuple(_motion(run, current) for run, current in zip(runs, clean, strict=True))
    current = tuple(np.asarray(motion.motor_current_a)[motion.kept] for motion in motions)
    directions = [driven_directions(motion, layout.machine)[motion.kept] for motion in motions]
    usable = tuple((np.abs(way) > FULLY) & np.isfinite(values) for way, values in zip(directions, current, strict=True))
    notes += one_way([way > 0.0 for way in directions], usable)
    if len(runs) < len(observations):
        missing = len(observations) - len(runs)
        notes.insert(0, f"{missing} of {len(observations)} runs have no motor currents: their circles count alone")
    if not any((np.count_nonzero(rows, axis=0) >= FEWEST).any() for rows in usable):
        raise CalibrationError(
            "no motor has a usable current: " + "; ".join(notes),
            remedy="check how currents are logged, or leave drive-friction out and calibrate from circles",
        )
    return CurrentChannel(motions, current, usable, tuple(notes))


def _motion(run: Observation, current_a: Floats) -> Motion:
    raw = replace(run.raw, logged={**run.raw.logged, **currents(current_a)})
    if run.commanded is None and len(raw) > LONG * SECTORS:
        raw = averaged(raw, SECTORS)
    return replace(run, raw=raw, finer=None).motion()


def current_blocks(layout: Layout, channel: CurrentChannel | None, x: Floats) -> list[Block]:
    """Return one block per run and motor, linearised about x, shape (k,), and weighted by the motor's noise."""
    if channel is None:
        return []
    blocks, left = linearised(layout, channel, x)
    noise = [SMALLEST_NOISE_A if one is None else max(one.effective, SMALLEST_NOISE_A) for one in motor_noise(left)]
    return [replace(block, noise=noise[motor]) for motor, block in blocks]


def linearised(
    layout: Layout, channel: CurrentChannel, x: Floats
) -> tuple[list[tuple[int, Block]], list[list[Floats]]]:
    """Return information blocks with their motors, and each motor's residual per run [A]."""
    model = layout.model(x)
    whole = x - layout.nominal

    def of_run(k: int) -> list[tuple[int, Block, Floats]]:
        motion = channel.motions[k]
        predicted = motor_currents(model, motion)
        left = channel.current_a[k] - predicted.current_a
        parts = [
            (np.r_[term.columns], derivative)
            for term in layout.terms
            if (derivative := predicted.by_parameters(term.fitted(x))) is not None
        ]
        columns = np.concatenate([own for own, _ in parts])
        jacobian = np.concatenate([derivative for _, derivative in parts], axis=2)
        found = []
        for motor in range(STRUTS):
            rows = channel.usable[k][:, motor]
            if np.count_nonzero(rows) >= FEWEST:
                by_column = jacobian[rows, motor]
                touched = by_column.any(axis=0)
                own, J, rest = columns[touched], by_column[:, touched], left[rows, motor]
                found.append((motor, compress(own, J, rest + J @ whole[own]), rest))
        return found

    length = sum(map(len, channel.motions)) // len(channel.motions)
    done = [one for run in in_parallel(of_run, range(len(channel.motions)), length) for one in run]
    left_by_motor: list[list[Floats]] = [[] for _ in range(STRUTS)]
    for motor, _, rest in done:
        left_by_motor[motor].append(rest)
    return [(motor, block) for motor, block, _ in done], left_by_motor


def motor_noise(left: Sequence[Sequence[Floats]]) -> list[Noise | None]:
    """Return each motor's noise from its residual."""
    return [noise_of(of_motor, len(PER_MOTOR)) if of_motor else None for of_motor in left]


def current_start(layout: Layout, channel: CurrentChannel | None) -> dict[str, Floats]:
    """Return starting values by source, fitted to currents alone at the nominal geometry.

    Gains multiply loads and friction, so at zero gain their derivatives vanish.
    """
    if channel is None:
        return {}
    x = layout.nominal.copy()
    for term in layout.terms:
        if term.source.of_currents:
            x[term.columns] = [p.plausible if p.name in MOTOR_OF_GAIN else 0.0 for p in term.parameters]
    for _ in range(MOST_STEPS):
        columns, solution = by_themselves(current_blocks(layout, channel, x), layout.known)
        step = layout.nominal[columns] + solution.x - x[columns]
        x[columns] += step
        sigma = np.sqrt(solution.variance)
        if np.all(np.abs(step) <= SETTLED_SIGMA * sigma + ROUNDING * layout.known.scale[columns]):
            break
    touched = set(columns.tolist())
    return {term.source.name: x[term.columns] for term in layout.terms if touched & set(np.r_[term.columns].tolist())}


def by_themselves(
    blocks: Sequence[Block], known: Columns, noise: float = 1.0, nominal: Sequence[Block] | None = None
) -> tuple[Integers, Solution]:
    """Solve for the columns of some blocks from these blocks alone."""
    columns = np.unique(np.concatenate([block.columns for block in blocks]))
    part = Columns(known.prior[columns], known.scale[columns], known.random[columns])

    def within(some: Sequence[Block]) -> list[Block]:
        return [replace(block, columns=np.searchsorted(columns, block.columns)) for block in some]

    held = lost_directions(within(blocks if nominal is None else nominal), part, noise)
    return columns, solve(within(blocks), part, noise, held)


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
    names = layout.names
    open_columns = layout.fitted[np.linalg.norm(solution.held, axis=0) > OPEN]
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
    return sqrt(np.mean(np.concatenate(parts) ** 2)) if parts else np.nan


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
            sigma = sqrt(solution.variance[k])
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
