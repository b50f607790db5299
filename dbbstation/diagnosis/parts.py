"""Forms of a cause: all parts, one part, or a common amplitude; its variable; the inaccuracy of its formula.

Effects may vary with strut length or direction, and growth may follow another law. Smooth modulations represent these
departures [Kennedy and O'Hagan 2001, sec. 4].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.forms import ALONG_SCREWS, DEGREE, modulated
from dbbstation.inference.square_root import slices
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.travel import middle
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Owner

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.inference.patterns import Choices
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.sources.contract import Effect, ErrorSource, Motion, Parameter


ALIKE = "all struts alike"
"""Label of the form that has one amplitude for all struts."""

SESSION_TIME = "the time of the session"
"""Variable of warm-up and drift over a session, in which held-out tests are between others."""


def is_shape(source: ErrorSource, machine: Machine) -> Flags:
    """Return which parameters of a source are nonlinear, shape (p,)."""
    return np.array([bool(p.grid) for p in source.parameters(machine)])


def amplitudes(source: ErrorSource, machine: Machine) -> list[Parameter]:
    """Return the other parameters."""
    return [p for p in source.parameters(machine) if not p.grid]


def at_point(
    source: ErrorSource, machine: Machine, point: Sequence[float] | Floats, sizes: Floats | float = 0.0
) -> Floats:
    """Return a source's values, shape (p,), from nonlinear parameters and amplitudes."""
    shaped = is_shape(source, machine)
    values = np.empty(len(shaped))
    values[shaped], values[~shaped] = point, sizes
    return values


def by_amplitudes(reading: BarReading, source: ErrorSource, machine: Machine, point: Sequence[float]) -> Floats:
    """Return a reading's derivative by a source's amplitudes at nonlinear parameters, shape (n, a)."""
    shaped = is_shape(source, machine)
    values = np.zeros(len(shaped))
    values[shaped] = point
    return reading.by_source(source, machine, values)[:, ~shaped]


def by_terms(reading: BarReading, layout: Layout, x: Floats) -> Floats:
    """Return a reading's derivative by all parameters of a fit at values of shape (k,): shape (n, k)."""
    found = np.zeros((len(reading.length_mm), len(x)))
    for term in layout.terms:
        if term.acts_on(reading.actual.motion):
            found[:, term.columns] = reading.by_source(term.source, layout.machine, x[term.columns])
    return found


def forms_of(amplitudes: Sequence[Parameter], sets: int) -> Choices:
    """Return forms of a cause: all amplitudes, one part, two parts that are not struts, or all struts alike.

    Kinds weigh equally, as do a kind's forms. The common amplitude has a column after those of all sets.
    """
    every = tuple(range(len(amplitudes) * sets))
    labels = [p.alone_with for p in amplitudes] * sets
    kinds = [[("", every)]]
    if len(set(labels)) > 1:
        alone = [(part, tuple(k for k in every if labels[k] == part)) for part in sorted(set(labels))]
        kinds.append(alone)
        if any(p.part for p in amplitudes):
            # Few orders of a figure are often large; the others would each cost as much as a size of theirs.
            kinds.append(
                [(f"{one} and {two}", tuple(sorted((*a, *b)))) for (one, a), (two, b) in combinations(alone, 2)]
            )
    if sets == 1 and [p.strut for p in amplitudes] == [*STRUT_NUMBERS]:
        kinds.append([(ALIKE, (len(every),))])
    return tuple((own, -float(np.log(len(kinds) * len(kind))), label) for kind in kinds for label, own in kind)


def variable_of(source: ErrorSource) -> str:
    """Return a named cause's variable; its own name without a single variable."""
    return SESSION_TIME if source.varies_with == "time" else source.varies_with or source.name


BY_DIRECTION = ("strut-speed-sign", "joint-angle-speed-sign")
"""Variables that are directions."""

STAGES_APART = 2
"""Grid points between the time constants of further warm-up stages: a factor of two."""


