"""Figures of one circle: centre, mean radial error, circularity [CAL III-A, Table III]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.trace.cut import edges_of, progress_deg
from dbbstation.trace.recording import CentredCircle, RawCircle

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.recording import Recording

MOST_STEPS = 20
CENTRE_TOLERANCE_MM = 1e-12

AGREED_MM = 1e-9
"""Change of the centre below which angles about the ball have converged: a thousandth of a bar's resolution [mm]."""


@dataclass(frozen=True)
class CircleFigures:
    """Centre, mean radial error and circularity of a circular test [CAL Table III].

    Attributes:
        centre_mm: least-squares centre from the fixed ball, X and Y.
        circularity_um: range of radial deviation after least-squares centring.
    """

    centre_mm: tuple[float, float]
    mean_radial_error_um: float
    circularity_um: float

    @property
    def centre_deviation_um(self) -> float:
        """Return the length of the centre offset [µm]."""
        return 1e3 * float(np.hypot(*self.centre_mm))


def best_circle(theta_deg: Floats, radius_mm: Floats, near_mm: Floats | None = None) -> tuple[Floats, Floats, Floats]:
    """Return centres, shape (..., 2) [mm], radii, (...) [mm], and deviations, (..., n) [mm], of least-squares circles [CAL eq 6].

    Args:
        radius_mm: of one circle or of several, shape (..., n).
        near_mm: approximate centres, shape (..., 2), to save iterations.

    Raises:
        TraceError: the points do not determine a circle.
    """
    theta = np.radians(theta_deg)
    x, y = radius_mm * np.cos(theta), radius_mm * np.sin(theta)
    *several, count = radius_mm.shape
    columns = np.ones((*several, 3, count))
    centre = np.zeros((*several, 2)) if near_mm is None else near_mm.copy()
    radius = radius_mm.mean(axis=-1, keepdims=True)
    for _ in range(MOST_STEPS):
        across, along = x - centre[..., :1], y - centre[..., 1:]
        distance = np.sqrt(across * across + along * along)
        np.divide(across, distance, out=columns[..., 0, :])
        np.divide(along, distance, out=columns[..., 1, :])
        step = _step(columns, distance - radius)
        if step is None:
            break
        centre += step[..., :2]
        radius += step[..., 2:]
        if np.abs(step).max() < CENTRE_TOLERANCE_MM:
            return centre, radius[..., 0], np.hypot(x - centre[..., :1], y - centre[..., 1:]) - radius
    raise TraceError(
        "its points do not determine a circle",
        remedy="record more of the turn",
    )


def _step(columns: Floats, left: Floats) -> Floats | None:
    """Return least-squares solutions for a few columns, shape (..., k), or None."""
    # Normal equations suffice, because Gauss-Newton corrects rounding. Ill-conditioned short arcs are solved by
    # orthogonal decomposition.
    normal = columns @ columns.swapaxes(-1, -2)
    sizes = np.linalg.eigvalsh(normal)
    if np.all(sizes[..., -1] < WORST_CONDITION * sizes[..., 0]):
        return np.asarray(np.linalg.solve(normal, columns @ left[..., None])[..., 0])
    if left.ndim > 1:
        steps = [_step(*each) for each in zip(columns, left, strict=True)]
        return None if any(step is None for step in steps) else np.array(steps)
    step, _, rank, _ = np.linalg.lstsq(columns.T, left, rcond=1e-9)
    return np.asarray(step) if rank == len(columns) else None


WORST_CONDITION = 1e6
"""Largest condition number for normal equations: a whole turn has 2, a quarter some thousands."""


@dataclass(frozen=True, eq=False)
class BallPath:
    """A path about the fixed ball with its least-squares circle.

    Attributes:
        theta_deg: about the ball, from +X towards +Y, 0 to 360, shape (n,).
        centre_mm: from the ball, shape (2,).
        deviation_mm: radial, shape (n,).
    """

    theta_deg: Floats
    centre_mm: Floats
    radius_mm: float
    deviation_mm: Floats


def path_about_ball(theta_deg: Floats, radius_mm: Floats) -> BallPath:
    """Return a path's least-squares circle, with points at their angles about the fixed ball.

    Raises:
        TraceError: the points do not determine a circle.
    """
    about_ball_deg, centre, radius, deviation = _circles_about_ball(theta_deg, radius_mm)
    return BallPath(np.mod(about_ball_deg, 360.0), centre, float(radius), deviation)


