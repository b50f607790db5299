"""Variables that a difference between sessions may follow, as columns of the low harmonics of every run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.compare_noise import first_columns, of_ball
from dbbstation.diagnosis.shapes import ranges, samples_of, shapes
from dbbstation.inference.harmonics import basis
from dbbstation.machine.geometry import STRUTS
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Effect
from dbbstation.trace.circle import RawCircle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare_pairs import Pair
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion

UM, URAD = 1e3, 1e6

SAME_RHYTHM = 0.999
"""Correlation of the times of both sessions above which nothing can tell them apart."""


@dataclass(frozen=True, eq=False)
class Family:
    """Columns of one variable.

    Attributes:
        variable: as printed.
        strut: 1 to 6; None where it is not one strut's.
        columns: effect of each amplitude on the coefficients of each run, shape (r, k, p).
        amplitudes: name, factor to its unit, unit of each column; empty where they mean nothing one by one.
    """

    variable: str
    strut: int | None
    columns: NDArray[np.float64]
    amplitudes: tuple[tuple[str, float, str], ...] = ()

    @property
    def name(self) -> str:
        """Variable and strut."""
        return self.variable if self.strut is None else f"{self.variable}, strut {self.strut}"


def families(machine: Machine, pairs: Sequence[Pair], low: int) -> list[Family]:
    """Return all variables that these runs can show."""
    return [*_of_readings(pairs, low), *_of_runs(pairs, low), *_of_struts(machine, pairs, low)]


def _of_readings(pairs: Sequence[Pair], low: int) -> list[Family]:
    """Constant, centre, balls."""
    count, size = len(pairs), 2 * low + 1
    zero, cosine, sine = first_columns(low)
    constant, centre = np.zeros((count, size, 1)), np.zeros((count, size, 2))
    constant[:, zero, 0] = [np.sqrt(len(pair.a_mm)) for pair in pairs]
    balls = np.zeros((count, size, 3))
    balls[:, [zero, cosine, sine]] = [of_ball(pair) for pair in pairs]
    centre[:, :, 0], centre[:, :, 1] = -balls[:, :, 0], -balls[:, :, 1]
    names = [f"{pair.a[0].setup.mounting} / {pair.b[0].setup.mounting}" for pair in pairs]
    mountings = list(dict.fromkeys(names))
    own = np.zeros((count, size, 3 * len(mountings)))
    for r, name in enumerate(names):
        first = 3 * mountings.index(name)
        own[r, :, first : first + 3] = balls[r]
    return [
        Family("the same constant in every run", None, constant, (("constant", UM, "µm"),)),
        Family("the same centre shift in every run", None, centre, (("x", UM, "µm"), ("y", UM, "µm"))),
        Family("all balls moved as one body", None, _as_one_body(pairs, balls), _BODY),
        Family("a ball shift of its own in every mounting", None, own),
    ]


_BODY = (*((axis, UM, "µm") for axis in "xyz"), *((f"about {axis}", URAD, "µrad") for axis in "xyz"))


def _as_one_body(pairs: Sequence[Pair], balls: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift of all balls, and turns of them about their mean, shape (r, k, 6)."""
    place = np.array([pair.circle.ball_mm for pair in pairs])
    arm = place - place.mean(axis=0)
    # A small turn w moves a ball by w x arm.
    turns = np.stack([np.cross(axis, arm) for axis in np.eye(3)], axis=2)
    return np.concatenate([balls, balls @ turns], axis=2)


def _of_runs(pairs: Sequence[Pair], low: int) -> list[Family]:
    """Mean and centre that go with something that is one number, or a few, for each run."""
    size = 2 * low + 1
    first = np.zeros((len(pairs), size, 3))
    first[:, first_columns(low), range(3)] = np.sqrt(len(pairs[0].a_mm))
    centre = np.array([pair.circle.centre_mm for pair in pairs])
    variables = {
        "height": centre[:, 2:],
        "place in x and y": centre[:, :2],
        "tilt": np.array([pair.circle.tilt_deg for pair in pairs]),
        **_times(pairs),
    }
    found = []
    for name, values in variables.items():
        spread = np.ptp(values, axis=0)
        if spread.max() == 0.0:
            continue
        scaled = (values - values.mean(axis=0))[:, spread > 0.0] / spread[spread > 0.0]
        with_one = np.column_stack([np.ones(len(pairs)), scaled])
        columns = np.einsum("rkp,rv->rkpv", first, with_one).reshape(len(pairs), size, -1)
        found.append(Family(f"{name}: mean and centre", None, columns))
    return found