@dataclass(frozen=True, eq=False)
class Effects:
    """A source's effect on one run, with its derivative.

    Attributes:
        derivative: of the reading, shape (n, p).
    """

    motion: Motion
    reading: BarReading
    values: Floats
    derivative: Floats
    known: Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class SourceOverRuns:
    """A source over runs, some of which share its values.

    Attributes:
        shared: name of each run's values.
        known: variables of each run; see `variables`.
    """

    source: ErrorSource
    machine: Machine
    motions: Sequence[Motion]
    readings: Sequence[BarReading]
    shared: Sequence[Any]
    known: Sequence[Mapping[str, Floats]]

    @cached_property
    def groups(self) -> list[int]:
        """Return each run's group of shared values."""
        order = list(dict.fromkeys(self.shared))
        return [order.index(name) for name in self.shared]

    @property
    def sets(self) -> int:
        """Return the number of groups."""
        return max(self.groups) + 1

    @cached_property
    def rows(self) -> list[slice]:
        """Return the rows of each run."""
        return slices(len(reading.length_mm) for reading in self.readings)

    @cached_property
    def shapes(self) -> list[Parameter]:
        """Return the nonlinear parameters."""
        return [p for p in self.source.parameters(self.machine) if p.grid]

    @cached_property
    def amplitudes(self) -> list[Parameter]:
        """Return the amplitudes of one group."""
        return amplitudes(self.source, self.machine)

    @cached_property
    def forms(self) -> Choices:
        """Return the alternative forms; see `forms_of`."""
        return forms_of(self.amplitudes, self.sets)

    @cached_property
    def alike(self) -> bool:
        """Return whether all struts may share one amplitude, whose column is the sum of the others."""
        return any(label == ALIKE for _, _, label in self.forms)

    @property
    def every(self) -> list[Parameter]:
        """Return the amplitude of each column, the common one last."""
        return self.amplitudes * self.sets + self.amplitudes[: int(self.alike)]

    def by_group(self, derivatives: Iterable[Floats]) -> Floats:
        """Return the derivatives of runs by the amplitudes of all groups, shape (n, p)."""
        count = len(self.amplitudes)
        found = np.zeros((self.rows[-1].stop, count * self.sets))
        for rows, derivative, group in zip(self.rows, derivatives, self.groups, strict=True):
            found[rows, count * group : count * (group + 1)] = derivative
        return found

    def columns(self, point: Sequence[float]) -> Floats:
        """Return `by_group` at nonlinear parameters."""
        shaped, values = is_shape(self.source, self.machine), at_point(self.source, self.machine, point)
        return self.by_group(one.by_source(self.source, self.machine, values)[:, ~shaped] for one in self.readings)

    def effects(self, values: Iterable[Floats]) -> list[Effects]:
        """Return the effect of each run's values, shape (p,)."""
        every = zip(self.motions, self.readings, values, self.known, strict=True)
        return [Effects(m, r, own, r.by_source(self.source, self.machine, own), known) for m, r, own, known in every]

    def slack(self, effects: Sequence[Effects]) -> tuple[Floats, Floats]:
        """Return the inaccuracy of the formula, and what it leaves open, as columns over all runs."""
        if self.source.form_uncertainty == 0.0:
            return np.zeros((self.rows[-1].stop, 0)), np.zeros((self.rows[-1].stop, 0))
        return discrepancy_of(self.source, self.machine, effects), left_open_of(self.source, self.machine, effects)


def discrepancy_of(source: ErrorSource, machine: Machine, runs: Sequence[Effects]) -> Floats:
    """Return a source's slack columns over all runs, shape (n, q)."""
    amplitude = ~is_shape(source, machine)
    effects: list[Floats] = []
    along: list[list[Floats]] = []
    signs: list[Floats] = []
    for run in runs:
        motion = run.motion
        # An instrument's error concerns the whole reading, even if the model expresses it by strut errors.
        of_struts = source.belongs_to is not Owner.INSTRUMENT
        by_strut = _strut_contributions(source, motion, machine, run.values, run.reading) if of_struts else None
        known = run.known
        if by_strut is None:
            followed = _followed(source, known, motion)[motion.kept]
            total = run.derivative[:, amplitude] @ run.values[amplitude]
            effects.append(np.repeat(total[:, None], followed.shape[1], axis=1))
            along.append([followed])
            continue
        effects.append(by_strut)
        along.append([values[motion.kept] for values in _followed_by_strut(source, known, motion, machine)])
        if source.varies_with in BY_DIRECTION:
            signs.append(known["strut-speed-sign"][motion.kept])
    degree = ALONG_SCREWS if source.varies_with == "strut-speed-sign" else DEGREE
    # Contacts stiffen under pull and under push, and a lag may differ with the direction.
    sides = by_strut is not None and source.varies_with in OF_STRUTS_SMOOTH
    by_variable = [modulated(effects, one, signs or None, degree, each_side=sides) for one in zip(*along, strict=True)]
    # The variables share the formula's inaccuracy.
    columns = np.hstack(by_variable) / np.sqrt(len(by_variable))
    return np.hstack([columns, _other_stages(source, machine, runs)])


