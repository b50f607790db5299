"""The interface of an error source.

A machine model is nominal geometry plus error sources. A source computes its `effect` on a `Motion` and the derivative
by its parameters. Readings may only give the bar encoder's place. Effects change only struts, joints, tool tip, fixed
ball, readings, loads or motor currents.
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
from dbbstation.laws.contract import Parameter as Parameter  # noqa: PLC0414 - part of the contract: sources take it from here
from dbbstation.laws.contract import Texts as Texts  # noqa: PLC0414 - part of the interface: sources import it from here
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS, Frames
from dbbstation.machine.kinematics import Struts, inverse
from dbbstation.trace.columns import WithLogged

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike
    from scipy.sparse import csr_array

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Compliance, Hexapod, Machine
    from dbbstation.plan.plan import Ball, Plate
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class CForm:
    """Statements of C that add a source's effect at one pose.

    They may use names of `control/kernel.c`: `at`, the source's struts; `e`, the sum of effects; `v`, the values;
    `EACH`, a loop over struts i. The expression `warmer[thermometer[k]]` is thermometer k's excess over its zero [K].

    Attributes:
        by_pose: False if it uses only lengths of `at`, so the pose need not be computed.
        constants: further numbers or arrays by name.
        thermometers: columns without their unit, best choice first.
    """

    body: str
    by_pose: bool = True
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    thermometers: tuple[tuple[str, ...], ...] = ()


def c_constant(name: str, value: ArrayLike) -> str:
    """Return the C definition of a number or an array, exact to the last bit."""
    array = np.asarray(value)
    kind = "int" if np.issubdtype(array.dtype, np.integer) else "double"
    shape = "".join(f"[{n}]" for n in array.shape)
    return f"static const {kind} {name}{shape} = {str(array.tolist()).translate(_BRACES)};"


_BRACES = str.maketrans("[]", "{}")


Worked = TypeVar("Worked")

State = Any
"""A source's memory of earlier rows, of any type; never changed in place."""


class Owner(StrEnum):
    """Owner of a source; only machine sources are predicted and compensated."""

    MACHINE = "machine"
    SESSION = "session"
    MOUNTING = "mounting"
    INSTRUMENT = "instrument"


class Need(StrEnum):
    """Inputs that a source needs besides the machine."""

    POSE = "pose"
    PATH = "path"
    TIME = "time"
    TEMPERATURE = "temperature"
    CURRENT = "current"
    READING = "reading"


@dataclass(frozen=True, eq=False)
class SetUpErrors:
    """Micrometer readings of balls at the spindle [CAL III-A, IV]; NaN if not measured.

    Attributes:
        fixed_ball_mm: fixed ball less tool tip at the ball's commanded place, machine frame, shape (3,).
        moving_ball_mm: moving ball less tool tip, platform frame, shape (3,).
    """

    fixed_ball_mm: Floats
    moving_ball_mm: Floats
    uncertainty_mm: float


@dataclass(frozen=True, eq=False)
class Thermometer:
    """One thermometer over a session.

    Attributes:
        degc: smoothed temperatures without quantisation, shape (q,).
    """

    time_s: Floats
    degc: Floats


@dataclass(frozen=True)
class Setup:
    """Set-up of a run: ball, mounting and bar with their uncertainties.

    Runs with equal names share the error, over all sessions of a fit.

    Attributes:
        fixed_ball_mm: centre by CMM, machine frame, shape (3,).
        mounting_repeatability_mm: one standard deviation, common or per axis, shape (3,).
        ball_uncertainty_mm: of the CMM, one standard deviation per axis.
        bar_uncertainty_mm: of the calibrated length, one standard deviation; large without calibration.
        bar_reads_long_mm: expected reading less true distance; added to predictions, never subtracted from readings.
        bar_length_mm: calibrated distance of the balls, or None.
        place_known: False for a ball set up under the spindle, whose `fixed_ball_mm` is the commanded place.
        set_up_errors: micrometer readings, or None.
        plate: None for a ball in no bore.
        start_uncertainty_deg: standard uncertainty of the turn's start; zero with recorded angles.
        moving_s: start and end of all runs in order, on the clock of `Motion.time_s`; may be empty.
        thermometers: over the session, by column without unit.
    """

    session: str
    mounting: str
    ball: str
    instrument: str
    fixed_ball_mm: Floats
    mounting_repeatability_mm: float | Floats
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

    @classmethod
    def on(cls, ball: Ball, *, session: str, mounting: str, instrument: str, bar_uncertainty_mm: float) -> Self:
        """Return the set-up of a bar on a ball of the plan."""
        return cls(
            session=session,
            mounting=mounting,
            ball=ball.name,
            instrument=instrument,
            fixed_ball_mm=np.array(ball.centre_mm, dtype=np.float64),
            mounting_repeatability_mm=ball.repeatability_mm,
            ball_uncertainty_mm=ball.uncertainty_mm,
            bar_uncertainty_mm=bar_uncertainty_mm,
            place_known=ball.place_known,
            plate=ball.plate,
        )


