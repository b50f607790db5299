"""Sound and sabotaged circles over a serial line, as an operator without a screen meets them.

    python -m tests.station.sabotages --kept FILE [--sound 200] [--seeds 5] [--out docs/validation/operator.json]

`--direct` hands the readings to the station without the line, which takes a tenth of the time. Each session is that of the ten-minute check on a virtual machine of its own, read by the driver through the line of
`emulate`. The operator accepts what is not REPEAT, and repeats the rest once. FILE keeps each session; a run that was
interrupted goes on there.
"""

from __future__ import annotations

import argparse
import collections
import json
import sys
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import ReadBy, SessionDetails
from dbbstation.files.places import shipped_folder
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import at_rate, load_instrument
from dbbstation.instrument.reading import Reading
from dbbstation.instrument.stamps import MachineTime
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Direction
from dbbstation.quality.answer import Advice, rank
from dbbstation.quality.finding import Name
from dbbstation.service.held_line import driver_patience
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.station import events
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Accept, Quit, Repeat, Start
from dbbstation.station.states import RECORDING, State
from dbbstation.virtual.cell import VirtualCell
from dbbstation.virtual.machine import VirtualMachine, VirtualRun, circle_path
from dbbstation.virtual.truth import random_kinematics
from dbbstation.virtual.wire_clock import WaitingClock
from studies.kept_draws import drawn
from tests.station.bench import MACHINE_FILE
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.plan.plan import Circle
    from dbbstation.quality.finding import Finding
    from dbbstation.station.assembly import Workplace
    from dbbstation.station.engine import ReadingSource
    from dbbstation.virtual.machine import CommandedPath

PLAN_FILE = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
FEEDS_MM_MIN = (1000.0, 6000.0)
RATE_HZ = 40.0
"""Readings a second, as the tests of the station take them."""

MACHINES = 8
CCW, CW = Direction.CCW, Direction.CW
POSITIONS = {"first circle": ("low", CCW, 1), "second direction": ("low", CW, 1), "last": ("high", CW, 1)}
AGAIN = ("low", CW, 2)
"""The circle that the plan repeats at its end, for `repeat`."""

SIDE_MM, RADIUS_MM, START_DEG, STEP_MM, LOST_S, OVERRIDE = 0.5, 0.5, 10.0, 0.02, 1.0, 5.0 / 6.0


class SabotagedMachine(VirtualMachine):
    """A virtual machine whose next run is changed by `spoil`."""

    spoil: Callable[[VirtualRun], VirtualRun] | None = None

    def run(self, *args: Any, **more: Any) -> VirtualRun:
        run = super().run(*args, **more)
        spoil, self.spoil = self.spoil, None
        return run if spoil is None else spoil(run)


@dataclass(frozen=True)
class Sabotage:
    """What goes wrong with one circle.

    Attributes:
        right: findings that name it.
        start: starts the spoilt circle in the machine's place.
    """

    right: frozenset[Name]
    start: Callable[[Shop, str, Direction], None]


def _other_test(shop: Shop, test: str, direction: Direction) -> None:
    shop.cell.start("high" if test == "low" else "side", direction)


def _other_way(shop: Shop, test: str, direction: Direction) -> None:
    shop.cell.start(test, CW if direction is CCW else CCW)


def _beside(shop: Shop, test: str, direction: Direction) -> None:
    shop.virtual.spoil = lambda run: _shifted(run, np.full(len(run.length_mm), SIDE_MM))
    shop.cell.start(test, direction)


def _loose(shop: Shop, test: str, direction: Direction) -> None:
    shop.virtual.spoil = lambda run: _shifted(run, STEP_MM * (run.path.t_s > 0.45 * run.path.duration_s))
    shop.cell.start(test, direction)


def _moved(shop: Shop, test: str, direction: Direction) -> None:
    shop.virtual.spoil = lambda run: _shifted(run, np.full(len(run.length_mm), 2.5 * STEP_MM))
    shop.cell.start(test, direction)