def seen_of(columns: Floats, sd: float, least: float) -> Floats:
    """Return the principal axes of columns, shape (n, q), whose norm is larger than `least` at `sd`, shape (n, r).

    Columns with one prior and their axes stand for the same covariance [Rasmussen and Williams, Gaussian Processes for
    Machine Learning (2006), eq 4.39], but for the axes left out.
    """
    squares, turned = np.linalg.eigh(columns.T @ columns)
    return np.asarray(columns @ turned[:, sd**2 * squares > least**2], dtype=np.float64)


def left_open_of(source: ErrorSource, machine: Machine, runs: Sequence[Effects]) -> Floats:
    """Return the source's `left_open` changes as columns, shape (n, q), scaled to one standard deviation of the formula's inaccuracy."""
    changes = [
        run.reading.by_parameters(
            run.motion.seen(source, partial(source.left_open, machine=machine, values=run.values), 1)
        )
        for run in runs
    ]
    return np.vstack(changes) / source.form_uncertainty


def _other_stages(source: ErrorSource, machine: Machine, runs: Sequence[Effects]) -> Floats:
    """Return effects of growth with other time constants, shape (n, q)."""
    amplitude = ~is_shape(source, machine)
    if source.varies_with != "time" or amplitude.all():
        return np.zeros((sum(len(run.derivative) for run in runs), 0))
    first = int(np.flatnonzero(~amplitude)[0])
    found = []
    for constant in source.parameters(machine)[first].grid[::STAGES_APART]:
        pieces = []
        for run in runs:
            other = run.values.copy()
            other[first] = constant
            pieces.append(run.reading.by_source(source, machine, other)[:, amplitude] @ other[amplitude])
        found.append(np.concatenate(pieces))
    return np.column_stack(found)


def _strut_contributions(
    source: ErrorSource, motion: Motion, machine: Machine, values: Floats, reading: BarReading
) -> Floats | None:
    """Return a source's effect on the reading through each strut, shape (n, 6) [mm]; None if the source also acts elsewhere."""
    model = MachineModel(machine, (Fitted(source, values, source.shared_by(motion)),))
    effect = model.effect(motion, reading.actual)
    others = (
        effect.base_joint_mm,
        effect.platform_joint_mm,
        effect.tool_tip_mm,
        effect.fixed_ball_mm,
        effect.reading_mm,
    )
    return None if any(other is not None for other in others) else through_struts(effect, motion, reading)


def through_struts(effect: Effect, motion: Motion, reading: BarReading) -> Floats | None:
    """Return an effect on the reading through each strut, shape (n, 6) [mm]; None without an effect on struts."""
    if effect.strut_mm is None:
        return None
    lengths = np.broadcast_to(effect.strut_mm, (len(motion), STRUTS))
    return (reading.sensitivity.response.per_strut * lengths)[motion.kept]


def _followed_by_strut(
    source: ErrorSource, known: Mapping[str, Floats], motion: Motion, machine: Machine
) -> list[Floats]:
    """Return variables for a strut source's slack, shape (n, 6) each."""
    if source.varies_with in {"time", "temperature"}:
        return [np.broadcast_to(known["time"][:, None], (len(motion), STRUTS))]
    found = [known["strut-length"]]
    if source.varies_with in OF_STRUTS_SMOOTH and source.varies_with in known:
        found.append(known[source.varies_with])
    if source.varies_with.startswith("joint-angle"):
        found.append(_swing_rad(motion, machine))
    return found


OF_STRUTS_SMOOTH = ("strut-force", "strut-speed")
"""Variables of struts along which a formula may err gradually: contacts stiffen under load, lags change with speed."""


def _swing_rad(motion: Motion, machine: Machine) -> Floats:
    """Return platform joints' angles from mid-travel, shape (n, 6) [rad]."""
    rest = middle(machine)
    unit, at_rest = motion.struts(machine).unit, inverse(machine.hexapod, rest).unit
    in_platform = np.einsum("nji,nkj->nki", motion.frames(machine).rotation, unit)
    cosine = np.einsum("nki,ki->nk", in_platform, np.einsum("ji,kj->ki", rest.rotation[0], at_rest[0]))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _followed(source: ErrorSource, known: Mapping[str, Floats], motion: Motion) -> Floats:
    """Return variables for a non-strut source's slack, shape (n, q)."""
    name = "time" if source.varies_with in {"temperature", "speed"} else source.varies_with
    if name in known and known[name].ndim == 1:
        return known[name][:, None]
    if name == "reading" and motion.reading_mm is not None:
        return motion.reading_mm[:, None]
    return motion.poses[:, :2]