@dataclass(frozen=True, eq=False)
class Motion(WithLogged):
    """Commands in time order, with logged columns.

    Rows outside `kept` build up the memory of sources and are not compared.

    Attributes:
        poses: commanded [X, Y, Z, A, B, C], shape (n, 6) [mm, deg].
        is_path: rows are successive; otherwise independent poses.
        straight: linear between rows, as in a program; otherwise samples of a smooth path.
        time_s: since the session's first sample, shape (n,); None if unknown.
        logged: by column, shape (n,) each; see `temperature_degc` and `motor_current_a`.
        load_n: axial forces of the motors, positive if the platform pulls, shape (n, 6); None for the machine file's
            weights at commanded poses.
        setup: None for unmeasured poses.
        reading_mm: place of the bar's encoder, shape (n,); None if unmeasured.
        reading_is_measured: True for noisy readings, False for a model's.
        put_up: resting motion during the set-up under the spindle; the ball is at the tip's actual last place. None for
            a known place.
        finer: rows whose means this motion's are; None if its rows are samples.
    """

    poses: Floats
    is_path: bool = False
    straight: bool = False
    kept: slice = field(default_factory=lambda: slice(None))
    time_s: Floats | None = None
    logged: Logged = field(default_factory=dict)
    load_n: Floats | None = None
    setup: Setup | None = None
    reading_mm: Floats | None = None
    reading_is_measured: bool = False
    put_up: Motion | None = None
    finer: FinerMotion | None = None
    _known: dict[str, tuple[Hexapod | None, object]] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.poses)

    def frames(self, machine: Machine) -> Frames:
        """Return commanded frames of the platform, cached."""
        return self.once("frames", machine, lambda: Frames.from_poses(self.poses, machine.hexapod.rotation))

    def struts(self, machine: Machine) -> Struts:
        """Return struts at commanded poses, cached."""
        return self.once("struts", machine, lambda: inverse(machine.hexapod, self.frames(machine)))

    def once(self, what: str, machine: Machine | None, work: Callable[[], Worked]) -> Worked:
        """Return a result that depends on motion and joints only, cached while in use."""
        joints, known = None if machine is None else machine.hexapod, self._known.get(what)
        if known is None or known[0] is not joints:
            known = self._known[what] = joints, work()
        return cast("Worked", known[1])

    def commanded(self, frames: Frames, machine: Machine) -> Motion:
        """Return the motion with other commanded frames."""
        motion = self.moved(frames.to_poses(machine.hexapod.rotation))
        motion._known["frames"] = machine.hexapod, frames  # noqa: SLF001 - of the same class
        return motion

    def moved(self, poses: Floats) -> Motion:
        """Return the motion at other poses, shape (n, 6) [mm, deg]."""
        return replace(self, poses=poses, finer=None)

    def seen(self, source: ErrorSource, effect: Callable[[Motion], Effect], parameters: int = 0) -> Effect:
        """Return a source's effect on this motion: means of its effect on finer rows, if it is sharp.

        Args:
            parameters: last axes of parameters: 0 for an effect, 1 for a derivative.
        """
        if self.finer is None or not source.is_sharp:
            return effect(self)
        return effect(self.finer.motion).changed(self.finer.means, parameters)

    def stretch(self, rows: slice) -> Motion:
        """Return some rows in time order, all of them kept."""
        return self._of_rows(lambda values, _: values[rows])

    def after(self, earlier: Motion) -> Motion:
        """Return an earlier stretch followed by this one, all rows kept."""
        before = earlier._rows()
        return self._of_rows(lambda values, name: np.concatenate([before[name], values]))

    def _rows(self) -> dict[str, Floats]:
        own = {name: getattr(self, name) for name in ("poses", "time_s", "load_n", "reading_mm")}
        return {name: values for name, values in own.items() if values is not None} | dict(self.logged)

    def _of_rows(self, change: Callable[[Floats, str], Floats]) -> Motion:
        changed = {name: change(values, name) for name, values in self._rows().items()}
        logged = {name: changed.pop(name) for name in self.logged}
        return replace(self, kept=slice(None), logged=logged, put_up=None, finer=None, **changed)  # type: ignore[arg-type]

    @cached_property
    def provides(self) -> frozenset[Need]:
        """Return inputs that this motion provides."""
        given = {Need.POSE: True, Need.PATH: self.is_path, Need.TIME: self.time_s is not None}
        given |= {Need.TEMPERATURE: bool(self.temperature_degc), Need.CURRENT: self.motor_current_a is not None}
        given[Need.READING] = self.reading_mm is not None
        return frozenset(need for need, there in given.items() if there)


