"""The contract of an error source: what it is given, what it declares, what it answers.

A machine model is its nominal geometry plus a list of error sources. A source is asked for its `effect` on a
`Motion` and for the derivative of that effect by each of its parameters. It sees a measured length only as the place
of the bar's own encoder, and never changes anything but struts, joints, the tool tip, the bar's reading or a motor's
current.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import Struts, inverse
from dbbstation.machine.rotation import Frames
from dbbstation.text.texts import Texts as Texts  # noqa: PLC0414, TC001 - part of the contract: sources take it from here
from dbbstation.trace.columns import WithLogged

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Compliance, Hexapod, Machine
    from dbbstation.plan.plan import Plate
    from dbbstation.trace.columns import Logged


Worked = TypeVar("Worked")

State = Any
"""What a source remembers of the way so far, of any type that the source likes; never changed in place."""


class Owner(StrEnum):
    """What a source belongs to. Only what is the machine's is predicted and compensated elsewhere."""

    MACHINE = "machine"
    SESSION = "session"
    MOUNTING = "mounting"
    INSTRUMENT = "instrument"


class Need(StrEnum):
    """What a source must be given beside the machine."""

    POSE = "pose"
    PATH = "path"
    TIME = "time"
    TEMPERATURE = "temperature"
    CURRENT = "current"
    READING = "reading"


@dataclass(frozen=True, eq=False)
class SetUpErrors:
    """What a micrometer read of balls that were put up at the spindle [CAL III-A, IV]; NaN where nobody measured.

    Attributes:
        fixed_ball_mm: fixed ball less tool tip while the machine stood at the ball's commanded place, machine frame, shape (3,)
            [mm].
        moving_ball_mm: moving ball less tool tip, platform frame, shape (3,) [mm].
    """

    fixed_ball_mm: NDArray[np.float64]
    moving_ball_mm: NDArray[np.float64]
    uncertainty_mm: float