def _times(pairs: Sequence[Pair]) -> dict[str, NDArray[np.float64]]:
    """Start of every run, in one session alone where the other took them in the same rhythm."""
    found = {f"time in {side.upper()}": times for side in "ab" if (times := _started(pairs, side)) is not None}
    if len(found) < 2:  # noqa: PLR2004 - one session or none notes times
        return found
    one, other = (times[:, 0] - times.mean() for times in found.values())
    if one @ other > SAME_RHYTHM * np.linalg.norm(one) * np.linalg.norm(other):
        return {"time in the session": found["time in B"]}
    return found


def _started(pairs: Sequence[Pair], side: str) -> NDArray[np.float64] | None:
    """Start of every run in one session, mean of repeats, shape (r, 1) [s]; None where not noted."""
    times = [[run.started_s for run in (pair.a if side == "a" else pair.b)] for pair in pairs]
    if any(time is None for of_run in times for time in of_run):
        return None
    return np.array([[np.mean([time for time in of_run if time is not None])] for of_run in times])


def _of_struts(machine: Machine, pairs: Sequence[Pair], low: int) -> list[Family]:
    """Errors of strut lengths, constant or with a variable, through the sensitivities of the nominal machine."""
    model = MachineModel(machine)
    motions = [_motion(pair) for pair in pairs]
    readings = [model.bar(motion) for motion in motions]
    runs = [samples_of(motion, machine, reading) for motion, reading in zip(motions, readings, strict=True)]
    extent = ranges(runs)
    found: dict[tuple[str, int | None], list[NDArray[np.float64]]] = {}
    for pair, run, reading in zip(pairs, runs, readings, strict=True):
        theta = np.radians(pair.theta_deg)[_order(pair)]
        towards = basis(theta, low).T / np.sqrt(len(theta))
        constant = Effect(strut_mm=np.eye(STRUTS))
        steps = towards @ reading.by_parameters(constant)
        for i in range(STRUTS):
            found.setdefault((_STEP, i + 1), []).append(steps[:, i : i + 1])
        found.setdefault((_STEP, None), []).append(steps)
        signs = []
        for shape in shapes(extent):
            if str(shape.follows) not in _NAMES:
                continue
            columns = towards @ shape.columns(run)
            found.setdefault((_NAMES[str(shape.follows)], shape.strut), []).append(columns)
            if shape.variable == "strut-speed-sign" and shape.strut is not None:
                signs.append(columns)
        if signs:
            found.setdefault((_SIGNS, None), []).append(np.hstack(signs))
    return [
        Family(variable, strut, np.array(columns), _named(variable, strut))
        for (variable, strut), columns in found.items()
        if len(columns) == len(pairs)
    ]


_STEP = "strut length, a constant"
_SIGNS = "strut speed sign, every strut its own"
_NAMES = {
    "strut-length": "strut length, a curve",
    "strut-speed-sign": "strut speed sign",
    "strut-force": "strut force",
    "time": "strut length, with time in B",
    "time of the reading": "reading, with time in B",
    "position of the platform": "position of the platform",
    "angle": "the same curve over the angle in every run",
}


def _named(variable: str, strut: int | None) -> tuple[tuple[str, float, str], ...]:
    if variable not in {_STEP, _SIGNS, _NAMES["strut-speed-sign"]}:
        return ()
    if variable == _NAMES["strut-speed-sign"] or strut is not None:
        return ((f"strut {strut}" if strut else "all struts", UM, "µm"),)
    return tuple((f"strut {i + 1}", UM, "µm") for i in range(STRUTS))


def _order(pair: Pair) -> NDArray[np.int64]:
    """Common angles in the order of travel."""
    return np.argsort(pair.circle.phi_deg(pair.theta_deg)).astype(np.int64)


def _motion(pair: Pair) -> Motion:
    """The circle as planned, at the common angles in the order of travel, with the times of B."""
    run = pair.b[0]
    raw, theta = run.raw, pair.theta_deg[_order(pair)]
    by_phi = np.argsort(raw.phi_deg, kind="stable")
    even = RawCircle(
        name=raw.name,
        circle=replace(raw.circle, start_deg=pair.circle.start_deg),
        # B may have started its turn elsewhere.
        t_s=np.interp(raw.circle.phi_deg(theta), raw.phi_deg[by_phi], raw.t_s[by_phi]),
        phi_deg=pair.circle.phi_deg(theta),
        length_mm=np.full(len(theta), raw.circle.bar_mm),
    )
    return replace(run, raw=even, commanded=None).motion()
