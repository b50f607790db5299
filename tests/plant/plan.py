"""Test plans: where circles are measured, with which balls, in which order.

Balls stand in the bores of the jig plate of [CAL Fig 5] on holders of three heights, or free. The bore numbers follow
from the tilts of [CAL Table II], taken so that the tool always points towards the middle of the machine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.plant.arrays import FloatArray

Direction: TypeAlias = Literal["ccw", "cw"]

BORE_SPACING_MM = 100.0
BORES: dict[int, tuple[float, float]] = {
    1: (0, BORE_SPACING_MM),
    2: (-BORE_SPACING_MM, BORE_SPACING_MM),
    3: (-BORE_SPACING_MM, 0),
    4: (-BORE_SPACING_MM, -BORE_SPACING_MM),
    5: (0, -BORE_SPACING_MM),
    6: (BORE_SPACING_MM, -BORE_SPACING_MM),
    7: (BORE_SPACING_MM, 0),
    8: (BORE_SPACING_MM, BORE_SPACING_MM),
    9: (0, 0),
}
HOLDER_HEIGHT_MM = {"short": 0.0, "long": 142.0, "long-on-riser": 280.0}
"""Height of the ball above the jig's origin: levels 1 to 3 of [CAL Table II] are z = -1150, -1008 and -870 mm."""
HOLDER_REPEATABILITY_UM = {"short": 0.58, "long": 1.85, "long-on-riser": 1.85, "custom": 0.0}
"""One standard deviation per axis; the shift in space is then 1.0 and 3.2 µm as in [CAL III-B]."""
TABLE_II: tuple[tuple[str, int, str, float, float], ...] = (
    ("a", 9, "short", 0, 0),
    ("b", 4, "short", 10, -10),
    ("c", 6, "short", 10, 10),
    ("d", 8, "short", -10, 10),
    ("e", 2, "short", -10, -10),
    ("f", 9, "long", 0, 0),
    ("g", 3, "long", 0, -15),
    ("h", 5, "long", 15, 0),
    ("i", 7, "long", 0, 15),
    ("j", 1, "long", -15, 0),
    ("k", 9, "long-on-riser", 0, 0),
    ("l", 4, "long-on-riser", 10, -10),
    ("m", 6, "long-on-riser", 10, 10),
    ("n", 8, "long-on-riser", -10, 10),
    ("o", 2, "long-on-riser", -10, -10),
)
GRAVITY_CONDITIONS: tuple[tuple[str, tuple[float, float], float, float], ...] = (
    ("A", (0, 100), -23, 0),
    ("B", (100, 0), 0, 23),
    ("C", (-70, -70), 17, -17),
    ("D", (0, 100), -25, 0),
    ("E", (0, 100), -20, 0),
    ("F", (0, 100), -10, 0),
    ("G", (0, 100), 0, 0),
    ("H", (0, 100), 10, 0),
    ("I", (0, 100), 23, 0),
)
"""Name, circle centre X, Y [mm] at Z = -1008, tilts A, B [deg] [GRAV Table 4]."""


@dataclass(frozen=True)
class Path:
    """How a circle is driven. `radius_mm` is the length of the bar."""

    radius_mm: float = 150.0
    feed_mm_min: float = 1000.0
    start_deg: float = 0.0
    overshoot_deg: float = 45.0
    feed_in_mm: float = 1.5
    directions: tuple[Direction, ...] = ("ccw", "cw")


@dataclass(frozen=True)
class Ball:
    """A ball on a holder, as the CMM sheet has it: centre in the jig frame [mm]; `bore` is None for a free ball."""

    name: str
    bore: int | None
    holder: str
    centre_mm: tuple[float, float, float]
    uncertainty_um: float = 0.5


@dataclass(frozen=True)
class Test:
    """One circle: its ball, the tilt of the platform and the elevation of the bar [deg]."""

    __test__ = False  # not one of pytest's

    name: str
    ball: str
    a_deg: float = 0.0
    b_deg: float = 0.0
    elevation_deg: float = 0.0
    path: Path | None = None