@dataclass(frozen=True, eq=False)
class Thermometer:
    """One thermometer over a session.

    Attributes:
        time_s: on the clock of `Motion.time_s`, rising, shape (q,) [s].
        degc: what it showed, what it rounds off smoothed, shape (q,) [degC].
    """

    time_s: NDArray[np.float64]
    degc: NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """How a run was set up: which ball, which mounting, which bar, and how well each is known.

    Names are unique over all sessions of a fit: runs that share a name share that error.

    Attributes:
        ball: entry of the CMM sheet.
        fixed_ball_mm: centre of the fixed ball as the CMM knows it, machine frame, shape (3,) [mm].
        mounting_repeatability_mm: of the holder, one standard deviation, for all axes or each, shape (3,) [mm].
        ball_uncertainty_mm: of the CMM, one standard deviation per axis [mm].
        bar_uncertainty_mm: of the bar's calibrated length, one standard deviation; of a bar that nobody calibrated more than any
            calibrator leaves [mm].
        bar_reads_long_mm: reading less true distance, as calibrator and temperature let expect it: part of every reading, and
            never taken off one [mm].
        bar_length_mm: distance of the balls at which the bar was calibrated; None where nobody calibrated it [mm].
        place_known: False for a ball that was put up under the spindle: `fixed_ball_mm` is where the machine was told to stand
            then, and nobody knows where the ball is.
        set_up_errors: micrometer readings of such a ball; None where there are none.
        plate: jig plate that the ball stands on; None where it stands in no bore.
        run: name of the run; empty where it has none.
        start_uncertainty_deg: how well the beginning of its turn is known along the travel, one standard deviation; zero where
            angles were recorded [deg].
        moving_s: beginning and end of every run of the session, in order, on the clock of `Motion.time_s` [s]; empty where nobody
            noted them.
        thermometers: what each of them showed over the session, by the name of its column without the unit.
    """

    session: str
    mounting: str
    ball: str
    instrument: str
    fixed_ball_mm: NDArray[np.float64]
    mounting_repeatability_mm: float | NDArray[np.float64]
    ball_uncertainty_mm: float
    bar_uncertainty_mm: float
    place_known: bool = True
    set_up_errors: SetUpErrors | None = None
    plate: Plate | None = None
    run: str = ""
    start_uncertainty_deg: float = 0.0
    bar_reads_long_mm: float = 0.0
    bar_length_mm: float | None = None
    moving_s: tuple[tuple[float, float], ...] = ()
    thermometers: Mapping[str, Thermometer] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Motion(WithLogged):
    """A whole run as commanded, in time order, with what was logged beside it.

    Rows before `kept` are the way there: they give backlash, lag and friction their history and are not
    compared with a recording.

    Attributes:
        poses: commanded [X, Y, Z, A, B, C], shape (n, 6) [mm, deg].
        is_path: the rows follow each other on one path; otherwise they are poses without a history.
        straight: the machine goes straight from row to row, as a program has it, and what bends does so at a row; otherwise
            the rows are samples of a smooth path, such as a circle, which bends between them as well.
        kept: the rows that count.
        time_s: since the session's first sample, shape (n,) [s]; None where unknown.
        logged: what was logged beside the bar, by the name of its column, shape (n,) each; `temperature_degc` and
            `motor_current_a` give it by sensor and motor.
        load_n: axial forces that the motors hold, positive where the platform pulls, shape (n, 6) [N]; None: those of
            the machine file's weights at the commanded poses.
        setup: None for poses that nobody measured.
        reading_mm: what the bar showed, shape (n,) [mm]: the place of its encoder, for errors of that encoder alone;
            None where nothing was measured.
        reading_is_measured: that came from an instrument, with its noise; otherwise from a model.
        put_up: the machine standing still while the fixed ball was put up at its tool tip: the ball stands where the
            tip really was in the last row; None for a ball of known place.
    """

    poses: NDArray[np.float64]
    is_path: bool = False
    straight: bool = False
    kept: slice = field(default_factory=lambda: slice(None))
    time_s: NDArray[np.float64] | None = None
    logged: Logged = field(default_factory=dict)
    load_n: NDArray[np.float64] | None = None
    setup: Setup | None = None
    reading_mm: NDArray[np.float64] | None = None
    reading_is_measured: bool = False
    put_up: Motion | None = None
    _known: dict[str, tuple[Hexapod | None, object]] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.poses)

    def frames(self, machine: Machine) -> Frames:
        """Commanded poses as frames of the platform; worked out once, whatever number of sources asks."""
        return self.once("frames", machine, lambda: Frames.from_poses(self.poses, machine.hexapod.rotation))

    def struts(self, machine: Machine) -> Struts:
        """Struts of the machine at the commanded poses; worked out once, whatever number of sources asks."""
        return self.once("struts", machine, lambda: inverse(machine.hexapod, self.frames(machine)))

    def once(self, what: str, machine: Machine | None, work: Callable[[], Worked]) -> Worked:
        """Something that hangs on the motion and a machine's joints alone, worked out once as long as these are asked for."""
        joints, known = None if machine is None else machine.hexapod, self._known.get(what)
        if known is None or known[0] is not joints:
            known = self._known[what] = joints, work()
        return cast("Worked", known[1])

    def commanded(self, frames: Frames, machine: Machine) -> Motion:
        """The motion with other poses, those of these frames."""
        motion = replace(self, poses=frames.to_poses(machine.hexapod.rotation))
        motion._known["frames"] = machine.hexapod, frames  # noqa: SLF001 - of the same class
        return motion

    def stretch(self, rows: slice) -> Motion:
        """Some of the rows, in time order; all of them count."""
        return self._of_rows(lambda values, _: values[rows])

    def after(self, earlier: Motion) -> Motion:
        """An earlier stretch and this one behind it, which has what the earlier one has; all rows count."""
        before = earlier._rows()
        return self._of_rows(lambda values, name: np.concatenate([before[name], values]))

    def _rows(self) -> dict[str, NDArray[np.float64]]:
        own = {name: getattr(self, name) for name in ("poses", "time_s", "load_n", "reading_mm")}
        return {name: values for name, values in own.items() if values is not None} | dict(self.logged)

    def _of_rows(self, change: Callable[[NDArray[np.float64], str], NDArray[np.float64]]) -> Motion:
        changed = {name: change(values, name) for name, values in self._rows().items()}
        logged = {name: changed.pop(name) for name in self.logged}
        return replace(self, kept=slice(None), logged=logged, put_up=None, **changed)  # type: ignore[arg-type]

    @cached_property
    def provides(self) -> frozenset[Need]:
        """What sources may ask of this motion."""
        given = {Need.POSE: True, Need.PATH: self.is_path, Need.TIME: self.time_s is not None}
        given |= {Need.TEMPERATURE: bool(self.temperature_degc), Need.CURRENT: self.motor_current_a is not None}
        given[Need.READING] = self.reading_mm is not None
        return frozenset(need for need, there in given.items() if there)