@dataclass(frozen=True, eq=False)
class FinerMotion:
    """Samples of which a motion has means.

    A step within a row's samples changes their mean by a share of the step, and a wave's mean is smaller than the wave.

    Attributes:
        row: each sample's row, from 0 without gaps, shape (m,).
    """

    motion: Motion
    row: Integers

    def means(self, samples: Floats) -> Floats:
        """Return each row's mean of samples, shape (m, ...)."""
        sums, count = self._by_row
        found = (sums @ samples.reshape(len(samples), -1)) / count[:, None]
        return np.asarray(found.reshape(-1, *samples.shape[1:]), dtype=np.float64)

    @cached_property
    def _by_row(self) -> tuple[csr_array, Integers]:
        """Return the matrix that adds each row's samples, shape (n, m), and their numbers, shape (n,)."""
        from scipy.sparse import csr_array  # noqa: PLC0415 - commands that fit nothing need not load it

        count = np.bincount(self.row)
        order, ends = np.argsort(self.row, kind="stable"), np.cumsum([0, *count])
        return csr_array((np.ones(len(order)), order, ends), shape=(len(count), len(order))), count


def of_each_strut(
    name: str, unit: str, plausible: float, meaning: str, *, positive: bool = False
) -> tuple[Parameter, ...]:
    """Return one amplitude parameter per strut."""
    return tuple(
        Parameter(name.format(k), unit, plausible, meaning.format(k), positive=positive, strut=k) for k in STRUT_NUMBERS
    )


def of_each_joint(
    plausible_mm: float, meaning: str, axes: str = "xyz", tolerance: float | None = None
) -> tuple[Parameter, ...]:
    """Return parameters of the coordinates of each strut's joint."""
    return tuple(
        Parameter(
            f"joint_{k}_{axis.lower()}_mm", "mm", plausible_mm, meaning.format(k, axis), tolerance=tolerance, strut=k
        )
        for k in STRUT_NUMBERS
        for axis in axes
    )


def of_own_strut(along: Floats) -> Floats:
    """Return changes of the struts by each strut's own p amplitudes, shape (n, 6, 6 p), from those along each, shape (n, 6, p) or (n, 6)."""
    own = np.atleast_3d(along)
    found = np.zeros((len(own), STRUTS, STRUTS, own.shape[2]))
    found[:, np.arange(STRUTS), np.arange(STRUTS)] = own
    return found.reshape(len(own), STRUTS, -1)


