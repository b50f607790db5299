"""Figures of one circle: centre, mean radial error, circularity [CAL III-A, Table III]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.trace.circle import CentredCircle, RawCircle

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_STEPS = 20
CENTRE_TOLERANCE_MM = 1e-12

AGREED_MM = 1e-9
"""Change of the centre below which angles about the ball are settled: a thousandth of what bars resolve [mm]."""


@dataclass(frozen=True)
class CircleFigures:
    """What a circular test says in three numbers [CAL Table III].

    Attributes:
        centre_mm: centre of the least-squares circle from the fixed ball, in X and Y [mm].
        mean_radial_error_um: mean of bar length minus nominal bar length, about the commanded centre [µm].
        circularity_um: greatest minus least radial deviation after least-squares centring [µm].
    """

    centre_mm: tuple[float, float]
    mean_radial_error_um: float
    circularity_um: float

    @property
    def centre_deviation_um(self) -> float:
        """Length of the centre offset [µm]."""
        return 1e3 * float(np.hypot(*self.centre_mm))


def best_circle(
    theta_deg: NDArray[np.float64], radius_mm: NDArray[np.float64], near_mm: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """Least-squares circle through points given in polar coordinates [CAL eq 6], by Gauss-Newton.

    Args:
        theta_deg: angles, shape (n,) [deg].
        radius_mm: distances from the origin, shape (n,) [mm].
        near_mm: where the centre is about, shape (2,) [mm]; the origin if None. A near one saves steps.

    Returns:
        Centre (x, y), shape (2,) [mm]; radius [mm]; radial deviations of the points, shape (n,) [mm].

    Raises:
        TraceError: the points do not determine a circle.
    """
    theta = np.radians(theta_deg)
    x, y = radius_mm * np.cos(theta), radius_mm * np.sin(theta)
    columns = np.ones((3, len(theta)))
    centre, radius = np.zeros(2) if near_mm is None else near_mm.copy(), float(radius_mm.mean())
    for _ in range(MOST_STEPS):
        across, along = x - centre[0], y - centre[1]
        distance = np.sqrt(across * across + along * along)
        np.divide(across, distance, out=columns[0])
        np.divide(along, distance, out=columns[1])
        step = _step(columns, distance - radius)
        if step is None:
            break
        centre += step[:2]
        radius += step[2]
        if np.abs(step).max() < CENTRE_TOLERANCE_MM:
            return centre, radius, np.hypot(x - centre[0], y - centre[1]) - radius
    raise TraceError(
        "its points do not determine a circle",
        remedy="record more of the turn",
    )


def _step(columns: NDArray[np.float64], left: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the least-squares solution of few columns, shape (k,); None where they do not determine one.

    By normal equations, a tenth of the work of an orthogonal solution: what rounding leaves the next step of Gauss-Newton takes
    out. Columns of a small part of the turn are too much alike for that and are solved orthogonally.

    Args:
        columns: shape (k, n).
        left: shape (n,).
    """
    normal = columns @ columns.T
    least, *_, most = np.linalg.eigvalsh(normal)
    if most < WORST_CONDITION * least:
        return np.asarray(np.linalg.solve(normal, columns @ left))
    step, _, rank, _ = np.linalg.lstsq(columns.T, left, rcond=1e-9)
    return np.asarray(step) if rank == len(columns) else None


WORST_CONDITION = 1e6
"""Condition of normal equations up to which they are taken: a whole turn has 2, a quarter of one some thousands."""


@dataclass(frozen=True, eq=False)
class BallPath:
    """A path as seen from the fixed ball, and its least-squares circle.

    Attributes:
        theta_deg: angles about the ball, from +X towards +Y, within 0 to 360, shape (n,) [deg].
        centre_mm: of the circle, from the ball, shape (2,) [mm].
        deviation_mm: radial deviations of the points from the circle, shape (n,) [mm].
    """

    theta_deg: NDArray[np.float64]
    centre_mm: NDArray[np.float64]
    radius_mm: float
    deviation_mm: NDArray[np.float64]


