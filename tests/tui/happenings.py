"""Events as a sequence sends them, for screens that no instrument feeds."""

from __future__ import annotations

import numpy as np

from dbbstation.instrument.reading import Reading
from dbbstation.plan.plan import Ball, Circle, Direction, Plan, PlannedTest
from dbbstation.quality.finding import Finding
from dbbstation.service.board import Board, SequenceOpened
from dbbstation.station.commands import Start
from dbbstation.station.events import Event, RunStarted
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.states import State
from dbbstation.tui.board_screen import Shown

BORES = {1: (0.0, 100.0), 2: (-100.0, 100.0), 3: (-100.0, 0.0), 9: (0.0, 0.0), 7: (100.0, 0.0), 5: (0.0, -100.0)}
RATE_HZ = 20.0


def make_plan(tests: int = 3, overshoot_deg: float = 20.0) -> Plan:
    circles = {}
    for number in range(tests):
        bore = [9, 3, 7][number % 3]
        ball = Ball(f"{bore}-short", bore, "short", (*BORES[bore], -1150.0), 8e-4, 6e-4)
        circle = Circle(
            ball_mm=ball.centre_mm,
            centre_mm=ball.centre_mm,
            bar_mm=150.0,
            tilt_deg=(0.0, 5.0 * number, 0.0),
            feed_mm_min=3000.0,
            start_deg=30.0,
            overshoot_deg=overshoot_deg,
            feed_in_mm=1.5,
            elevation_deg=0.0,
            direction=Direction.CCW,
        )
        circles[f"t{number}"] = PlannedTest(f"t{number}", ball, circle, (Direction.CCW, Direction.CW))
    return Plan("Three bores", circles)


def lengths_mm(circle: Circle, t_s: np.ndarray) -> np.ndarray:
    """What a bar reads from the dwell before the feed-in on: an ellipse of 12 µm, off its centre by 20 µm."""
    edge_s = circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    arc_s = circle.swept_deg / circle.turning_deg_s
    on_arc = np.clip(t_s - 1.0 - edge_s - 0.3, 0.0, arc_s)
    theta = np.radians(circle.theta_deg(on_arc * circle.turning_deg_s - circle.overshoot_deg))
    side = 4.0 if circle.direction is Direction.CW else 0.0
    um = 12.0 * np.cos(2.0 * theta) + 20.0 * np.cos(theta - 1.0) + side
    out_s = 1.0 + edge_s + 0.3 + arc_s + 0.3
    outside = np.interp(t_s, [0.0, 1.0, 1.0 + edge_s, out_s, out_s + edge_s], [1.5, 1.5, 0.0, 0.0, 1.5])
    return circle.bar_mm + um / 1e3 + outside


class Happening:
    """Runs a sequencer on made-up readings and keeps what it says."""

    def __init__(self, plan: Plan | None = None, findings: tuple[Finding, ...] = ()) -> None:
        self.plan = plan or make_plan()
        self.schedule = Schedule(self.plan, self._next_repeat)
        self.sequencer = Sequencer(self.plan, self.schedule, recording_of, judge=lambda _run, _recording: findings)
        self.events: list[Event | SequenceOpened] = []
        self.events += [
            SequenceOpened(self.schedule.tasks, self.schedule.open, "session-7"),
            *self.sequencer.begin(),
        ]
        self._now_s = 0.0

    def command(self, *commands: object) -> Happening:
        for command in commands:
            self.events += self.sequencer.command(command)
        return self

    def circle(self, test: str, direction: Direction, share: float = 1.0) -> Happening:
        """Start, and run a share of the path; 1 is until behind its end."""
        self.command(Start())
        circle = self.plan.tests[test].run(direction)
        whole_s = circle.swept_deg / circle.turning_deg_s + 4.0
        times = np.arange(0.0, share * whole_s, 1.0 / RATE_HZ)
        readings = [
            Reading(self._now_s + float(t), float(length))
            for t, length in zip(times, lengths_mm(circle, times), strict=True)
        ]
        self.events += self.sequencer.readings(readings)
        self._now_s += whole_s
        return self

    def _next_repeat(self, test: str, direction: Direction) -> int:
        started = [event.run for event in self.events if isinstance(event, RunStarted)]
        return 1 + sum((run.test, run.direction) == (test, direction) for run in started)

    def states(self) -> list[State]:
        board = Board()
        states = []
        for event in self.events:
            board.take(event)
            states.append(board.state)
        return states

    def board(self) -> Board:
        board = Board()
        for event in self.events:
            board.take(event)
        return board

    def shown(self) -> Shown:
        return Shown(self.plan.name, BORES, tests=self.plan.tests)
