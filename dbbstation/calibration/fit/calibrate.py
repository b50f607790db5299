"""Fit error sources by Gauss-Newton, with exact predictions, analytic sensitivities and random effects [CAL II-D]."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import sqrt
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import numpy as np

from dbbstation.calibration.currents import (
    MotorFindings,
    current_blocks,
    current_channel,
    current_start,
    motor_findings,
)
from dbbstation.calibration.fit.directions import Name, in_words, names_of, of_circles, prescribed
from dbbstation.calibration.fit.nodes import RunNodes, nodes_of, smooth
from dbbstation.calibration.layout import Layout, lay_out
from dbbstation.computing.compiled import in_parallel
from dbbstation.computing.threads import with_one_thread
from dbbstation.errors import CalibrationError
from dbbstation.inference.harmonics import Noise, noise_of_turns
from dbbstation.inference.square_root import Block, Solution, compress, lost_directions, solve, unseen_combinations
from dbbstation.model.observation import Observation
from dbbstation.sources.contract import Need, Owner
from dbbstation.sources.registry import sources_named
from dbbstation.trace.recording import RawCircle

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.sources.contract import ErrorSource, Motion

Found = TypeVar("Found")

KINEMATIC_SOURCES = ("strut-reference-length", "base-joints")
"""The 24 parameters of [CAL II-C]."""

MEASUREMENT_SOURCES = ("mounting", "ball-coordinate", "bar-offset", "run-start")
"""Random effects of every session, with standard deviations stated by plan and session."""

FEWEST_TESTS = 3
"""Fewest tests; fewer circles leave more directions undetermined than they determine."""

MOST_STEPS = 30
SMALLEST_SHARE = 0.1
"""Least share of a step, even if the fit oscillates."""
CONVERGED = 1e-6
"""Largest last step of a converged fit, relative to prior standard deviations: a fifth of a nanometre for joints."""

CONVERGED_SIGMA = 1e-3
"""Largest last step in units of standard deviations, for parameters that the runs hardly determine."""
FIRST_NOISE_MM = 1e-3

COARSE_MM = 1.0
"""Nominal residual [mm rms] above which the fit starts with approach steps. Nonlinearity contributes the squared error
over a strut's length, 1 µm for 1 mm, about a usual bar's noise. An unnecessary approach costs two steps and changes
nothing."""

NOISE_STEPS = 12
"""Number of steps that re-estimate the noise. The residual depends on its weight relative to the balls' priors; with
missing physics, noise and residual might otherwise change without end."""

MOST_KEPT = 50_000
"""Most poses of all runs whose motions a fit keeps between steps: up to a hundred numbers per pose, 40 MB."""

MotionOf: TypeAlias = "Callable[[Observation], Motion]"
"""A function that returns a run's motion."""

AT_NODES = frozenset({Need.POSE, Need.TIME})
"""Inputs of sources whose effects are as smooth as the circle; effects of path history and logged values are not."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The outcome of a fit.

    Attributes:
        machine_residual_mm: per run, residual without the machine's sources.
        residual_mm: per run, residual without machine sources and measurement effects.
        blocks: information blocks for x: one per circle, then motor currents.
        directions_lost: descriptions of directions that the recordings do not determine.
        directions_regularised: descriptions of undetermined directions that tolerances of the machine file bound.
        at_limit: columns held at a limit of their range.
    """

    layout: Layout
    x: Floats
    solution: Solution
    noise: Noise
    observations: tuple[Observation, ...]
    machine_residual_mm: tuple[Floats, ...]
    residual_mm: tuple[Floats, ...]
    blocks: tuple[Block, ...]
    directions_lost: tuple[str, ...]
    directions_regularised: tuple[str, ...]
    prescribed: tuple[Name, ...]
    currents: MotorFindings | None = None
    at_limit: tuple[int, ...] = ()
    settled: bool = True

    @property
    def model(self) -> MachineModel:
        """Return the machine model with all fitted values."""
        return self.layout.model(self.x)

    @property
    def circle_blocks(self) -> tuple[Block, ...]:
        """Return blocks of the circles."""
        return self.blocks[: len(self.observations)]

    @property
    def null_space(self) -> Floats:
        """Return undetermined combinations of columns, scaled to prior standard deviations, shape (h, k)."""
        return unseen_combinations(self.blocks, self.layout.known, self.noise.effective, self.solution.held)

    @property
    def parameters_identified(self) -> int:
        """Return the number of machine parameters less the number of held directions."""
        return len(self.layout.fitted) - len(self.solution.held)