def _shifted(run: VirtualRun, x_mm: np.ndarray) -> VirtualRun:
    """Return a run whose ball stands beside its place along X."""
    centre = run.path.poses[:, :2].mean(axis=0)
    theta = np.arctan2(run.path.poses[:, 1] - centre[1], run.path.poses[:, 0] - centre[0])
    return replace(run, length_mm=run.length_mm - x_mm * np.cos(theta))


def _changed(**more: float) -> Callable[[Shop, str, Direction], None]:
    def start(shop: Shop, test: str, direction: Direction) -> None:
        circle = shop.circle(test, direction)
        changed = {
            name: more[name] * value if name == "feed_mm_min" else value + more[name]
            for name, value in ((name, getattr(circle, name)) for name in more)
        }
        shop.cell.start(test, direction, circle_path(replace(circle, **changed)))

    return start


def _late(shop: Shop, test: str, direction: Direction) -> None:
    """Start the machine; the operator presses Enter behind the feed-in."""
    shop.late = True
    shop.cell.start(test, direction)


def _cable(shop: Shop, test: str, direction: Direction) -> None:
    shop.cut_at_s = 0.5 * circle_path(shop.circle(test, direction)).duration_s
    shop.cell.start(test, direction)


NAMED = {Name.FEED: "feed of", Name.LOST: "were lost", Name.CIRCLE: ":"}
"""What the reason of a recording without a circle names."""

PLACED = frozenset({Name.BORE, Name.OTHER_DIRECTION, Name.REPEAT, Name.TEST, Name.FORM})
SABOTAGES = {
    "ball": Sabotage(PLACED, _beside),
    "test": Sabotage(frozenset({Name.TEST, Name.OTHER_DIRECTION, Name.REPEAT, Name.BORE, Name.FORM}), _other_test),
    "feed": Sabotage(frozenset({Name.FEED}), _changed(feed_mm_min=OVERRIDE)),
    "direction": Sabotage(frozenset({Name.DIRECTION}), _other_way),
    "start": Sabotage(
        frozenset({Name.TEST, Name.DIRECTION, Name.OTHER_DIRECTION, Name.FORM, Name.BORE}),
        _changed(start_deg=START_DEG),
    ),
    "radius": Sabotage(frozenset({Name.RADIUS, Name.SCALE}), _changed(bar_mm=RADIUS_MM)),
    "late start": Sabotage(frozenset(), _late),
    "cable": Sabotage(frozenset({Name.LOST}), _cable),
    "repeat": Sabotage(frozenset({Name.REPEAT, Name.OTHER_DIRECTION}), _moved),
    "holder": Sabotage(frozenset({Name.CLOSURE, Name.DRIFT, Name.BUMP, Name.LOCAL}), _loose),
}


@dataclass(frozen=True)
class Case:
    """One session: its machine, feed, and what goes wrong in it; no sabotage if it is sound."""

    seed: int
    feed_mm_min: float
    sabotage: str = ""
    position: str = ""

    @property
    def spoilt(self) -> tuple[str, Direction, int] | None:
        if not self.sabotage:
            return None
        return AGAIN if self.sabotage == "repeat" else POSITIONS[self.position]