@dataclass(frozen=True)
class Effect:
    """A source's effect, or its derivative by parameters (last axis of length p).

    Arrays without sample axis apply to every sample. None means no effect.

    Attributes:
        strut_mm: actual minus assumed length, shape (6,) or (n, 6).
        base_joint_mm: actual minus nominal, machine frame, shape (6, 3) or (n, 6, 3).
        platform_joint_mm: actual minus nominal, platform frame, same shapes.
        tool_tip_mm: shift of tip and ball, platform frame, (3,) or (n, 3).
        fixed_ball_mm: actual minus known centre, machine frame, (3,) or (n, 3).
        reading_mm: added to the reading, shape () or (n,).
        load_n: added to the motors' axial forces, positive if the platform pulls, shape (6,) or (n, 6).
        current_a: added to motor currents, shape (6,) or (n, 6).
    """

    strut_mm: Floats | None = None
    base_joint_mm: Floats | None = None
    platform_joint_mm: Floats | None = None
    tool_tip_mm: Floats | None = None
    fixed_ball_mm: Floats | None = None
    reading_mm: Floats | None = None
    load_n: Floats | None = None
    current_a: Floats | None = None

    def __add__(self, other: Effect) -> Effect:
        """Return the sum of two effects."""
        return Effect(**{f.name: _sum(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)})

    def rows(self, rows: slice) -> Effect:
        """Return the effect in some rows."""
        return self.changed(lambda array: array[rows])

    def changed(self, of_samples: Callable[[Floats], Floats], parameters: int = 0) -> Effect:
        """Return the effect with other samples; parts without samples stay."""
        taken = {}
        for name, axes in EFFECT_SHAPES.items():
            array = getattr(self, name)
            taken[name] = of_samples(array) if array is not None and np.ndim(array) > len(axes) + parameters else array
        return Effect(**taken)

    def last(self, count: int) -> Effect:
        """Return the effect in the last rows."""
        return self.rows(slice(-count, None) if count else slice(0, 0))

    def times(self, values: Floats) -> Effect:
        """Return the effect of values, shape (p,), or of a matrix of them, (p, q), from a derivative."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self)}
        return Effect(**{name: None if array is None else _product(array, values) for name, array in arrays.items()})


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


def _product(array: Floats, values: Floats) -> Floats:
    if values.ndim == 1:
        return np.asarray(array @ values)
    # One product of all rows takes a sixth of the time of a small product per sample.
    return (array.reshape(-1, len(values)) @ values).reshape(*array.shape[:-1], -1)


def _sum(a: Floats | None, b: Floats | None) -> Floats | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


MM_PER_UM = 1e-3
MM_PER_UM_M = 1e-6
"""One µm/m in mm/mm."""

SMOOTH_MM = math.inf
"""`detail_mm` of a source that varies over hundreds of millimetres."""

UNSTATED_MM = 4.0
"""Default `detail_mm`: shorter than most screw leads, but still at most one point per millimetre of a program."""


class ErrorSource(ABC):
    """One physical cause; instances have no state.

    Sources of sessions and mountings have separate values for each group of runs, named by `shared_by`.
    """

    name: ClassVar[str]
    belongs_to: ClassVar[Owner]
    needs: ClassVar[frozenset[Need]] = frozenset({Need.POSE})
    varies_with: ClassVar[str] = ""
    """Variable on which its error depends, as printed; empty if there is no single one."""
    form_uncertainty: ClassVar[float] = 0.05
    """Relative standard deviation of real machines from the formula; smaller residuals may be formula errors. Few
    hundredths for geometry and springs, 0.1 to 0.3 for friction, play and warm-up; each source states the reason."""
    weighs: ClassVar[bool] = False
    """True for effects of weights, which a model computes at actual poses and joints."""
    loads_struts: ClassVar[bool] = False
    """True for a weight with a `load_n`, whose `strut_mm` uses the given machine's compliance."""
    weighs_struts: ClassVar[bool] = False
    """True if its `load_n` comes from strut weights, which the machine file may also state."""
    detail_mm: ClassVar[float] = UNSTATED_MM
    """Shortest travel of a strut or the tool tip over which the effect varies up and down once [mm]; it determines the
    sampling of compensated programs. `SMOOTH_MM` if the effect varies like the geometry except for steps at reversals,
    which no sampling resolves. See `shortest_period_mm` if it depends on machine or values."""
    texts: ClassVar[Texts]
    looks_ahead: ClassVar[bool] = False
    """True if a row's effect depends on later rows, as for delayed readings. Such a source receives whole runs only. A
    machine source of this kind cannot be compensated, because programs are compensated from the beginning."""
    builds_up: ClassVar[bool] = False
    """True if errors accumulate over many rows, as by a lag. A search for commands would need a trial per row, so the
    source implements `undone`."""
    happens_once: ClassVar[bool] = False
    """True for a single event in a session, such as a bump: other tests cannot show it again, so it is never called identified."""
    concealed_times: ClassVar[float] = 1.0
    """Prior standard deviation of undetermined directions, in units of plausible sizes."""
    candidate: ClassVar[bool] = True
    """Whether a diagnosis may name it; False for a mere description of an error."""
    law: ClassVar[str]
    """Name of the law; `varies_with`, unless the class states `law`."""
    simpler_law: ClassVar[str | None]
    """Name of the law of which this is an extension, or None."""
    further_laws: ClassVar[tuple[type[ErrorSource], ...]]
    """Other laws of the cause, except the one by temperatures."""
    logged_law: ClassVar[type[ErrorSource] | None]

    def __init_subclass__(
        cls, law: str = "", law_of: type[ErrorSource] | None = None, extends: type[ErrorSource] | None = None
    ) -> None:
        """Declare a cause, or another law of a cause, which has the cause's attributes unless it states its own.

        Args:
            law_of: the cause.
            extends: its law of which this is an extension.
        """
        super().__init_subclass__()
        if law_of is not None:
            own = {name for kind in cls.__mro__[: cls.__mro__.index(ErrorSource)] for name in vars(kind)}
            for name in _OF_EVERY_LAW - own:
                setattr(cls, name, getattr(law_of, name))
            if Need.TEMPERATURE in cls.needs:
                law_of.logged_law = cls
            else:
                law_of.further_laws = (*law_of.further_laws, cls)
        cls.further_laws, cls.logged_law = (), None
        cls.law = law or vars(cls).get("law", cls.varies_with)
        cls.simpler_law = None if extends is None else extends.law

    @abstractmethod
    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        """Return the parameters in the order of `values`.

        Raises:
            ModelError: the machine file lacks an input, such as masses.
        """

    @property
    def is_sharp(self) -> bool:
        """Return whether its effect has steps at reversals, or short waves of the machine or the bar."""
        has_waves = self.belongs_to in {Owner.MACHINE, Owner.INSTRUMENT} and self.detail_mm < SMOOTH_MM
        return Need.PATH in self.needs or has_waves

    @abstractmethod
    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return the effect of values, shape (p,), on a motion."""

    @abstractmethod
    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return the derivative of `effect`, with a last axis of length p."""

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> State:  # noqa: ARG002
        """Return the memory at the start of a run.

        Args:
            motion: the run or its beginning, which gives the struts' directions.
        """
        return None

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: State) -> tuple[Effect, State]:
        """Return the effect along one stretch, and the memory after it.

        Any division into stretches gives equal effects. Sources without memory have no state. A path source that does
        not define its memory receives all earlier rows each time, which is slow.

        Args:
            motion: in time order; `straight`.
            state: from `begin` or the previous stretch; not modified.
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
        values: Floats,
        state: State,
    ) -> Floats:
        """Return strut errors along a stretch that reaches given lengths, shape (n, 6) [mm].

        Only for sources with `builds_up`.

        Args:
            motion: a command near the solution.
            reached: the stretch that the machine should reach with this source alone.
        """
        raise NotImplementedError

    def shared_by(self, motion: Motion) -> str:
        """Return the name of the group of runs that share this motion's values."""
        if self.belongs_to is Owner.MACHINE or motion.setup is None:
            return ""
        if self.belongs_to is Owner.SESSION:
            return motion.setup.session
        return motion.setup.mounting if self.belongs_to is Owner.MOUNTING else motion.setup.instrument

    def shortest_period_mm(self, machine: Machine, values: Floats) -> float:  # noqa: ARG002
        """Return the shortest travel of one wave for these values [mm]; by default `detail_mm`."""
        return self.detail_mm

    def stated_mm(self, motion: Motion) -> Floats | None:  # noqa: ARG002
        """Return the stated standard deviations for this motion, shape (p,), or None.

        Stated sizes make the source a random effect.
        """
        return None

    def shows(self, motions: Sequence[Motion], nonlinear: Sequence[float]) -> bool:  # noqa: ARG002
        """Return whether runs determine the effect at shape parameters, shape (s,).

        False if they show only an ambiguous part of it.
        """
        return True

    def by_temperature(self) -> ErrorSource | None:
        """Return the cause's law by logged temperatures, or None."""
        return None if self.logged_law is None else self.logged_law()

    def other_laws(self) -> tuple[ErrorSource, ...]:
        """Return other laws of the cause; by default the declared ones and the law by temperatures.

        All laws have the same name and owner; a model contains only one.
        """
        logged = self.by_temperature()
        return (*(law() for law in self.further_laws), *(() if logged is None else (logged,)))

    def c_form(self, machine: Machine, values: Floats) -> CForm | None:  # noqa: ARG002
        """Return the effect as C for a kinematics inside a control; by default None.

        Args:
            machine: with the identified compliance.

        Raises:
            ModelError: the machine file lacks an input.
        """
        return None

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        """Return changes of the effect if constants of the law differ, stacked along a last axis.

        They describe constants of the machine that recordings seldom determine. A diagnosis allows each change with a
        factor up to about one. None by default.
        """
        return Effect()

    @property
    def has_history(self) -> bool:
        """Return whether a row's effect depends on earlier rows."""
        return Need.PATH in self.needs

    @property
    def of_currents(self) -> bool:
        """Return whether it only affects motor currents."""
        return Need.CURRENT in self.needs

    def found_compliance(self, machine: Machine, values: Floats) -> Compliance | None:  # noqa: ARG002
        """Return the struts' compliance for these values, scaled by the first, or None."""
        return None

    def current_per_load(
        self,
        motion: Motion,  # noqa: ARG002
        machine: Machine,  # noqa: ARG002
        values: Floats,  # noqa: ARG002
    ) -> Floats | None:
        """Return the derivative of `current_a` by the motor's load, shape (n, 6) [A/N]; None if independent."""
        return None

    def require(self, motion: Motion) -> None:
        """Refuse a motion that lacks inputs.

        Raises:
            ModelError: names source and missing inputs.
        """
        missing = self.needs - motion.provides
        if missing:
            raise ModelError(
                f"the error source {self.name} needs {', '.join(sorted(missing))}, which is not given here",
                remedy=_HOW_TO_GIVE[min(missing)],
            )