def default_sources() -> tuple[ErrorSource, ...]:
    """Return the sources of the paper's kinematic parameters and of every session's random effects."""
    return sources_named(KINEMATIC_SOURCES + MEASUREMENT_SOURCES)


@with_one_thread
def calibrate(
    machine: Machine,
    observations: Sequence[Observation],
    sources: Sequence[ErrorSource] | None = None,
    start: Mapping[str, Floats] | None = None,
    *,
    prescribe: Sequence[Name] | None = None,
    shapes_within: float | None = None,
    amplitudes_within: float = np.inf,
    must_settle: bool = True,
    also_held: Floats | None = None,
) -> Calibration:
    """Fit error sources to raw circles.

    Directions that noise hides at the nominal geometry are lost and held at nominal. The fit solves for values instead
    of steps, so nonlinearity cannot move them. Tolerances of the machine file are priors.

    Args:
        sources: None for the default sources.
        start: starting values by source, because shape parameters have no effect at zero amplitude.
        prescribe: parameters to hold instead of lost directions, in equal number; empty to choose base-joint
            coordinates; None to hold the directions.
        shapes_within: relative prior standard deviation of shape parameters about the start; None for usual sizes.
        amplitudes_within: prior standard deviation of started amplitudes, relative to their usual one.
        must_settle: False to return the last step without convergence.

    Raises:
        CalibrationError: centred circles, too few tests, unsuitable prescribed parameters, or no convergence.
        ModelError: a source lacks an input.
    """
    check_raw(observations)
    _check_enough(observations)
    layout = lay_out(machine, default_sources() if sources is None else sources, observations)
    if start:
        layout = _near(layout, start, shapes_within, amplitudes_within)
    channel = current_channel(layout, observations)
    x = _start_values(layout, {**current_start(layout, channel), **(start or {})})
    noise = Noise(FIRST_NOISE_MM, 1.0)
    runs = looked_at(observations, layout.needs)
    motion_of = _motions_of(runs)
    nominal, left = linearise(layout, runs, x, motion_of)
    nominal += current_blocks(layout, channel, x)
    blocks, before, share = nominal, np.zeros_like(x), 1.0
    if _rms_mm(left) > COARSE_MM:
        x, blocks = _approached(layout, runs, nominal, left, motion_of)
        blocks += current_blocks(layout, channel, x)
    lost, held = np.zeros((0, 0)), None
    limits, at_limit, settled = layout.limits, np.zeros(0, dtype=np.int64), False
    for steps in range(MOST_STEPS):
        seen = _with(lost_directions(nominal, layout.known, noise.effective), also_held)
        if len(seen) != len(lost) or held is None:
            lost = seen
            held = lost if prescribe is None else prescribed(layout, lost, prescribe)
        if steps < NOISE_STEPS:
            solution, noise = _settled(blocks, layout, noise, held)
        else:
            solution = solve(blocks, layout.known, noise.effective, held)
        update = layout.nominal + solution.x
        sigma = np.sqrt(solution.variance)
        settled_at = np.maximum(CONVERGED * layout.known.scale, CONVERGED_SIGMA * sigma)
        step = update - x
        change = float(np.abs(step / settled_at).max(initial=0.0))
        share = _share(layout, step, before, share)
        x = x + share * step
        before = step
        beyond = np.setdiff1d(np.flatnonzero((x < limits[0]) | (x > limits[1])), at_limit)
        x = np.clip(x, *limits)
        if len(beyond):
            # The other parameters are then fitted while it stays at the limit.
            layout, at_limit = layout.held_at(x, beyond), np.concatenate([at_limit, beyond])
        settled = change < 1.0 and not len(beyond)
        if settled:
            break
        blocks, left = linearise(layout, runs, x, motion_of)
        blocks += current_blocks(layout, channel, x)
        if steps < NOISE_STEPS:
            noise = noise_of_turns(left, solution.freedom_used)
    assert held is not None  # noqa: S101 - set in the first step
    if must_settle and not settled:
        raise CalibrationError(
            f"the fit does not converge: step {MOST_STEPS} is {change:.2g} times the limit",
            remedy="check that machine, plan and recordings belong together; leave out doubtful tests with --exclude",
        )
    left.clear()  # free one number per sample before the residuals need two
    return Calibration(
        layout=layout,
        x=x,
        solution=solution,
        noise=noise,
        observations=tuple(observations),
        machine_residual_mm=_residuals(layout.model(x).of_the_machine(), runs, motion_of),
        residual_mm=_residuals(layout.model(x), runs, motion_of),
        blocks=tuple(blocks),
        directions_lost=in_words(layout, of_circles(layout, lost)),
        directions_regularised=in_words(layout, unseen(nominal, layout, noise)),
        prescribed=() if prescribe is None else names_of(layout, held),
        currents=motor_findings(layout, channel, x, solution, blocks, nominal, noise),
        at_limit=tuple(at_limit.tolist()),
        settled=settled,
    )