class Shop:
    """A machine, its line and an operator."""

    def __init__(self, case: Case) -> None:
        self.case = case
        machine = read_machine(MACHINE_FILE)
        inline = read_inline_plan(PLAN_FILE)
        repeated = ("low",) if case.sabotage == "repeat" else ()
        path = inline.path.model_copy(update={"feed_mm_min": case.feed_mm_min})
        inline = inline.model_copy(update={"path": path, "repeat_at_end": repeated})
        self.plan = inline.to_domain()
        self.virtual = SabotagedMachine(_truth(machine, case.seed), self.plan, seed=case.seed)
        self.clock = WaitingClock()
        self.cell = VirtualCell(self.virtual, self.clock)
        self.protocol = at_rate(load_instrument("streaming-encoder"), RATE_HZ)
        self.machine, self.inline = machine, inline
        self.late = False
        self.cut_at_s: float | None = None
        self.words: dict[str, list[tuple[str, str]]] = collections.defaultdict(list)
        self.seen = ""
        self._announced: events.RunAnnounced | None = None
        self._workplace: Workplace | None = None
        self._spoilt_once = False

    def circle(self, test: str, direction: Direction) -> Circle:
        return self.plan.tests[test].run(direction)

    def measure(self, folder: Path) -> dict[str, Any]:
        """Measure the session; return the words on its circles, and what was found of the sabotage."""
        clock = MachineTime(1.0 / RATE_HZ, self.clock())
        with (
            VirtualInstrument(self.protocol, self._length_mm_at, clock=self.clock) as self.wire,
            Instrument(self.protocol, self.wire.port, clock=clock, **driver_patience(100.0, waits=True)) as source,
        ):
            return self._measured(folder, source, clock)

    def _measured(self, folder: Path, source: ReadingSource, clock: Callable[[], float]) -> dict[str, Any]:
        details = SessionDetails(bar=Bar("bar-1", 150.0, 0.0005, None, None, None))
        read_by = ReadBy("streaming-encoder", "", "a line", virtual=True)
        timed = {"clock": clock, "time_scale": 100.0, "rate_hz": RATE_HZ}
        self._workplace = assemble(Job(self.machine, self.inline, folder, details, instrument=read_by, **timed), source)
        self._workplace.station.subscribe(self)
        try:
            self._workplace.station.run()
        finally:
            self._workplace.close()
        return {"words": self.words, "seen": self.seen}

    def _length_mm_at(self, t_s: float) -> float | None:
        if (
            self.cut_at_s is not None
            and (running := self.cell._running) is not None
            and t_s - running.begin_s > self.cut_at_s
        ):
            self.cut_at_s = None
            self.wire._to_drop += round(LOST_S * self.protocol.fastest_hz(None))  # its thread is here, and has the lock
        at_work = self._workplace is not None and self._workplace.station.state in RECORDING
        if at_work and t_s > self.clock._until_s - 1.0:
            self.clock.run_until(t_s + 1.0)  # the bar stands, and time goes on as at a machine
        return self.cell.length_mm_at(t_s)

    def __call__(self, event: events.Event) -> None:
        send = self._workplace.station.send
        match event:
            case events.RunAnnounced():
                self._announced = event
            case events.RunCompleted():
                self._judged(event)
            case events.RunDoubted():
                self._look_back(event.run, event.finding)
            case events.FeedInMissed():
                # A wrong ball can hide the feed-in, too. The operator then reads of a late start.
                self.seen, self.late = "late start", False
                self._announced and send(Quit())
            case events.StateChanged(state=State.ANNOUNCED):
                self._prepare(send)
            case events.StateChanged(state=State.ARMED) if not self.late:
                run = self._announced.run
                self._start(run.test, run.direction)
            case events.StateChanged(state=State.COMPLETE | State.FLAWED):
                self._decide(send)
            case _:
                pass

    def _prepare(self, send: Callable[[object], None]) -> None:
        run = self._announced.run
        if self.seen:
            send(Quit())
            return
        if (
            self._announced.put_up
            or self.virtual.mounted is None
            or self.virtual.mounted.name != self._announced.ball.name
        ):
            self.cell.mount(run.test)
        if self.case.sabotage == "late start" and not self._spoilt_once and self._is_spoilt(run):
            self._start(run.test, run.direction)
            return
        self.clock.settle()
        send(Start(after_s=self.clock()))

    def _is_spoilt(self, run: events.RunId) -> bool:
        return (run.test, run.direction, run.repeat) == self.case.spoilt

    def _start(self, test: str, direction: Direction) -> None:
        run = self._announced.run
        if self._is_spoilt(run) and not self._spoilt_once:
            self._spoilt_once = True
            SABOTAGES[self.case.sabotage].start(self, test, direction)
        else:
            self.cell.start(test, direction)

    def _judged(self, completed: events.RunCompleted) -> None:
        answer = completed.answer
        wrong = sorted(completed.wrong, key=rank)
        cause = str(wrong[0].name) if wrong else next((n for n, text in NAMED.items() if text in completed.problem), "")
        self.words[completed.run.label].append((str(answer.word), cause or "; ".join(answer.unseen)))
        if self._is_spoilt(completed.run) and answer.word is Advice.REPEAT:
            self.seen = cause or "circle"

    def _look_back(self, run: events.RunId, found: Finding) -> None:
        self.words[run.label].append(("LOOKED BACK", str(found.name)))
        if self._is_spoilt(run):
            self.seen = str(found.name)

    def _decide(self, send: Callable[[object], None]) -> None:
        label = self._announced.run.label
        word, _ = self.words[label][-1]
        if self.seen:
            send(Quit())
        else:
            send(Repeat() if word == Advice.REPEAT and self._announced.run.repeat < 3 else Accept("all the same"))