_OF_EVERY_LAW = {"name", "belongs_to", "texts", "needs", "varies_with", "form_uncertainty", "detail_mm"}
"""Attributes that all laws of a cause share."""

_HOW_TO_GIVE = {
    Need.POSE: "give poses",
    Need.PATH: "give a program or a recording instead of single poses, or a model without this source",
    Need.TIME: "give a recording with times, or a model without this source",
    Need.TEMPERATURE: "give recordings with a temperature column, or a model without this source",
    Need.CURRENT: "give recordings with motor currents, or a model without this source",
    Need.READING: "give recordings of the bar, or a model without this source",
}


class SourceWithHistory(ErrorSource):
    """A source that defines its memory by `begin` and `advance`."""

    @abstractmethod
    def begin(self, motion: Motion, machine: Machine, values: Floats) -> State:
        """Return the memory at the start of a run."""

    @abstractmethod
    def advance(self, motion: Motion, machine: Machine, values: Floats, state: State) -> tuple[Effect, State]:
        """Return the effect along one stretch, and the memory after it."""

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return the effect of a whole run."""
        return self.advance(motion, machine, values, self.begin(motion, machine, values))[0]


class LinearSource(ErrorSource):
    """A source with an effect proportional to its parameters; subclasses define only the derivative."""

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return derivative times values."""
        return self.derivative(motion, machine, values).times(values)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A source with values for one group of runs, as in a model.

    Attributes:
        shared: name of the group; empty for the machine.
    """

    source: ErrorSource
    values: Floats
    shared: str = ""

    @classmethod
    def zero(cls, source: ErrorSource, machine: Machine, shared: str = "") -> Self:
        """Return a source with zero values."""
        return cls(source, np.zeros(len(source.parameters(machine))), shared)

    def rows(self, machine: Machine) -> list[tuple[str, str, str]]:
        """Return source, group and parameter of each value, as in the rows of a covariance."""
        return [(self.source.name, self.shared, parameter.name) for parameter in self.source.parameters(machine)]

    def by_name(self, machine: Machine) -> dict[str, float]:
        """Return the values by parameter."""
        return dict(zip((p.name for p in self.source.parameters(machine)), self.values.tolist(), strict=True))