def _with(lost: Floats, more: Floats | None) -> Floats:
    """Return orthonormal rows that also hold `more` directions of the first columns."""
    if more is None:
        return lost
    wide = np.pad(more, ((0, 0), (0, lost.shape[1] - more.shape[1])))
    _, size, rows = np.linalg.svd(wide - (wide @ lost.T) @ lost, full_matrices=False)
    return np.vstack([lost, rows[size > np.sqrt(0.5)]])


def _approached(
    layout: Layout,
    runs: Sequence[Observation | RunNodes],
    nominal: Sequence[Block],
    left: Sequence[Floats],
    motion_of: MotionOf,
) -> tuple[Floats, list[Block]]:
    """Approach a machine with errors of millimetres, by Gauss-Newton steps with a usual bar's noise."""
    # Nonlinearity dominates early residuals; as noise it would hide determined directions. The noise is therefore
    # estimated only after steps no longer halve the residual.
    noise = FIRST_NOISE_MM
    held = lost_directions(nominal, layout.known, noise)
    blocks = list(nominal)
    for _ in range(MOST_STEPS):
        before_mm = _rms_mm(left)
        x = layout.nominal + solve(blocks, layout.known, noise, held).x
        blocks, left = linearise(layout, runs, x, motion_of)
        if _rms_mm(left) > before_mm / 2.0:
            break
    return x, blocks


def _rms_mm(left: Sequence[Floats]) -> float:
    return sqrt(sum(float(one @ one) for one in left) / sum(map(len, left)))


def unseen(blocks: Sequence[Block], layout: Layout, noise: Noise) -> Floats:
    """Return fitted directions that only priors bound, as orthonormal rows in scaled parameters, shape (r, f)."""
    if not layout.bounded.any():
        return np.zeros((0, len(layout.fitted)))
    return lost_directions(blocks, layout.unbounded, noise.effective)


def _share(layout: Layout, step: Floats, before: Floats, share: float) -> float:
    """Return the share of a step to take."""
    # Full steps oscillate in shape parameters with small amplitude and in nearly undetermined combinations. If the
    # share s gave successive steps with the ratio q, the share s / (1 - q) would have reached the minimum (Aitken's
    # rule). The smallest such share is used.
    shaped = np.array([bool(p.grid) for p in layout.parameters])
    now, last = step / layout.known.scale, before / layout.known.scale
    along = float(now @ last) / max(float(last @ last), 1e-300)
    # The ratio of converged steps is rounding, as for a shape parameter at zero amplitude.
    told = np.where(np.abs(last[shaped]) <= CONVERGED, np.inf, last[shaped])
    ratios = [along, *(now[shaped] / told).tolist()]
    ratio = min(ratios)
    if ratio >= 0.0:
        return min(1.0, 1.5 * share)
    return float(np.clip(share / (1.0 - ratio), SMALLEST_SHARE, 1.0))


