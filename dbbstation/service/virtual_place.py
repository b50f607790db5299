"""A virtual machine and instrument in this process, over a real line."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.model.machine_model import MachineModel
from dbbstation.station import events
from dbbstation.station.programs import read_toolpath
from dbbstation.station.states import State
from dbbstation.virtual.cell import VirtualCell
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.path import path_of
from dbbstation.virtual.truth import random_kinematics
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import ScaledClock

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.circle import Direction
    from dbbstation.plan.plan import Plan
    from dbbstation.station.programs import RunProgram


class Helper:
    """Mounts balls and starts circles for the station; an observer.

    Args:
        programs: NC programs by test and direction; else plain circles.
    """

    def __init__(self, cell: VirtualCell, programs: Mapping[tuple[str, Direction], RunProgram] | None = None) -> None:
        self._cell = cell
        self._programs = programs or {}
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

    port: str
    clock: ScaledClock
    helper: Helper
    wire: VirtualInstrument


@contextmanager
def virtual_place(
    machine: Machine,
    plan: Plan,
    protocol: Protocol,
    *,
    time_scale: float,
    seed: int = 0,
    programs: Mapping[tuple[str, Direction], RunProgram] | None = None,
) -> Iterator[VirtualPlace]:
    """Start a machine with random errors and an instrument on it.

    Raises:
        TravelError: a circle leaves the travel.
    """
    virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, seed)), plan, seed=seed)
    # Also compiles what is computed, so that the first circle does not wait for that.
    virtual.check()
    clock = ScaledClock(time_scale)
    cell = VirtualCell(virtual, clock)
    with VirtualInstrument(protocol, cell.length_mm_at, clock=clock) as wire:
        yield VirtualPlace(wire.port, clock, Helper(cell, programs), wire)
