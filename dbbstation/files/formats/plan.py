"""`dbb-plan/1`: the circles to measure, and their balls."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from dbbstation.errors import Problem
from dbbstation.facts import of_facts
from dbbstation.facts.quantities import BarMm, Quantity, Text, sound, twice
from dbbstation.files.formats.jig import (
    BY_CMM,
    UNDER_SPINDLE,
    BallSchema,
    HolderSchema,
    JigFile,
    JigSchema,
    check_balls,
    parse_jig,
)
from dbbstation.files.places import is_device
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Partly, Schema, dotted, read_document, validate
from dbbstation.files.yaml.text import YamlDocument
from dbbstation.plan.plan import LARGEST_LOSS_PERCENT, Ball, Circle, Direction, Plan, PlannedTest, Plate

NO_PLATE = JigSchema(bores={}, origin_in_machine_mm=(0.0, 0.0, 0.0))
"""Plate of a plan with all balls under the spindle: positions are in the machine frame."""

_RADIANS_BELOW_DEG = 0.6
"""Greatest tilt below which a plan seems to be in radians [deg]: 0.6 rad is 34 deg."""


_Tilt = Annotated[float, Quantity("deg", 0, 180, signed=True)]


class PathSchema(Schema):
    """Path of every circle."""

    radius_mm: BarMm
    """Length of the bar R, distance between the ball centres [mm]."""
    feed_mm_min: Annotated[float, Quantity("mm/min", 20, 100_000)]
    """Speed of the tool tip along its path [mm/min]."""
    start_deg: Annotated[float, Quantity("deg", 0, 720, signed=True)] = 0.0
    """Angle where the full turn starts, from +X towards +Y positive [deg]."""
    overshoot_deg: Annotated[float, Quantity("deg", 1, 360, or_zero=True)] = 0.0
    """Arc travelled before and after the full turn [deg]."""
    feed_in_mm: Annotated[float, Quantity("mm", 0.01, 50, or_zero=True)] = 0.0
    """Distance of the feed-in's start outside the circle, along the bar [mm]."""
    directions: Annotated[
        tuple[Literal["ccw", "cw"], ...],
        Field(min_length=1),
        sound(lambda names: "a direction stands here twice" if twice(names) else ""),
    ] = ("ccw", "cw")
    """Senses of travel in the order they are run."""


class TestSchema(Schema):
    """One test: a circle about a ball."""

    __test__ = False  # pytest takes the name for one of its own

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
    """Unique in the plan; part of file names."""
    ball: str
    """Ball that the bar turns about."""
    a_deg: _Tilt = 0.0
    """Tool tilt A about X, held over the circle [deg]."""
    b_deg: _Tilt = 0.0
    """Tool tilt B about Y, held over the circle [deg]."""
    c_deg: _Tilt = 0.0
    """Turn C about Z, held over the circle [deg]."""
    elevation_deg: Annotated[float, Quantity("deg", 0.6, 80, or_zero=True, signed=True)] = 0.0
    """Angle of the bar above the horizontal, moving ball higher positive [deg]: the tool tip's circle then has the
    radius R cos e and lies R sin e above the ball."""
    path: Annotated[Any, Partly(PathSchema)] = None
    """Parts of the path in which this test differs from the plan."""


