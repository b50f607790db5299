"""Make the pictures of the station's screens that README and `docs/screen.md` show.

    python docs/station_picture.py [docs/images]

A simulated machine with small kinematic errors and play in one strut runs the ten-minute check; the pictures stand
still in the middle of the second circle, whose direction shows the play against the first.
"""

from __future__ import annotations

import asyncio
import html
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.shipped import shipped_folder
from dbbstation.instrument.reading import Reading
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.circle import Direction
from dbbstation.service.board import SequenceOpened
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import sources_named
from dbbstation.station.commands import Accept, Start
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.tui.shown import Shown
from dbbstation.tui.still import still_svg
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics

if TYPE_CHECKING:
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
    return Shown(plan.name, inline.jig.bores, tests=plan.tests), events


SCREENS = {"station": (), "station-overview": ("o",), "station-large": ("f",)}
"""Keys that are pressed for each picture."""


def picture(screen: str = "station") -> str:
    """Return a screen as SVG, the same each time."""
    svg = asyncio.run(still_svg(*happened(), press=SCREENS[screen]))
    # Names that Rich makes from a hash of the content, so that two pictures can stand in one page.
    svg = re.sub(r"terminal-\d+-", "station-", svg)
    return _BLANKS_FIRST.sub(_moved, svg)


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
    for screen in SCREENS:
        (target / f"{screen}.svg").write_text(picture(screen), encoding="utf-8")