class _DirectCell:
    """The virtual cell without line and clock: a run becomes readings at once."""

    def __init__(self, shop: DirectShop) -> None:
        self._shop = shop

    def mount(self, test: str) -> None:
        self._shop.virtual.mount(self._shop.plan.tests[test].ball)

    def start(self, test: str, direction: Direction, path: CommandedPath | None = None) -> None:
        shop = self._shop
        made = shop.virtual.run(test, direction, path=path, begin_s=shop.now_s)
        lost = 0
        for t_s in np.arange(-BEFORE_S, made.path.duration_s + BEFORE_S, 1.0 / RATE_HZ).tolist():
            cut_s = shop.cut_at_s
            if cut_s is not None and cut_s < t_s < cut_s + LOST_S:
                lost += 1
                continue
            length_mm = made.length_mm_at(t_s) + shop.virtual.noise_mm()
            shop.readings.append(Reading(shop.now_s + BEFORE_S + t_s, length_mm, lost=lost))
            lost, shop.rest_mm = 0, length_mm
        shop.cut_at_s = None
        shop.now_s += made.path.duration_s + 5.0 * BEFORE_S


class DirectShop(Shop):
    """The same without a line."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.readings: list[Reading] = []
        self.now_s, self.rest_mm = 0.0, 0.0
        self.cell = _DirectCell(self)
        self.clock = _Clock(self)

    def drain(self) -> list[Reading]:
        """Return what the run became; behind it the bar stands, as long as the station waits for its feed-out."""
        readings, self.readings = self.readings, []
        if not readings and self._workplace.station.state in RECORDING:
            steps = range(1, round(RATE_HZ) + 1)
            readings = [Reading(self.now_s + k / RATE_HZ, self.rest_mm + self.virtual.noise_mm()) for k in steps]
            self.now_s = readings[-1].t_s
        return readings

    def measure(self, folder: Path) -> dict[str, Any]:
        return self._measured(folder, self, self.clock)


@dataclass(frozen=True)
class _Clock:
    shop: DirectShop

    def __call__(self) -> float:
        return self.shop.now_s

    def settle(self) -> None:
        """Do nothing: a run becomes readings at once."""


BEFORE_S = 3.0
"""Time that the bar stands before and after a run [s]."""


def _truth(machine: Any, seed: int) -> MachineModel:
    """Return a machine with errors of its own: kinematics, and in every second also gravity, backlash, lag."""
    rng = np.random.default_rng([seed, 57])
    known = known_sources()
    more = []
    for name in ("gravity", "backlash", "servo-lag") if seed % 2 else ():
        source = known.get(name)
        if source is not None:
            sizes = np.array([parameter.plausible for parameter in source.parameters(machine)])
            more.append(Fitted(source, 0.3 * np.abs(rng.normal(0.0, 1.0, len(sizes))) * sizes))
    return MachineModel(machine, (*random_kinematics(machine, seed), *more))


def measured(case: Case, *, direct: bool) -> dict[str, Any]:
    shop = DirectShop(case) if direct else Shop(case)
    with tempfile.TemporaryDirectory() as folder:
        return {**vars(case), **shop.measure(Path(folder) / "session")}


def cases(sound: int, seeds: int) -> tuple[Case, ...]:
    """Sound sessions enough for so many circles, then each sabotage at each position."""
    per_session = 6
    several = [
        Case(1 + k % MACHINES + 100 * (k // (2 * MACHINES)), FEEDS_MM_MIN[(k // MACHINES) % 2])
        for k in range(-(-sound // per_session))
    ]
    for seed in range(11, 11 + seeds):
        for feed in FEEDS_MM_MIN:
            for name in SABOTAGES:
                positions = ("last",) if name == "repeat" else POSITIONS
                several += [Case(seed, feed, name, position) for position in positions]
    return tuple(several)


def table(done: Sequence[dict[str, Any]]) -> dict[str, list[str]]:
    """Return the figures by row: GOOD, CANNOT TELL, REPEAT of sound ones; found and rightly named of the others."""
    words = [word for one in done if not one["sabotage"] for told in one["words"].values() for word, _ in told]
    rows = {}
    for word in (*map(str, Advice), "LOOKED BACK"):
        rows[f"sound: {word}"] = [f"{words.count(word)} of {len(words)}", "-", "-"]
    for name, sabotage in SABOTAGES.items():
        for feed in FEEDS_MM_MIN:
            mine = [one for one in done if one["sabotage"] == name and one["feed_mm_min"] == feed]
            seen = [one["seen"] for one in mine]
            right = [word for word in seen if word and (word in map(str, sabotage.right) or not sabotage.right)]
            others = sum(
                any(word in {str(Advice.REPEAT), "LOOKED BACK"} for word, _ in told)
                for one in mine
                for label, told in one["words"].items()
                if label != "{}-{}-{}".format(*_case(one).spoilt)
            )
            rows[f"{name}, {feed:.0f} mm/min"] = [
                f"{sum(map(bool, seen))} of {len(mine)}",
                f"{len(right)} of {len(mine)}",
                f"{others}",
            ]
    return rows


def _case(one: dict[str, Any]) -> Case:
    return Case(one["seed"], one["feed_mm_min"], one["sabotage"], one["position"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kept", type=Path, required=True)
    parser.add_argument("--sound", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--direct", action="store_true", help="hand readings to the station without the line")
    given = parser.parse_args()
    every = cases(given.sound, given.seeds)
    done = []
    for number in range(len(every)):  # one at a time: the line is in this process
        (one,) = drawn(lambda k: measured(every[k], direct=given.direct), [number], given.kept, "operator")
        done.append(one)
        told = {label: words for label, words in one["words"].items() if any(w[0] != "GOOD" for w in words)}
        sys.stderr.write(
            f"{one['seed']} {one['feed_mm_min']:.0f} {one['sabotage']} {one['position']}: seen {one['seen']!r} {told}\n"
        )
    rows = table(done)
    for name, cells in rows.items():
        sys.stdout.write(f"{name:32} {'  '.join(f'{cell:>10}' for cell in cells)}\n")
    if given.out:
        kept = {
            "question": "What does an operator see of sound and of sabotaged circles?"
            if given.direct
            else "What does an operator see of them through a serial line?",
            "data": f"Ten-minute check on virtual machines, {'readings handed over' if given.direct else 'through a serial line'}, at 1000 and 6000 mm/min; one circle spoilt: the first, the second direction, or the last.",
            "command": f"python -m tests.station.sabotages{' --direct' if given.direct else ''} --sound {given.sound} --seeds {given.seeds}",
            "date": f"{datetime.now().astimezone():%Y-%m-%d}",
            "seed": 1,
            "columns": ["found", "first cause right", "other circles blamed"],
            "figures": rows,
            "limits": "Another start angle puts one more circle in doubt in each session.",
        }
        given.out.write_text(json.dumps(kept, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