def path_about_ball(theta_deg: NDArray[np.float64], radius_mm: NDArray[np.float64]) -> BallPath:
    """Least-squares circle of a path, with each point at its angle about the fixed ball.

    A recording has commanded angles, which count about the commanded centre. Seen from a ball that stands c beside it a
    point is turned by about c/R. Taken at its commanded angle, a perfect circle would have the second harmonic c²/(2R):
    0.13 µm at 0.2 mm, 13 µm at 2 mm.

    Args:
        theta_deg: commanded angles, shape (n,) [deg].
        radius_mm: distances from the fixed ball in the plane of the circle, shape (n,) [mm].

    Raises:
        TraceError: the points do not determine a circle.
    """
    theta = np.radians(theta_deg)
    about_ball_deg = theta_deg
    centre, radius, deviation = best_circle(theta_deg, radius_mm)
    for _ in range(MOST_STEPS):
        about_ball_deg = np.degrees(np.arctan2(centre[1] + radius * np.sin(theta), centre[0] + radius * np.cos(theta)))
        last = centre
        centre, radius, deviation = best_circle(about_ball_deg, radius_mm, last)
        if np.abs(centre - last).max() < AGREED_MM:
            break
    return BallPath(np.mod(about_ball_deg, 360.0), centre, radius, deviation)


def horizontal_radius_mm(raw: RawCircle, length_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of the moving ball from the vertical through the fixed ball, where the bar is raised [mm]."""
    height = raw.circle.bar_mm * np.sin(np.radians(raw.circle.elevation_deg))
    return np.sqrt(length_mm**2 - height**2)


def measured_path(raw: RawCircle) -> BallPath:
    """Path of a raw circle as measured, about the ball; worked out once.

    Raises:
        TraceError: the points do not determine a circle.
    """
    if raw not in _PATHS:
        _PATHS[raw] = path_about_ball(raw.theta_deg, horizontal_radius_mm(raw, raw.length_mm))
    return _PATHS[raw]


_PATHS: WeakKeyDictionary[RawCircle, BallPath] = WeakKeyDictionary()
"""Paths of raw circles, which figures and analyses ask for."""


def figures(raw: RawCircle, length_mm: NDArray[np.float64] | None = None) -> CircleFigures:
    """Figures of a raw circle, worked out once, or of other lengths at the same angles, shape (n,) [mm].

    Raises:
        TraceError: the points do not determine a circle.
    """
    if length_mm is not None:
        return _figures(raw, length_mm)
    if raw not in _MEASURED:
        _MEASURED[raw] = _figures(raw, raw.length_mm)
    return _MEASURED[raw]


_MEASURED: WeakKeyDictionary[RawCircle, CircleFigures] = WeakKeyDictionary()
"""Figures of raw circles as measured, which checks, fits and reports all ask for."""


def _figures(raw: RawCircle, length_mm: NDArray[np.float64]) -> CircleFigures:
    # A path is two numbers a sample: who asks for figures only does not leave it in the memory.
    path = _PATHS.get(raw) if length_mm is raw.length_mm else None
    if path is None:
        path = path_about_ball(raw.theta_deg, horizontal_radius_mm(raw, length_mm))
    return CircleFigures(
        centre_mm=(float(path.centre_mm[0]), float(path.centre_mm[1])),
        mean_radial_error_um=1e3 * float((length_mm - raw.circle.bar_mm).mean()),
        circularity_um=1e3 * float(np.ptp(path.deviation_mm)),
    )


def centred(raw: RawCircle) -> CentredCircle:
    """Remove the centre, as the standard circular test does [CAL III-A step 4], at commanded angles [CAL eq 6].

    Raises:
        TraceError: the points do not determine a circle.
    """
    _, radius, deviation = best_circle(raw.theta_deg, horizontal_radius_mm(raw, raw.length_mm))
    return CentredCircle(raw.name, raw.circle, raw.theta_deg, deviation, radius)