def _near(layout: Layout, start: Mapping[str, Floats], within: float | None, amplitudes_within: float) -> Layout:
    nominal, prior = layout.nominal.copy(), layout.known.prior.copy()
    for term in layout.terms:
        if term.source.name not in start:
            continue
        for k, parameter in enumerate(term.parameters):
            column = term.columns.start + k
            if not parameter.grid:
                prior[column] = min(prior[column], amplitudes_within * parameter.plausible)
            else:
                nominal[column] = start[term.source.name][k]
                if parameter.listed:
                    prior[column] = LISTED_WITHIN * nominal[column]
                elif within is not None:
                    prior[column] = within * max(abs(nominal[column]), SMALLEST_SHAPE * parameter.plausible)
    return replace(layout, nominal=nominal, known=replace(layout.known, prior=prior))


LISTED_WITHIN = 1e-3
"""Relative prior standard deviation of a value from a list: gratings are accurate to parts in ten thousand, and expand with temperature."""

SMALLEST_SHAPE = 0.1
"""Least start of a shape parameter for computing its relative prior, in units of its plausible size."""


def _start_values(layout: Layout, start: Mapping[str, Floats]) -> Floats:
    x = layout.nominal.copy()
    for term in layout.terms:
        if term.source.name in start:
            x[term.columns] = start[term.source.name]
    return x


def looked_at(observations: Sequence[Observation], needs: frozenset[Need]) -> list[Observation | RunNodes]:
    """Return runs, reduced to nodes if they are long and sources need only pose and time."""
    if not needs <= AT_NODES:
        return list(observations)
    nodes = in_parallel(nodes_of, observations, _usual_length(observations))
    return [run if seen is None else seen for run, seen in zip(observations, nodes, strict=True)]


def _motions_of(runs: Sequence[Observation | RunNodes]) -> MotionOf:
    if _usual_length(runs) * len(runs) > MOST_KEPT:
        return Observation.motion
    short = {id(run.coarse if isinstance(run, RunNodes) else run) for run in runs}
    known: dict[int, Motion] = {}

    def motion_of(run: Observation) -> Motion:
        if id(run) not in short:  # a run that its nodes cannot replace needs all samples
            return run.motion()
        if id(run) not in known:
            known[id(run)] = run.motion()
        return known[id(run)]

    return motion_of


def linearise(
    layout: Layout,
    runs: Sequence[Observation | RunNodes],
    x: Floats,
    motion_of: MotionOf = Observation.motion,
) -> tuple[list[Block], list[Floats]]:
    """Return every run's information block, linearised about x, shape (k,), with measured minus predicted lengths, shape (n,) [mm].

    The blocks' unknown is x minus its nominal value.
    """
    model = layout.model(x)

    def of_run(run: Observation | RunNodes) -> tuple[Block, Floats]:
        if isinstance(run, RunNodes):
            columns, jacobian, length = _predicted(layout, model, run.coarse, motion_of(run.coarse), x)
            if smooth(jacobian) and smooth(length[:, None] - run.run.raw.circle.bar_mm):
                block = run.compressed(columns, jacobian, length, (x - layout.nominal)[columns])
                return block, run.run.raw.length_mm - run.samples_of(length)
            run = run.run
        columns, jacobian, length = _predicted(layout, model, run, motion_of(run), x)
        left = run.raw.length_mm - length
        return compress(columns, jacobian, left + jacobian @ (x - layout.nominal)[columns]), left

    done = in_parallel(of_run, runs, _usual_length(runs))
    return [block for block, _ in done], [left for _, left in done]


def _predicted(
    layout: Layout, model: MachineModel, observation: Observation, motion: Motion, x: Floats
) -> tuple[Integers, Floats, Floats]:
    reading = model.bar(motion)
    terms = [term for term in layout.terms if term.acts_on(motion)]
    jacobian = np.hstack([np.zeros((len(observation.raw), 0))] + [reading.by_fitted(term.fitted(x)) for term in terms])
    return np.concatenate([np.r_[term.columns] for term in terms]), jacobian, reading.length_mm