BEYOND_PLAUSIBLE = 100.0
"""A value of so many usual sizes is none that a machine has: 20 mm on a strut's reference length, 5 mm on a joint, 0.3 mm
of play. With ten, joints that a kinematic fit pulls for gravity's sake (up to 0.27 mm of 0.05 mm) come near; a slip of
the pen by a decimal point more, or millimetres for micrometres, is beyond it wherever a value is of its usual size."""


@dataclass(frozen=True)
class Parameter:
    """One number of a source.

    Attributes:
        name: unique within the source; its unit is its last part where it has one.
        plausible: usual size, one standard deviation, in that unit.
        meaning: one line with the sign.
        grid: values to search over, where the effect is not proportional to the parameter (a time constant, a phase); empty for
            an amplitude, which the effect is proportional to.
        tolerance: standard deviation that the machine file states, in that unit: a fit takes it for known; None where nothing is
            stated.
        newer: True for one that the source had not always: models written before lack it, and it is zero there.
        positive: True for what cannot be negative, such as a compliance or a friction: where a fit says so beyond its
            uncertainty, something else is at work.
        listed: True where only the values of `grid` are possible and nothing between them, as of a part that is bought.
        part: amplitudes with one label may be wrong alone, such as those of one order of a ball's form; empty for those of a
            strut, and for a source that has no parts.
        strut: strut that it is of, 1 to 6; the amplitudes of one strut may be wrong alone. None where it is of none.
    """

    name: str
    unit: str
    plausible: float
    meaning: str
    grid: tuple[float, ...] = ()
    tolerance: float | None = None
    newer: bool = False
    positive: bool = False
    listed: bool = False
    part: str = ""
    strut: int | None = None

    @property
    def alone_with(self) -> str:
        """Part of the source that may be wrong while the others are not: that of its strut, or the one stated."""
        return self.part or (f"strut {self.strut}" if self.strut else "")

    @property
    def largest(self) -> float:
        """Greatest size of a value that a model may have, in the parameter's unit."""
        return max(BEYOND_PLAUSIBLE * self.plausible, *(10.0 * abs(value) for value in self.grid), 0.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Least and greatest value of a nonlinear parameter in a fit; an amplitude has none.

        A positive parameter such as a time constant may lie one step of its grid, a ratio, beyond either end; another one as far as
        the grid is long.
        """
        grid = sorted(self.grid)
        if len(grid) < 2 or self.listed:  # noqa: PLR2004 - a step has two ends
            return -math.inf, math.inf
        if grid[0] > 0.0:
            return grid[0] ** 2 / grid[1], grid[-1] ** 2 / grid[-2]
        return 2.0 * grid[0] - grid[-1], 2.0 * grid[-1] - grid[0]


def of_each_strut(
    name: str, unit: str, plausible: float, meaning: str, *, positive: bool = False
) -> tuple[Parameter, ...]:
    """Return one amplitude for each strut.

    Args:
        name: of the parameter; `{}` stands for the strut, 1 to 6.
        plausible: usual size, one standard deviation, in that unit.
        meaning: one line with the sign; `{}` stands for the strut.
        positive: True for what cannot be negative.
    """
    return tuple(
        Parameter(name.format(k), unit, plausible, meaning.format(k), positive=positive, strut=k)
        for k in range(1, STRUTS + 1)
    )


@dataclass(frozen=True)
class Effect:
    """What a source does, or the derivative of that by its parameters (one further axis of length p, last).

    An array without the sample axis holds for every sample. None is no effect.

    Attributes:
        strut_mm: actual minus believed strut length, shape (6,) or (n, 6) [mm].
        base_joint_mm: actual minus nominal base joint, machine frame, shape (6, 3) or (n, 6, 3) [mm].
        platform_joint_mm: actual minus nominal platform joint, platform frame, same shapes [mm].
        tool_tip_mm: shift of tool tip and tool ball against the platform, platform frame, (3,) or (n, 3) [mm].
        fixed_ball_mm: actual minus known centre of the fixed ball, machine frame, (3,) or (n, 3) [mm].
        reading_mm: added to the bar's reading, shape () or (n,) [mm].
        load_n: added to the axial forces that the motors hold, positive where the platform pulls, shape (6,) or
            (n, 6) [N].
        current_a: added to the motor currents, shape (6,) or (n, 6) [A].
    """

    strut_mm: NDArray[np.float64] | None = None
    base_joint_mm: NDArray[np.float64] | None = None
    platform_joint_mm: NDArray[np.float64] | None = None
    tool_tip_mm: NDArray[np.float64] | None = None
    fixed_ball_mm: NDArray[np.float64] | None = None
    reading_mm: NDArray[np.float64] | None = None
    load_n: NDArray[np.float64] | None = None
    current_a: NDArray[np.float64] | None = None

    def __add__(self, other: Effect) -> Effect:
        """Both effects together; arrays with and without the sample axis add up."""
        return Effect(**{f.name: _sum(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)})

    def rows(self, rows: slice) -> Effect:
        """The effect in some of the rows; what holds for every sample still does."""
        taken = {}
        for name, axes in EFFECT_SHAPES.items():
            array = getattr(self, name)
            taken[name] = array[rows] if array is not None and np.ndim(array) > len(axes) else array
        return Effect(**taken)

    def last(self, count: int) -> Effect:
        """The effect in the last rows; what holds for every sample still does."""
        return self.rows(slice(-count, None) if count else slice(0, 0))

    def times(self, values: NDArray[np.float64]) -> Effect:
        """The effect of parameter values, where `self` is a derivative by p parameters, shape (p,)."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return Effect(**{name: None if array is None else array @ values for name, array in arrays.items()})


EFFECT_SHAPES: dict[str, tuple[int, ...]] = {
    "strut_mm": (STRUTS,),
    "base_joint_mm": (STRUTS, 3),
    "platform_joint_mm": (STRUTS, 3),
    "tool_tip_mm": (3,),
    "fixed_ball_mm": (3,),
    "reading_mm": (),
    "load_n": (STRUTS,),
    "current_a": (STRUTS,),
}
"""Axes of each part of an effect, without those of samples and parameters."""


def _sum(a: NDArray[np.float64] | None, b: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


SMOOTH_MM = math.inf
"""`detail_mm` of a source that follows the geometry: it bends over hundreds of millimetres."""

UNSTATED_MM = 4.0
"""What is taken for a source that says nothing of its detail: shorter than the lead of most screws, and a program is
still not longer than one point for each millimetre."""


class ErrorSource(ABC):
    """One physical cause.

    A source without parameters to fit at run time is still a source: its class is its identity, instances
    carry no state. Where a source belongs to a session or a mounting there is one set of parameter values per
    session or mounting; `shared_by` says which runs share a set.
    """

    name: ClassVar[str]
    belongs_to: ClassVar[Owner]
    needs: ClassVar[frozenset[Need]] = frozenset({Need.POSE})
    varies_with: ClassVar[str] = ""
    """Variable that organises its misfit, as printed beside a place; empty where there is no single one."""
    form_uncertainty: ClassVar[float] = 0.05
    """Standard deviation, as a share of the effect, by which real machines depart from the formula: what is smaller beside this
    cause may be a matter of its formula. Few hundredths for geometry and springs, a tenth to three tenths for friction, play
    and warm-ups; each source says why."""
    weighs: ClassVar[bool] = False
    """True for what weights do, which a model asks for at the poses and joints that the machine really has."""
    loads_struts: ClassVar[bool] = False
    """True for a weight: it has a `load_n`, and its `strut_mm` is counted with the compliance of the machine given."""
    weighs_struts: ClassVar[bool] = False
    """True where its `load_n` is that of the strut weights, which the machine file may state as well."""
    detail_mm: ClassVar[float] = UNSTATED_MM
    """Shortest way of a strut or of the tool tip over which the effect goes up and down once [mm]: so closely it is looked
    at where programs are compensated. `SMOOTH_MM` for one that follows the geometry, or does nothing finer than that but
    where a strut turns round: no chord fits a step, however closely it is looked at. Where it hangs on machine or values,
    see `shortest_period_mm`."""
    texts: ClassVar[Texts]
    looks_ahead: ClassVar[bool] = False
    """True where the effect in a row hangs on rows that follow, as of a reading that is taken late. Such a source is asked
    for whole runs only, and one of the machine's is not compensated: a program is compensated from its beginning on."""
    builds_up: ClassVar[bool] = False
    """True where errors build up over many rows, as those of a lag. To find a command for them by trial would take a trial
    for each row; such a source answers `undone`."""
    happens_once: ClassVar[bool] = False
    """True for what acts once in a session, such as a bump: no other tests can show it again, and it is never called identified."""
    candidate: ClassVar[bool] = True
    """Whether a diagnosis may name it; False for what only describes an error and is no cause of one."""

    @abstractmethod
    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        """Parameters in the order of every `values` array.

        Raises:
            ModelError: the machine file lacks what the source needs, such as masses.
        """

    @abstractmethod
    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """What parameter values, shape (p,), do to a motion."""

    @abstractmethod
    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """Derivative of `effect` by each parameter: arrays with one further axis of length p, last."""

    def begin(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> State:  # noqa: ARG002
        """Return what is remembered before the first row of a run.

        Args:
            motion: the run, or as much of its beginning as is known: it shows which way the struts set out.
            values: of the parameters, shape (p,).
        """
        return None

    def advance(
        self, motion: Motion, machine: Machine, values: NDArray[np.float64], state: State
    ) -> tuple[Effect, State]:
        """Return the effect along one stretch of a program, and what is remembered behind its last row.

        However a program is cut into stretches, each asked for with the state behind the one before, the effects are those of
        `effect` for the whole. What a source does not need the path for has no state. One that needs the path and does not
        say what it remembers is given all rows so far each time: right, and slow in long programs.

        Args:
            motion: the stretch, in time order; `straight`.
            values: of the parameters, shape (p,).
            state: of `begin`, or behind the stretch before; it stays as it is, so that a stretch can be asked for again.
        """
        if Need.PATH not in self.needs:
            return self.effect(motion, machine, values), None
        whole = motion if state is None else motion.after(state)
        return self.effect(whole, machine, values).last(len(motion)), whole

    def undone(
        self,
        motion: Motion,
        reached: Motion,
        machine: Machine,
        values: NDArray[np.float64],
        state: State,
    ) -> NDArray[np.float64]:
        """Return the strut errors along a stretch in which the struts come to certain lengths, shape (n, 6) [mm].

        Asked of sources that `builds_up`.

        Args:
            motion: a command that nearly leads there.
            reached: the stretch as this source alone should let the struts come to it.
            values: of the parameters, shape (p,).
        """
        raise NotImplementedError

    def shared_by(self, motion: Motion) -> str:
        """Name of the set of parameter values that this motion takes; motions with one name share the set."""
        if self.belongs_to is Owner.MACHINE or motion.setup is None:
            return ""
        if self.belongs_to is Owner.SESSION:
            return motion.setup.session
        return motion.setup.mounting if self.belongs_to is Owner.MOUNTING else motion.setup.instrument

    def shortest_period_mm(self, machine: Machine, values: NDArray[np.float64]) -> float:  # noqa: ARG002
        """Shortest way over which the effect of these values goes up and down once [mm]: `detail_mm`, if nothing else."""
        return self.detail_mm

    def stated_mm(self, motion: Motion) -> NDArray[np.float64] | None:  # noqa: ARG002
        """Standard deviations, shape (p,), that plan and session state for this motion's set; None: not stated.

        A stated size makes the set a random effect of the fit.
        """
        return None

    def shows(self, motions: Sequence[Motion], nonlinear: Sequence[float]) -> bool:  # noqa: ARG002
        """Whether runs can show the effect at values of its parameters of shape, shape (s,).

        False where they show only a part of it that anything may look like: a diagnosis must not look for it there.
        """
        return True

    def by_temperature(self) -> ErrorSource | None:
        """Return the same cause in the form that follows logged temperatures; None where it knows none.

        It has the same name and other parameters; a model has one of the two.
        """
        return None

    def other_laws(self) -> tuple[ErrorSource, ...]:
        """Return the same cause by other laws: the one that follows logged temperatures, if nothing else.

        Each has the same name and owner, another `law` and other parameters; a model has one of them.
        """
        logged = self.by_temperature()
        return () if logged is None else (logged,)

    def left_open(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Return what other constants of the law would change in the effect, each less the effect: arrays with one further axis, last.

        For constants that are no parameters, since a recording seldom shows them, and that machines differ in: a diagnosis takes each
        of these changes as possible in any share of up to about one. Nothing if nothing is said.
        """
        return Effect()

    @property
    def law(self) -> str:
        """Which of the laws of its cause it is: what it varies with, if nothing else is said."""
        return self.varies_with

    @property
    def simpler_law(self) -> str | None:
        """Law of the same cause that this one becomes where its nonlinear parameters have no effect; None if there is none."""
        return None

    @property
    def has_history(self) -> bool:
        """Whether its effect in a row hangs on the rows before."""
        return Need.PATH in self.needs

    @property
    def of_currents(self) -> bool:
        """Whether it says what currents the motors draw, and changes nothing else."""
        return Need.CURRENT in self.needs

    def found_compliance(self, machine: Machine, values: NDArray[np.float64]) -> Compliance | None:  # noqa: ARG002
        """Return the compliance of the struts that these values say; None for a source that says nothing of it."""
        return None

    def current_per_load(
        self,
        motion: Motion,  # noqa: ARG002
        machine: Machine,  # noqa: ARG002
        values: NDArray[np.float64],  # noqa: ARG002
    ) -> NDArray[np.float64] | None:
        """Derivative of `current_a` by the load of that motor, shape (n, 6) [A/N]; None: no current hangs on a load."""
        return None

    def require(self, motion: Motion) -> None:
        """Refuse a motion that lacks what the source needs.

        Raises:
            ModelError: names the source and what is missing.
        """
        missing = self.needs - motion.provides
        if missing:
            raise ModelError(
                f"the error source {self.name} needs {', '.join(sorted(missing))}, which is not given here",
                remedy=_HOW_TO_GIVE[min(missing)],
            )


_HOW_TO_GIVE = {
    Need.POSE: "give poses",
    Need.PATH: "give a program or a recording instead of single poses, or a model without this source",
    Need.TIME: "give a recording with times, or a model without this source",
    Need.TEMPERATURE: "give recordings with a temperature column, or a model without this source",
    Need.CURRENT: "give recordings with motor currents, or a model without this source",
    Need.READING: "give recordings of the bar, or a model without this source",
}


class SourceWithHistory(ErrorSource):
    """A source that says what it remembers: `begin` and `advance` have to be written, and a whole run is one stretch."""

    @abstractmethod
    def begin(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> State:
        """Return what is remembered before the first row of a run."""

    @abstractmethod
    def advance(
        self, motion: Motion, machine: Machine, values: NDArray[np.float64], state: State
    ) -> tuple[Effect, State]:
        """Return the effect along one stretch, and what is remembered behind its last row."""

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """The effect along the whole run, taken as one stretch."""
        return self.advance(motion, machine, values, self.begin(motion, machine, values))[0]


class LinearSource(ErrorSource):
    """A source whose effect is proportional to its parameters: only the derivative has to be written."""

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """Derivative times values."""
        return self.derivative(motion, machine, values).times(values)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A source with values for one of its sets, as a model carries it.

    Attributes:
        values: parameter values in the order of `source.parameters`, shape (p,).
        shared: name of the set, empty for the machine's own sources.
    """

    source: ErrorSource
    values: NDArray[np.float64]
    shared: str = ""

    @classmethod
    def zero(cls, source: ErrorSource, machine: Machine, shared: str = "") -> Self:
        """Return the source with all its parameters at zero."""
        return cls(source, np.zeros(len(source.parameters(machine))), shared)
