"""`dbbstation instrument emulate`: run a virtual machine with a bar on a separate line."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import BAUD, PROGRAMS, ProtocolOptions, RateHz
from dbbstation.cli.output import echo, json_text, say
from dbbstation.errors import InputError
from dbbstation.files.gateway import content_of
from dbbstation.system.ports import marked_virtual
from dbbstation.system.signals import CTRL_C, KILLED_POLITELY, interrupt_on
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.virtual.machine import CommandedPath

_LOOK_S = 0.2


@made()
def emulate(
    chosen: ProtocolOptions,
    *,
    plan: Annotated[Path, o.PLAN],
    machine: Annotated[Path, o.MACHINE],
    truth: Annotated[Path | None, Option("Model file with the true errors of the virtual machine.")] = None,
    source_files: o.SourcePaths = (),
    seed: o.Seed = 0,
    programs: Annotated[Path | None, PROGRAMS] = None,
    rate_hz: RateHz = None,
    time_scale: Annotated[float, Option(o.TIME_SCALE, least=0.01, most=200.0)] = 1.0,
    wait: Annotated[
        bool,
        Option(
            "For `measure --auto`: let machine time pass only during runs, as fast as samples are read. Results are then the same on any computer."
        ),
    ] = False,
    noise_um: Annotated[float, Option("Standard deviation of the noise of a reading [µm].", least=0.0)] = 0.3,
    bar_um: Annotated[float, Option("Standard deviation of the bar's length error [µm].", least=0.0)] = 0.5,
    baud: Annotated[int | None, replace(BAUD, setting="")] = None,
    as_json: o.Json = False,
) -> None:
    r"""Run a virtual hexapod with a ball bar, as an instrument on a pseudo-terminal, until Ctrl-C or `quit`.

    Prints the port, and a control address on this computer that starts circles. The address reads one line of text per
    command and answers with one line of JSON. Without --truth the machine has random kinematic errors of 0.1 mm. Its
    mountings, ball coordinates, bar and readings scatter as stated in plan and options.

    \b
    Commands at the control address:
      start TEST DIRECTION [PROGRAM]   mount TEST   status   truth   stop   quit

    \b
    Examples:
      dbbstation instrument emulate --instrument streaming-encoder --plan table2.yaml --machine machine.yaml
      dbbstation instrument emulate --instrument heidenhain-nd281b --plan p.yaml --machine m.yaml --seed 7 --time-scale 50
    """
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.instrument.library import at_rate
    from dbbstation.virtual.cell import VirtualCell
    from dbbstation.virtual.control import CellCommands, ControlServer
    from dbbstation.virtual.machine import Sizes, VirtualMachine
    from dbbstation.virtual.wire import VirtualInstrument
    from dbbstation.virtual.wire_clock import ScaledClock, WaitingClock

    usual = chosen.protocol()
    protocol = at_rate(usual, rate_hz)
    sent_hz = protocol.fastest_hz(baud) * (1.0 if wait else time_scale)
    pace = f"{sent_hz:g} readings {'per second of machine time' if wait else 'a second'}"
    say(f"note: sends {pace}; {chosen.instrument} has {usual.fastest_hz(baud):g}")
    if protocol.voice("fault") is None:
        say(
            f"note: {chosen.instrument} has no frame for a missing bar: it sends nothing until `mount` or `start` puts a ball up"
        )
    model = _truth(read_machine(machine), truth, source_files, seed)
    virtual = VirtualMachine(model, read_plan(plan), seed=seed, sizes=Sizes(noise_um / 1e3, bar_um / 1e3))
    virtual.check()
    clock = WaitingClock() if wait else ScaledClock(time_scale)
    cell = VirtualCell(virtual, clock)
    commands = CellCommands(cell, None if programs is None else _programs(programs))
    with ExitStack() as stack:
        wire = stack.enter_context(VirtualInstrument(protocol, cell.length_mm_at, clock=clock, baud=baud))
        control = stack.enter_context(ControlServer(commands))
        stack.enter_context(marked_virtual(wire.port))
        if as_json:
            echo(json_text({"port": wire.port, "control": control.url}))
        else:
            echo(f"port: {wire.port}\ncontrol: {control.url}")
        # Also where a shell started it in the background, which makes programs deaf to Ctrl-C.
        interrupt_on(CTRL_C, KILLED_POLITELY)
        try:
            while not commands.quit.wait(_LOOK_S):
                pass
        except KeyboardInterrupt:
            echo("switched off", err=True)


def _truth(machine: Machine, file: Path | None, source_files: o.SourcePaths, seed: int) -> MachineModel:
    from dbbstation.files.formats.machine import machine_data
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.own_sources import every_source
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.virtual.truth import random_kinematics

    if file is None:
        return MachineModel(machine, random_kinematics(machine, seed))
    model = read_model(file, every_source(source_files)).model.of_the_machine()
    if machine_data(model.machine) != machine_data(machine):
        what = f"its nominal machine ({model.machine.name}) is not the one given with --machine ({machine.name})"
        raise InputError.of(file, what, "give the machine file that the model was made for")
    return model


def _programs(folder: Path) -> Callable[[str], CommandedPath]:
    from dbbstation.station.programs import read_toolpath
    from dbbstation.virtual.machine import path_of

    def read(name: str) -> CommandedPath:
        path = folder / name
        if path.parent != folder or not path.is_file():
            raise InputError.of(path, "there is no such program", f"name a file in {folder}")
        return path_of(read_toolpath(path, content_of(path)))

    return read
