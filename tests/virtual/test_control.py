from __future__ import annotations

import json
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from threading import Event
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import MachineError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.virtual.cell import VirtualCell
from dbbstation.virtual.control import CellCommands, ControlClient, ControlServer
from dbbstation.virtual.machine import Sizes, VirtualMachine
from dbbstation.virtual.wire_clock import STAND_S, ScaledClock
from tests.instrument.leaks import nothing_left_open

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.machine.geometry import Machine

__all__ = ["nothing_left_open"]


@pytest.fixture
def cell(reference: Machine) -> VirtualCell:
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    return VirtualCell(VirtualMachine(MachineModel(reference), plan, sizes=Sizes(0.0, 0.0)), ScaledClock(500.0))


@pytest.fixture
def server(cell: VirtualCell) -> Iterator[ControlServer]:
    with ControlServer(CellCommands(cell)) as running:
        yield running


def test_the_bar_lies_aside_stands_outside_runs_and_stands_still_again(cell: VirtualCell) -> None:
    assert cell.length_mm_at(0.0) is None
    run = cell.start("a", Direction.CCW)
    begin_s = cell._running.begin_s  # type: ignore[union-attr]
    assert cell.length_mm_at(begin_s - STAND_S) == pytest.approx(151.5, abs=0.01)
    assert cell.length_mm_at(begin_s + run.path.duration_s / 2.0) == pytest.approx(150.0, abs=0.01)
    assert cell.length_mm_at(begin_s + run.path.duration_s + 1e6) == pytest.approx(151.5, abs=0.01)
    cell.stop()
    assert cell.length_mm_at(begin_s) is None


def test_nothing_is_started_or_mounted_while_a_run_goes_on(cell: VirtualCell) -> None:
    cell.start("a", Direction.CCW)
    with pytest.raises(MachineError, match="during a run"):
        cell.start("a", Direction.CW)
    with pytest.raises(MachineError, match="during a run"):
        cell.mount("b")


def test_commands_and_answers(server: ControlServer) -> None:
    client = ControlClient(server.url)
    assert client.ask("status") == {"ok": True, "state": "idle", "ball": None, "mounting": None}
    assert client.ask("mount", "b")["mounting"] == 1
    started = client.ask("start", "a", "cw")
    assert started["mounting"] == 2
    assert started["duration_s"] == pytest.approx(73.466, abs=0.01)
    status = client.ask("status")
    assert (status["state"], status["test"], status["direction"], status["ball"]) == ("running", "a", "cw", "9-short")
    client.free()
    assert client.ask("status")["state"] == "idle"
    names = {source["name"] for source in client.ask("truth")["sources"]}
    assert names == {"bar-offset", "ball-coordinate", "mounting"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("start", "zz", "cw"), "no run zz cw"),
        (("start", "a", "sideways"), "is no command"),
        (("start", "a", "cw", "a-cw.ngc"), "has no programs"),
        (("mount", "zz"), "no test zz"),
        (("dance",), "is no command"),
    ],
)
def test_what_cannot_be_obeyed_is_answered_with_the_reason(
    server: ControlServer, words: tuple[str, ...], said: str
) -> None:
    with pytest.raises(MachineError, match=said):
        ControlClient(server.url).ask(*words)


def test_one_line_of_json_per_line_also_when_lines_come_in_pieces(server: ControlServer) -> None:
    port = int(server.url.rpartition(":")[2])
    with closing(socket.create_connection(("127.0.0.1", port), timeout=5.0)) as line:
        line.sendall(b"stat")
        time.sleep(0.05)
        line.sendall(b"us\nstatus\n")
        came = b""
        while came.count(b"\n") < 2:
            came += line.recv(4096)
    assert [json.loads(each)["ok"] for each in came.splitlines()] == [True, True]


def test_it_listens_on_this_computer_only(server: ControlServer) -> None:
    assert server.url.startswith("tcp://127.0.0.1:")


def test_quit_is_heard(cell: VirtualCell) -> None:
    commands = CellCommands(cell)
    with ControlServer(commands) as running:
        assert ControlClient(running.url).ask("quit") == {"ok": True}
    assert commands.quit.is_set()


def test_nobody_there_is_said(cell: VirtualCell) -> None:
    with ControlServer(CellCommands(cell)) as running:
        url = running.url
    with pytest.raises(MachineError, match="does not answer `status`"):
        ControlClient(url).ask("status")


def test_the_last_command_is_answered_though_the_server_ends() -> None:
    told = Event()

    def obey(line: str) -> dict[str, object]:
        told.set()
        time.sleep(0.3)
        return {"line": line}

    with ThreadPoolExecutor(1) as pool:
        with ControlServer(obey) as server:
            asked = pool.submit(ControlClient(server.url).ask, "quit")
            assert told.wait(5.0)
        assert asked.result()["line"] == "quit"
