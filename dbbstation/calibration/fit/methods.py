"""The paper's three methods [CAL IV], which differ only in the knowledge of ball positions."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import FEWEST_TESTS, check_raw
from dbbstation.errors import CalibrationError
from dbbstation.machine.geometry import Frames
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation

BY_HAND_MM = 0.3
"""Prior standard deviation per axis of an unmeasured ball set up under the spindle by hand [mm]: hundreds of times the
resolution of circles, so the prior adds no information."""

CENTRED_MM = 2e-5
"""Centres so near the fixed ball cannot be measured ones, however accurate the set-up [mm]."""

CENTRED_SHARE = 0.3
"""Centres nearer to the balls than this share of the stated scatter of mountings and CMM are suspicious: for thirty
coordinates the probability is 1e-12. Centre compensation leaves less, the squared centre over the radius."""

LEAST_CIRCULARITY_UM = 0.5
"""A smaller circular deviation indicates a simulated nominal machine, whose centres may be exact [µm]."""


HEIGHT_MM = 0.02
"""Prior standard deviation of such a ball's height, for a level bar [mm]. A tenth of a millimetre changes the reading
by 0.03 µm; free heights would only correlate with the tilt of circles in second order."""


class Method(StrEnum):
    """Methods, by the origin of ball positions."""

    JIG = "jig"
    CONV_A = "conv-a"
    CONV_B = "conv-b"


def as_known(method: Method, machine: Machine, observations: Sequence[Observation]) -> list[Observation]:
    """Return runs with ball positions and priors of a method.

    Args:
        observations: raw circles; conventional methods ignore known ball positions.

    Raises:
        CalibrationError: an unknown but needed ball position; centred circles.
    """
    check_raw(observations)
    if method is Method.JIG:
        _check_places(observations)
        _check_not_centred(observations)
        return list(observations)
    if method is Method.CONV_B:
        _check_read(observations)
        _check_not_centred(observations)
        return [_under_spindle(observation, machine) for observation in observations]
    forgotten = [replace(o, setup=replace(o.setup, set_up_errors=None)) for o in observations]
    return [_under_spindle(observation, machine) for observation in forgotten]


def _under_spindle(observation: Observation, machine: Machine) -> Observation:
    raised = observation.raw.circle.elevation_deg != 0.0
    unknown = np.array([BY_HAND_MM, BY_HAND_MM, BY_HAND_MM if raised else HEIGHT_MM])
    read = observation.setup.set_up_errors
    if read is None:
        size = unknown
    else:
        tilt = np.array([[0.0, 0.0, 0.0, *observation.raw.circle.tilt_deg]])
        turn = Frames.from_poses(tilt, machine.hexapod.rotation).rotation[0]
        fixed, moving = (
            np.where(np.isnan(values), unknown, read.uncertainty_mm)
            for values in (read.fixed_ball_mm, read.moving_ball_mm)
        )
        size = np.sqrt(fixed**2 + turn**2 @ moving**2)
    setup = replace(observation.setup, mounting_repeatability_mm=size, ball_uncertainty_mm=0.0, place_known=False)
    return replace(observation, setup=setup)


def _check_places(observations: Sequence[Observation]) -> None:
    unknown = [observation.test for observation in observations if not observation.setup.place_known]
    if unknown:
        tests = len({(o.setup.session, o.test) for o in observations})
        more = "" if tests >= FEWEST_TESTS else f" and {FEWEST_TESTS} tests at least (here are {tests})"
        raise CalibrationError(
            f"the ball was put up under the spindle in test {', '.join(dict.fromkeys(unknown))}: its place in the "
            "machine's coordinates is unknown, and the jig method needs it",
            remedy=f"calibrate with --method conv-a, or conv-b if set-up errors were measured{more}; or measure on a jig plate",
        )


def _check_read(observations: Sequence[Observation]) -> None:
    missing = [o.test for o in observations if o.setup.set_up_errors is None]
    if missing:
        raise CalibrationError(
            f"no set-up errors were measured in test {', '.join(dict.fromkeys(missing))}, which conv-b needs",
            remedy="write the micrometer readings under `set_up_errors` in session.yaml, or use --method conv-a",
        )


def _check_not_centred(observations: Sequence[Observation]) -> None:
    if not observations:
        return
    seen = [figures(observation.raw) for observation in observations]
    off = sqrt(np.mean([np.square(circle.centre_mm) for circle in seen]))
    bent = np.median([circle.circularity_um for circle in seen])
    setups = [observation.setup for observation in observations]
    stated = np.mean([np.mean(s.mounting_repeatability_mm) ** 2 + s.ball_uncertainty_mm**2 for s in setups])
    limit = max(CENTRED_MM, CENTRED_SHARE * sqrt(stated))
    if off < limit and bent > LEAST_CIRCULARITY_UM:
        raise CalibrationError(
            f"the centres of the {len(seen)} circles lie within {1e3 * off:.2g} µm rms of the fixed balls, closer than any "
            "mounting: a centre compensation has removed the machine's position errors from these recordings",
            remedy="switch centre compensation off and measure again, or export raw lengths; --method conv-a uses these recordings, but not their positions",
        )