def _circles_about_ball(theta_deg: Floats, radius_mm: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return angles about the fixed ball, shape (..., n) [deg], and `best_circle` at these angles."""
    # Commanded angles refer to the commanded centre. If the ball is off this centre by c, angles about the ball differ
    # by up to c/R. At commanded angles a perfect circle would show the second harmonic c²/(2R): 0.13 µm at 0.2 mm, 13
    # µm at 2 mm.
    theta = np.radians(theta_deg)
    about_ball_deg = theta_deg
    centre, radius, deviation = best_circle(theta_deg, radius_mm)
    for _ in range(MOST_STEPS):
        x, y = (
            centre[..., k, None] + radius[..., None] * along for k, along in enumerate((np.cos(theta), np.sin(theta)))
        )
        about_ball_deg = np.degrees(np.arctan2(y, x))
        last = centre
        centre, radius, deviation = best_circle(about_ball_deg, radius_mm, last)
        if np.abs(centre - last).max() < AGREED_MM:
            break
    return about_ball_deg, centre, radius, deviation


def horizontal_radius_mm(raw: RawCircle, length_mm: Floats) -> Floats:
    """Return the moving ball's distance from the vertical through the fixed ball [mm]."""
    height = raw.circle.bar_mm * np.sin(np.radians(raw.circle.elevation_deg))
    return np.sqrt(length_mm**2 - height**2)


def measured_path(raw: RawCircle) -> BallPath:
    """Return a raw circle's path about the ball, cached.

    Raises:
        TraceError: the points do not determine a circle.
    """
    if raw not in _PATHS:
        _PATHS[raw] = path_about_ball(raw.theta_deg, horizontal_radius_mm(raw, raw.length_mm))
    return _PATHS[raw]


_PATHS: WeakKeyDictionary[RawCircle, BallPath] = WeakKeyDictionary()
"""Cached paths of raw circles, shared by figures and analyses."""


def figures(raw: RawCircle, length_mm: Floats | None = None) -> CircleFigures:
    """Return figures of a raw circle, cached, or of given lengths, shape (n,) [mm], at the circle's angles.

    Raises:
        TraceError: the points do not determine a circle.
    """
    if length_mm is not None and length_mm is not raw.length_mm:
        return figures_of(raw, length_mm[None])[0]
    if raw not in _MEASURED:
        # Figures alone do not cache the path, which needs two numbers per sample.
        path = _PATHS.get(raw) or path_about_ball(raw.theta_deg, horizontal_radius_mm(raw, raw.length_mm))
        _MEASURED[raw] = _figures(raw, raw.length_mm, path.centre_mm, path.deviation_mm)
    return _MEASURED[raw]


def figures_of(raw: RawCircle, lengths_mm: Floats) -> list[CircleFigures]:
    """Return figures of several lengths, shape (k, n) [mm], at a circle's angles.

    Raises:
        TraceError: the points of one do not determine a circle.
    """
    _, centres, _, deviations = _circles_about_ball(raw.theta_deg, horizontal_radius_mm(raw, lengths_mm))
    return [_figures(raw, *each) for each in zip(lengths_mm, centres, deviations, strict=True)]


_MEASURED: WeakKeyDictionary[RawCircle, CircleFigures] = WeakKeyDictionary()
"""Cached figures of measured raw circles, shared by checks, fits and reports."""


def _figures(raw: RawCircle, length_mm: Floats, centre_mm: Floats, deviation_mm: Floats) -> CircleFigures:
    return CircleFigures(
        centre_mm=(float(centre_mm[0]), float(centre_mm[1])),
        mean_radial_error_um=1e3 * float((length_mm - raw.circle.bar_mm).mean()),
        circularity_um=1e3 * float(np.ptp(deviation_mm)),
    )


def centred(raw: RawCircle) -> CentredCircle:
    """Remove the best-fit centre [CAL III-A step 4] at commanded angles [CAL eq 6].

    Raises:
        TraceError: the points do not determine a circle.
    """
    _, radius, deviation = best_circle(raw.theta_deg, horizontal_radius_mm(raw, raw.length_mm))
    return CentredCircle(raw.name, raw.circle, raw.theta_deg, deviation, float(radius))


MARGIN_DEG = 5.0
"""Ignored arc after the feed-in and before the feed-out [deg]. The machine accelerates there, and corner dwells of 0.3
s make the overlap's start uncertain by 2 degrees at the usual feed."""

FEWEST_SAMPLES = 20
"""Fewest samples of a usable overlap."""


@dataclass(frozen=True, eq=False)
class Passes:
    """Readings of the second pass less the first."""

    phi_deg: Floats
    apart_um: Floats
    turn_s: float

    @property
    def mean_um(self) -> float:
        """Return the reading's growth after one turn [µm]."""
        return float(self.apart_um.mean())

    def u_mean_um(self, sigma_um: float) -> float:
        """Return the standard uncertainty of `mean_um` for noise `sigma_um` per sample [µm]."""
        return sigma_um * float(np.sqrt(2.0 / len(self.apart_um)))


def passes_of(recording: Recording, circle: Circle) -> Passes | None:
    """Return the difference of both passes; None for a recording already cut or too short an overlap.

    Raises:
        TraceError: feed-in or feed-out is missing.
    """
    if recording.theta_deg is not None or circle.overshoot_deg <= MARGIN_DEG:
        return None
    phi = progress_deg(recording, circle, edges_of(recording, circle))
    usable = np.ones(len(phi), dtype=bool) if recording.usable is None else recording.usable
    reach = circle.overshoot_deg - MARGIN_DEG
    first = usable & (np.abs(phi) <= reach)
    second = usable & (np.abs(phi - FULL_TURN_DEG) <= reach + MARGIN_DEG)
    if min(np.count_nonzero(first), np.count_nonzero(second)) < FEWEST_SAMPLES:
        return None
    again = np.interp(phi[first] + FULL_TURN_DEG, phi[second], recording.length_mm[second])
    return Passes(phi[first], 1e3 * (again - recording.length_mm[first]), FULL_TURN_DEG / circle.turning_deg_s)