class PlanFile(Schema):
    """Circles to be measured: jig, holders, balls and tests."""

    format: Literal["dbb-plan/1"]
    """Name and version of this format."""
    name: Text
    """Name of the plan."""
    path: PathSchema
    """How the circles are travelled."""
    jig: (
        Annotated[
            Annotated[JigSchema, Tag("inline")] | Annotated[str, Tag("path")],
            Discriminator(lambda jig: "path" if isinstance(jig, str) else "inline"),
        ]
        | None
    ) = None
    """The plate, or the path of a `dbb-jig/1` file with plate, holders and balls, from this file's folder. Absent if
    every ball is put up under the spindle: positions are then in the machine frame."""
    holders: dict[str, HolderSchema] = Field(default_factory=dict)
    """Holders by name."""
    balls: dict[str, BallSchema] = Field(default_factory=dict)
    """Balls by name, one per bore and holder used."""
    tests: Annotated[tuple[TestSchema, ...], Field(min_length=1)]
    """Tests in the order they are run."""
    repeat_at_end: tuple[str, ...] = ()
    """Tests that are repeated at the end, to separate drift and height."""
    largest_loss_percent: Annotated[float, Quantity("%", 0.001, 100, or_zero=True)] | None = None
    """Largest share of lost samples; a run that lost more is repeated [%]. Absent: 0.5."""

    @property
    def plate(self) -> JigSchema:
        """Return the jig of a plan that has it inline; without bores if the plan has no plate."""
        return self.jig if isinstance(self.jig, JigSchema) else NO_PLATE

    def to_domain(self) -> Plan:
        """Return a plan with its jig inline for calculations: balls in the machine frame, every circle complete."""
        balls = {name: self._ball(name, ball) for name, ball in self.balls.items()}
        tests = {test.name: _planned(test, balls[test.ball], self.path) for test in self.tests}
        limit = self.largest_loss_percent
        largest = LARGEST_LOSS_PERCENT if limit is None else limit
        return Plan(self.name, tests, self.repeat_at_end, largest)

    def _ball(self, name: str, ball: BallSchema) -> Ball:
        x, y, z = ball.centre_mm
        origin = self.plate.origin_in_machine_mm
        turn = math.radians(self.plate.rotation_about_z_deg)
        centre = (
            origin[0] + x * math.cos(turn) - y * math.sin(turn),
            origin[1] + x * math.sin(turn) + y * math.cos(turn),
            origin[2] + z,
        )
        if ball.holder is None or ball.uncertainty_um is None:
            # Only a ball under the spindle comes without them. How well it stands is for a micrometer to say.
            return Ball(name, None, "", centre, 0.0, 0.0, place_known=False, form_um=ball.form_um)
        repeatability = self.holders[ball.holder].repeatability_um / 1e3
        plate = None if ball.bore is None else Plate(origin, self.plate.plate_expansion_um_m_k)
        u_mm = ball.uncertainty_um / 1e3
        return Ball(name, ball.bore, ball.holder, centre, u_mm, repeatability, plate=plate, form_um=ball.form_um)


def plan_text(plan: PlanFile) -> str:
    """Return the text of a plan's file, with the jig inline."""
    return yaml_text(plan_data(plan))


def plan_data(plan: PlanFile) -> dict[str, object]:
    """Return the content of a plan's file, with the jig inline."""
    data = plan.model_dump(exclude_none=True)
    for ball in data["balls"].values():
        if ball["placed"] != UNDER_SPINDLE:
            del ball["placed"]  # the usual case goes without saying
    return data


def _planned(test: TestSchema, ball: Ball, general: PathSchema) -> PlannedTest:
    override = {} if test.path is None else test.path.model_dump(exclude_none=True)
    path = general.model_copy(update=override)
    directions = tuple(Direction(direction) for direction in path.directions)
    x, y, z = ball.centre_mm
    circle = of_facts(
        Circle,
        path,
        test,
        ball_mm=ball.centre_mm,
        centre_mm=(x, y, z + path.radius_mm * math.sin(math.radians(test.elevation_deg))),
        bar_mm=path.radius_mm,
        tilt_deg=(test.a_deg, test.b_deg, test.c_deg),
        direction=directions[0],
    )
    return PlannedTest(test.name, ball, circle, directions)


def read_plan(path: Path) -> Plan:
    """Read a test plan and its jig file.

    Raises:
        InputError: every fault of both with its place.
    """
    return read_inline_plan(path).to_domain()


def read_inline_plan(path: Path) -> PlanFile:
    """Read a test plan and put its jig file into it.

    Raises:
        InputError: every fault of both with its place.
    """
    return without_faults(parse_plan, path)


def parse_plan(path: Path, faults: list[Problem]) -> PlanFile | None:
    """Read a test plan; None with faults added to `faults`."""
    document = read_document(path, PlanFile, faults)
    if document is None:
        return None
    before = len(faults)
    plan = validate(document, PlanFile)
    named = document.data.get("jig")
    jig_file = parse_jig(path.parent / named, faults) if isinstance(named, str) else None
    holders, balls = _merged(document, jig_file)
    check_balls(document, jig_file.model_dump()["jig"] if jig_file else named, holders)
    if named is None and any(ball.get("placed", BY_CMM) == BY_CMM for _, ball in document.entries("balls")):
        remedy = "add it; only a plan that puts all its balls up under the spindle needs none"
        document.fault((), "the key `jig` is missing", remedy)
    if jig_file is not None or not isinstance(named, str):
        _check_tests(document, balls)
        _check_under_spindle(document, jig_file)
    if plan is None or len(faults) > before:
        return None
    if jig_file is None:
        return None if isinstance(plan.jig, str) else plan
    whole = {"jig": jig_file.jig, "holders": jig_file.holders | plan.holders, "balls": jig_file.balls | plan.balls}
    return plan.model_copy(update=whole)