@dataclass(frozen=True)
class Plan:
    """Jig, balls and tests in the order of measurement."""

    tests: tuple[Test, ...]
    balls: tuple[Ball, ...]
    path: Path = Path()
    name: str = "circles on the jig plate"
    origin_in_machine_mm: tuple[float, float, float] = (0.0, 0.0, -1150.0)
    rotation_about_z_deg: float = 0.0
    repeat_at_end: tuple[str, ...] = ()

    def test(self, name: str) -> Test:
        return next(test for test in self.tests if test.name == name)

    def ball(self, name: str) -> Ball:
        return next(ball for ball in self.balls if ball.name == name)

    def path_of(self, test: Test) -> Path:
        return test.path or self.path

    def in_machine_mm(self, jig_mm: FloatArray) -> FloatArray:
        """Points `(..., 3)` of the jig frame in machine coordinates."""
        return jig_mm @ self.jig_rotation.T + np.array(self.origin_in_machine_mm)

    @property
    def jig_rotation(self) -> FloatArray:
        """`(3, 3)`, jig axes to machine axes."""
        angle_rad = np.radians(self.rotation_about_z_deg)
        c, s = np.cos(angle_rad), np.sin(angle_rad)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def table_ii_plan(seed: int = 0, path: Path | None = None, scatter_mm: float = 0.02) -> Plan:
    """The fifteen circles of [CAL Table II]; balls stand a few hundredths off their nominal places, as in any shop."""
    rng = np.random.default_rng([seed, 9])
    balls = tuple(
        _ball_in_bore(bore, holder, scatter_mm * rng.standard_normal(3)) for _, bore, holder, _, _ in TABLE_II
    )
    tests = tuple(
        Test(name, ball.name, a_deg, b_deg) for (name, _, _, a_deg, b_deg), ball in zip(TABLE_II, balls, strict=True)
    )
    return Plan(tests, balls, path or Path())


def gravity_plan(
    seed: int = 0, conditions: str = "ABCDEFGHI", path: Path | None = None, scatter_mm: float = 0.02
) -> Plan:
    """The circles of [GRAV Table 4] with a bar of 144 mm, on balls that stand free on the table."""
    rng = np.random.default_rng([seed, 8])
    balls: dict[tuple[float, float], Ball] = {}
    tests = []
    for name, centre_mm, a_deg, b_deg in GRAVITY_CONDITIONS:
        if name not in conditions:
            continue
        if centre_mm not in balls:
            nominal_mm = np.array([*centre_mm, HOLDER_HEIGHT_MM["long"]])
            balls[centre_mm] = free_ball(f"free-{len(balls) + 1}", nominal_mm + scatter_mm * rng.standard_normal(3))
        tests.append(Test(name, balls[centre_mm].name, a_deg, b_deg))
    return Plan(tuple(tests), tuple(balls.values()), path or Path(radius_mm=144.0), name="gravity conditions")


ALL = "abcdefghijklmno"
EIGHT = "abdfhjkn"
"""Of the fifteen of [CAL Table II]: all three heights, tilted and level."""


def subset(plan: Plan, names: Sequence[str]) -> Plan:
    tests = tuple(plan.test(name) for name in names)
    used = {test.ball for test in tests}
    return replace(plan, tests=tests, balls=tuple(ball for ball in plan.balls if ball.name in used))


def elevated(plan: Plan, elevation_deg: float, names: Sequence[str]) -> Plan:
    return replace(
        plan,
        tests=tuple(replace(test, elevation_deg=elevation_deg) if test.name in names else test for test in plan.tests),
    )


def free_ball(name: str, centre_mm: FloatArray | Sequence[float], uncertainty_um: float = 0.5) -> Ball:
    """A ball that stands in no bore; coordinates [mm] as a CMM sheet prints them."""
    x_mm, y_mm, z_mm = (round(float(value), 4) for value in centre_mm)
    return Ball(name, None, "custom", (x_mm, y_mm, z_mm), uncertainty_um)


def with_test(plan: Plan, test: Test, ball: Ball | None = None) -> Plan:
    return replace(plan, tests=(*plan.tests, test), balls=plan.balls if ball is None else (*plan.balls, ball))


def _ball_in_bore(bore: int, holder: str, scatter_mm: FloatArray) -> Ball:
    nominal_mm = np.array([*BORES[bore], HOLDER_HEIGHT_MM[holder]])
    x_mm, y_mm, z_mm = (round(float(value), 4) for value in nominal_mm + scatter_mm)
    return Ball(f"{bore}-{holder}", bore, holder, (x_mm, y_mm, z_mm))