def _settled(blocks: Sequence[Block], layout: Layout, noise: Noise, held: Floats) -> tuple[Solution, Noise]:
    count = sum(block.count for block in blocks if block.noise is None)
    sigma = noise.sigma
    for _ in range(3):
        solution = solve(blocks, layout.known, sigma * np.sqrt(noise.correlation_samples), held)
        square = (solution.chi2 - solution.stated_chi2) * sigma**2 * noise.correlation_samples
        spent = solution.freedom_used * noise.correlation_samples  # smooth columns absorb slow noise
        sigma = sqrt(max(square, 0.0) / max(count - spent, 1.0))
        sigma = max(sigma, SMALLEST_NOISE_MM)
    return solution, Noise(sigma, noise.correlation_samples)


SMALLEST_NOISE_MM = 1e-7
"""Least noise of a bar, which prevents division by zero in noise-free simulations."""


@with_one_thread
def residuals(model: MachineModel, observations: Sequence[Observation]) -> tuple[Floats, ...]:
    """Return measured minus predicted length of every run, shape (n,) each [mm]."""
    return tuple(of_residuals(model, observations, lambda _, residual_mm: residual_mm))


@with_one_thread
def of_residuals(
    model: MachineModel,
    observations: Sequence[Observation],
    work: Callable[[Observation, Floats], Found],
) -> list[Found]:
    """Apply `work` to each run and its measured minus predicted lengths, shape (n,) [mm], one run at a time."""
    needs = frozenset[Need]().union(*(f.source.needs for f in model.sources if not f.source.of_currents))
    runs = looked_at(observations, needs)

    def of_run(run: Observation | RunNodes) -> Found:
        return work(run.run if isinstance(run, RunNodes) else run, _residual(model, Observation.motion, run))

    return in_parallel(of_run, runs, _usual_length(runs))


def _residuals(model: MachineModel, runs: Sequence[Observation | RunNodes], motion_of: MotionOf) -> tuple[Floats, ...]:
    return tuple(in_parallel(partial(_residual, model, motion_of), runs, _usual_length(runs)))


def _residual(model: MachineModel, motion_of: MotionOf, run: Observation | RunNodes) -> Floats:
    if isinstance(run, RunNodes):
        length = model.bar(motion_of(run.coarse)).length_mm
        if smooth(length[:, None] - run.run.raw.circle.bar_mm):
            return run.run.raw.length_mm - run.samples_of(length)
        run = run.run
    return run.raw.length_mm - model.bar(motion_of(run)).length_mm


def _usual_length(runs: Sequence[Observation | RunNodes]) -> int:
    poses = sum(len((run.coarse if isinstance(run, RunNodes) else run).raw) for run in runs)
    return poses // max(len(runs), 1)


def check_raw(observations: Sequence[Observation]) -> None:
    """Refuse centred circles: a removed centre is the machine's position error [CAL III-A].

    Raises:
        CalibrationError: names the first such test.
    """
    for observation in observations:
        if not isinstance(observation.raw, RawCircle):
            raise CalibrationError(
                "is a centred circle: centring removed its position on the machine",
                where=observation.test,
                remedy="calibrate from the raw recording",
            )


def _check_enough(observations: Sequence[Observation]) -> None:
    tests = {(o.setup.session, o.test) for o in observations}
    if len(tests) < FEWEST_TESTS:
        raise CalibrationError(
            f"{len(tests)} test{'s' if len(tests) != 1 else ''} cannot calibrate a machine: at least {FEWEST_TESTS} at different places are needed, and the fifteen of the jig plan determine the most parameters",
            remedy="measure more tests, or evaluate these under an existing model",
        )


def machine_sources(sources: Sequence[ErrorSource]) -> tuple[ErrorSource, ...]:
    """Return the machine sources that affect circles."""
    return tuple(source for source in sources if source.belongs_to is Owner.MACHINE and not source.of_currents)