def _merged(document: YamlDocument, jig: JigFile | None) -> tuple[set[str], set[str]]:
    merged = []
    for kind in ("holders", "balls"):
        there = document.data.get(kind)
        own = set(there) if isinstance(there, dict) else set()
        shared = set() if jig is None else set(getattr(jig, kind))
        for name in sorted(own & shared):
            what = f"{kind}: `{name}` stands in the jig file as well"
            document.fault((kind, name), what, "remove one", at_key=True)
        merged.append(own | shared)
    return merged[0], merged[1]


def _check_tests(document: YamlDocument, balls: set[str]) -> None:
    """Check tests and their balls in the raw data, independently of other faults."""
    tests = document.entries("tests")
    names = [test.get("name") for _, test in tests]
    for index in twice(names):
        location = (*tests[index][0], "name")
        document.fault(location, f"the test name `{names[index]}` stands here a second time", "rename")
    _check_file_names(document, names)
    for location, test in tests:
        ball = test.get("ball")
        if isinstance(ball, str) and ball not in balls:
            what = f"{dotted(location)}: the ball `{ball}` is not in `balls`"
            document.fault((*location, "ball"), what, f"known: {', '.join(sorted(map(str, balls))) or 'none'}")
    repeats = document.data.get("repeat_at_end")
    for index, name in enumerate(repeats if isinstance(repeats, tuple) else ()):
        if name not in names:
            what = f"repeat_at_end: there is no test `{name}`"
            document.fault(("repeat_at_end", index), what, "name tests of this plan")
    _check_tilt_unit(document)


def _check_file_names(document: YamlDocument, names: list[Any]) -> None:
    """Refuse test names that are no distinct file names on Windows, since runs and programs use them."""
    seen: dict[str, str] = {}
    for (location, _), name in zip(document.entries("tests"), names, strict=True):
        if not isinstance(name, str):
            continue
        other = seen.setdefault(name.lower(), name)
        if other != name:
            what = f"the test names `{other}` and `{name}` differ in case alone: Windows takes their files for one"
            document.fault((*location, "name"), what, "rename one")
        if is_device(name):
            what = f"the test name `{name}` is a device on Windows, no file can be called so"
            document.fault((*location, "name"), what, "rename")


def _check_under_spindle(document: YamlDocument, jig: JigFile | None) -> None:
    """Refuse a ball that is set up under the spindle at one tilt and measured at another.

    A micrometer reading at the spindle is valid for one tilt.
    """
    balls = document.entries("balls")
    under = {location[-1] for location, ball in balls if ball.get("placed") == UNDER_SPINDLE}
    under |= set() if jig is None else {name for name, ball in jig.balls.items() if ball.placed == UNDER_SPINDLE}
    first: dict[Any, tuple[tuple[Any, ...], Any]] = {}
    for location, test in document.entries("tests"):
        ball, tilt = test.get("ball"), tuple(test.get(key, 0) for key in ("a_deg", "b_deg", "c_deg"))
        if not isinstance(ball, str) or ball not in under:
            continue
        tilt_then, name_then = first.setdefault(ball, (tilt, test.get("name")))
        if tilt != tilt_then:
            what = (
                f"{dotted(location)}: the ball `{ball}` is put up under the spindle at the tilt of test `{name_then}`"
            )
            document.fault((*location, "ball"), what, "give each tilt a ball of its own")


def _check_tilt_unit(document: YamlDocument) -> None:
    tilts = [
        ((*location, key), test[key])
        for location, test in document.entries("tests")
        for key in ("a_deg", "b_deg", "c_deg")
        if isinstance(test.get(key), int | float) and test[key] != 0
    ]
    if tilts and max(abs(tilt) for _, tilt in tilts) < _RADIANS_BELOW_DEG:
        location, tilt = tilts[0]
        what = f"{dotted(location)}: {tilt:g} deg, and no tilt of the plan is greater than {_RADIANS_BELOW_DEG:g} deg"
        document.fault(location, f"{what} (it looks like rad)", "give tilts in degrees")
