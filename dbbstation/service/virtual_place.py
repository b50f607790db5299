"""A virtual machine and instrument in this process, over a real line."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.model.machine_model import MachineModel
from dbbstation.station import events
from dbbstation.station.programs import read_toolpath
from dbbstation.station.states import State
from dbbstation.virtual.cell import VirtualCell
from dbbstation.virtual.machine import VirtualMachine, path_of
from dbbstation.virtual.truth import random_kinematics
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import PacedClock

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.plan.plan import Direction
    from dbbstation.station.assembly import Job
    from dbbstation.station.programs import RunProgram


SEED = 3
"""Seed of the virtual machine's errors: always the same machine, so that a session can be continued."""


class Helper:
    """Mounts balls and starts circles for the station; an observer.

    Args:
        programs: NC programs by test and direction; plain circles without.
    """

    def __init__(self, cell: VirtualCell, programs: Mapping[tuple[str, Direction], RunProgram]) -> None:
        self._cell = cell
        self._programs = programs
        self._announced: events.RunAnnounced | None = None

    def __call__(self, event: events.Event) -> None:
        """Do what the event requests.

        Raises:
            MachineError: the machine refuses.
        """
        if isinstance(event, events.RunAnnounced):
            self._announced = event
        elif isinstance(event, events.StateChanged) and event.state is State.ARMED and self._announced is not None:
            # A run that the operator gave up goes on at the machine, until somebody stops it.
            if self._cell.running:
                self._cell.stop()
            run = self._announced.run
            if self._announced.put_up:
                self._cell.mount(run.test)
            program = self._programs.get((run.test, run.direction))
            path = None if program is None else path_of(read_toolpath(Path(program.name), program.content))
            self._cell.start(run.test, run.direction, path)


@dataclass(frozen=True)
class VirtualPlace:
    """The virtual parts."""

    job: Job
    port: str
    helper: Helper
    wire: VirtualInstrument


@contextmanager
def virtual_place(job: Job, protocol: Protocol, time_scale: float, seed: int = SEED) -> Iterator[VirtualPlace]:
    """Start a job's machine with random errors, and an instrument on it; the place has the job on its clock.

    Raises:
        TravelError: a circle leaves the travel.
    """
    virtual = VirtualMachine(
        MachineModel(job.machine, random_kinematics(job.machine, seed)), job.plan.to_domain(), seed=seed
    )
    # Also compiles what is computed, so that the first circle does not wait for that.
    virtual.check()
    clock = PacedClock(time_scale)
    cell = VirtualCell(virtual, clock)
    with VirtualInstrument(protocol, cell.length_mm_at, clock=clock) as wire:
        timed = replace(job, clock=clock, time_scale=time_scale)
        yield VirtualPlace(timed, wire.port, Helper(cell, job.programs), wire)
