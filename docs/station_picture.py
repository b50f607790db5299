"""Make the pictures of the station's screens that README and `docs/screen.md` show.

    python -m docs.station_picture [docs/images]

A simulated machine with small kinematic errors and play in one strut runs the ten-minute check; the pictures stand
still in the middle of the second circle, whose direction shows the play against the first.
"""

from __future__ import annotations

import asyncio
import html
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.instrument.reading import Reading
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.quality.conformity import Conformity
from dbbstation.service.board import SequenceOpened
from dbbstation.service.front import Front
from dbbstation.service.memory import Memory
from dbbstation.service.operated import Answered, Operated, read_operated
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import sources_named
from dbbstation.station.commands import Accept, Start
from dbbstation.station.events import StateChanged
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from dbbstation.tui.board_screen import Shown
from dbbstation.tui.operator_screens import AnswerScreen, JobScreen, OperateScreen
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.tui.still import Happened, still_svg

if TYPE_CHECKING:
    from dbbstation.service.choice import Choice
    from dbbstation.station.events import Event

SHARE_OF_RANDOM = 0.06
"""A machine after its calibration: random errors of 0.1 mm, so far taken out."""

PLAY_UM = (0.0, 9.0, 0.0, 0.0, -4.0, 0.0)
RATE_HZ = 60.0
STOPPED_AT = 0.62
"""Share of the second circle that has been run."""

SEED = 5


def happened() -> tuple[Shown, list[Event | SequenceOpened]]:
    """Run a circle and a part of the next; return what a screen is told of it."""
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    inline = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    plan = inline.to_domain()
    (play,) = sources_named(["backlash"])
    kinematics = [Fitted(one.source, SHARE_OF_RANDOM * one.values) for one in random_kinematics(machine, SEED)]
    truth = MachineModel(machine, (*kinematics, Fitted(play, np.array(PLAY_UM))))
    virtual = VirtualMachine(truth, plan, seed=SEED)
    schedule = Schedule(plan, lambda _test, _direction: 1)
    sequencer = Sequencer(plan, schedule, recording_of)
    events: list[Event | SequenceOpened] = [
        SequenceOpened(schedule.tasks, schedule.open, "2026-11-20-hexapod-7"),
        *sequencer.begin(),
    ]
    now_s = 0.0
    for direction, share in ((Direction.CCW, 1.0), (Direction.CW, STOPPED_AT)):
        run = virtual.run("low", direction)
        events += sequencer.command(Start())
        times = np.arange(0.0, share * run.path.duration_s, 1.0 / RATE_HZ)
        events += sequencer.readings(
            [Reading(now_s + float(t), run.length_mm_at(float(t)) + virtual.noise_mm()) for t in times]
        )
        now_s += float(times[-1]) + 1.0
        if share == 1.0:
            events += sequencer.command(Accept())
    return Shown(plan.name, inline.plate.bores, tests=plan.tests), events


SCREENS = {"station": (), "station-overview": ("o",), "station-large": ("f",)}
"""Keys that are pressed for each picture."""


def picture(screen: str = "station") -> str:
    """Return a screen as SVG, the same each time."""
    svg = asyncio.run(operator_svg(screen) if screen in OPERATOR else still_svg(*happened(), press=SCREENS[screen]))
    # Names that Rich makes from a hash of the content, so that two pictures can stand in one page.
    svg = re.sub(r"terminal-\d+-", "station-", svg)
    return _BLANKS_FIRST.sub(_moved, svg)


class _Job(Operated):
    """A job whose session has the same name each day."""

    def choice(self) -> Choice:
        return replace(super().choice(), folder=Path("monday-check-2026-11-23"), operator="Ann")


class _Answer:
    """An answer that is there at once: that of the example."""

    def look(self) -> Answered:
        kept = "Every circle is within the shop's tolerances."
        keep = "The circles need no correction. Measure again after a crash, a repair or a move of the machine."
        return Answered(Conformity.WITHIN, (kept,), (keep,), Path("monday-check-2026-11-23-results/report.html"))

    def close(self) -> None:
        pass


OPERATOR = ("operator-job", "operator-set-up", "operator-circle", "operator-answer")
"""Screens of a job, in the order in which an operator sees them."""


async def operator_svg(screen: str) -> str:
    """Return one of the operator's screens as SVG."""
    example = shipped_folder("fixtures") / "jobs" / "virtual.yaml"
    changed = {
        "name": "Monday check of hexapod 7",
        "machine": "hexapod-7.yaml",
        "plan": "ten-minute-check.yaml",
        "instrument": "heidenhain-nd281b",
        "port": "/dev/ttyUSB0",
        "may_change": ("operator", "temperature"),
    }
    shown, events = happened()
    set_up = next(k for k, event in enumerate(events) if isinstance(event, StateChanged) and event.state is State.ARMED)
    runner = Happened(events[:set_up] if screen == "operator-set-up" else events)
    job = _Job(example, read_operated(example).job)
    front = Front(Path(), Memory(Path("none.json")))
    app = StationApp(shown, runner, clock=lambda: 0.0, front=front, operated=job)
    async with app.run_test(size=(100, 30)) as pilot:
        if screen == "operator-job":
            top = JobScreen(app, front, replace(job, job=job.job.model_copy(update=changed)))
            top.search = lambda: top._found(job.choice())  # noqa: SLF001 - nothing is looked for
            app.push_screen(top)
        elif screen == "operator-answer":
            app.push_screen(AnswerScreen(_Answer(), lambda: None))
        else:
            app.push_screen(OperateScreen(app, shown))
        for _ in range(4):
            await pilot.pause()
            app.look()
        return app.export_screenshot(title="dbbstation measure --job")


_BLANKS_FIRST = re.compile(r' x="([\d.]+)"([^>]*) textLength="([\d.]+)"([^>]*)>((?:&#160;)+)([^<]*)')


def _moved(text: re.Match[str]) -> str:
    """Return a text without its leading blanks, further to the right: some viewers leave them out."""
    x, before, length, after, blanks, rest = text.groups()
    letters = len(html.unescape(blanks + rest))
    shift = float(length) * len(html.unescape(blanks)) / letters
    return f' x="{float(x) + shift:.1f}"{before} textLength="{float(length) - shift:.1f}"{after}>{rest}'


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "images")
    target.mkdir(parents=True, exist_ok=True)
    for screen in (*SCREENS, *OPERATOR):
        (target / f"{screen}.svg").write_text(picture(screen), encoding="utf-8")
