"""Virtual circles are told from real ones: in the session, in each run, and nobody mixes them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import ReadBy
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.library import load_instrument
from dbbstation.plan.plan import Direction
from dbbstation.service.choice import Choice, prepare
from dbbstation.service.front import line_to_go_on
from dbbstation.service.memory import Line
from dbbstation.service.session_list import list_sessions
from dbbstation.station.assembly import Job, Workplace, assemble
from dbbstation.station.commands import Accept, Quit, Start
from dbbstation.station.storage import time_of_day
from dbbstation.system.ports import _mark, is_virtual, marked_virtual
from tests.cli.conftest import call
from tests.station.bench import MACHINE_FILE
from tests.station.readings import run_readings
from tests.station.test_engine import Script

if TYPE_CHECKING:
    from pathlib import Path

SESSIONS = shipped_folder("fixtures") / "sessions"
REAL = ReadBy("heidenhain-nd281b", "", "/dev/ttyUSB0", virtual=False)
VIRTUAL = ReadBy("streaming-encoder", "", "virtual machine", virtual=True)
REAL_LINE = Line(instrument="heidenhain-nd281b", port="/dev/ttyUSB0")
VIRTUAL_LINE = Line(instrument="streaming-encoder", port="virtual machine")


def job(plan_file: Path, folder: Path, by: ReadBy | None) -> Job:
    return Job(read_machine(MACHINE_FILE), read_inline_plan(plan_file), folder, instrument=by)


def begun(plan_file: Path, folder: Path, by: ReadBy | None) -> Workplace:
    workplace = assemble(job(plan_file, folder, by), Script())
    workplace.close()
    return workplace


def measured(plan_file: Path, folder: Path, by: ReadBy | None) -> Path:
    circle = read_inline_plan(plan_file).to_domain().tests["a"].run(Direction.CCW)
    script = Script(run_readings(circle))
    workplace = assemble(job(plan_file, folder, by), script)
    workplace.station.subscribe(script)
    sent = iter((Start(), Accept(), Quit()))

    def answer(event: object) -> None:
        name = type(event).__name__
        if name in {"RunAnnounced", "RunCompleted"}:
            workplace.station.send(next(sent))

    workplace.station.subscribe(answer)
    workplace.station.run()
    workplace.close()
    return folder


@pytest.mark.parametrize("line", [REAL_LINE, VIRTUAL_LINE])
def test_a_job_knows_a_virtual_port_by_its_name(plan_file: Path, tmp_path: Path, line: Line) -> None:
    protocol = load_instrument("streaming-encoder")
    by = job(plan_file, tmp_path, None).read_by(protocol, "", line.port, None).instrument
    assert by == ReadBy("streaming-encoder", "", line.port, virtual=line.virtual)


def test_session_and_runs_say_what_read_them(plan_file: Path, tmp_path: Path) -> None:
    session = read_session(measured(plan_file, tmp_path / "session", REAL))
    assert (session.instrument, session.virtual) == (REAL, False)
    assert [run.instrument for run in session.runs] == [REAL]
    text = (session.folder / "session.yaml").read_text(encoding="utf-8")
    assert text.startswith("format: dbb-session/1\n")
    assert text.count("virtual: false") == 2
    stored = read_session(SESSIONS / "virtual")
    assert stored.virtual is True
    assert {run.instrument for run in stored.runs} == {replace(VIRTUAL, profile="crc")}
    assert read_session(SESSIONS / "logged").virtual is None


def test_real_and_virtual_are_not_mixed(plan_file: Path, tmp_path: Path) -> None:
    folders = {by.virtual: tmp_path / by.name for by in (REAL, VIRTUAL)}
    for by in (REAL, VIRTUAL):
        begun(plan_file, folders[by.virtual], by)
    with pytest.raises(InputError, match=r"this session is of a real machine, and streaming-encoder at virtual"):
        begun(plan_file, folders[False], VIRTUAL)
    with pytest.raises(InputError, match=r"this session is of a virtual machine, and heidenhain-nd281b at /dev/ttyU"):
        begun(plan_file, folders[True], REAL)
    other = replace(REAL, port="/dev/ttyUSB3")
    begun(plan_file, folders[False], other)  # another port of the same world is no other machine
    assert read_session(folders[False]).instrument == REAL


def test_an_older_session_takes_no_virtual_circles(tmp_path: Path) -> None:
    session = read_session(shutil.copytree(SESSIONS / "logged", tmp_path / "old"))
    old = Job(session.machine, read_inline_plan(session.plan_path), session.folder, instrument=VIRTUAL)
    # The copy has programs, as its runs had; that is refused for itself and does not matter here.
    with pytest.raises(InputError, match="a machine that is not noted as virtual"):
        assemble(old, Script())


def test_a_session_goes_on_in_its_own_world(plan_file: Path, tmp_path: Path) -> None:
    real = measured(plan_file, tmp_path / "real", REAL)
    virtual = begun(plan_file, tmp_path / "virtual", VIRTUAL).writer.session.folder
    # The shop's settings name a real port: a virtual session does not go on with that.
    assert line_to_go_on(virtual, Line(), REAL_LINE) == VIRTUAL_LINE
    assert line_to_go_on(virtual, VIRTUAL_LINE, REAL_LINE) == VIRTUAL_LINE
    assert line_to_go_on(real, REAL_LINE, REAL_LINE) == REAL_LINE
    # What was remembered as virtual is no silent default of a real session.
    assert line_to_go_on(real, VIRTUAL_LINE, VIRTUAL_LINE).port == ""
    with pytest.raises(InputError, match="of a real machine"):
        prepare(Choice(real, line=VIRTUAL_LINE))
    assert {line.folder.name: line.virtual for line in list_sessions(tmp_path)} == {"real": False, "virtual": True}


def test_the_report_of_a_virtual_session_says_so_in_its_title(tmp_path: Path) -> None:
    for name, virtual in (("virtual", True), ("logged", False)):
        page = tmp_path / f"{name}.html"
        outcome = call("report", SESSIONS / name, "--page", page)
        assert outcome.code == 0, outcome.err
        text = page.read_text(encoding="utf-8")
        assert ("<title>VIRTUAL MACHINE. " in text) is virtual
        assert ("<b>VIRTUAL MACHINE</b>: the circles of virtual are computed" in text) is virtual
        assert ("virtual: streaming-encoder (crc) at virtual machine" in text) is virtual


def test_times_of_a_faster_clock_do_not_lie_in_the_future() -> None:
    seconds = [0.0]
    now = time_of_day(lambda: seconds[0])
    seconds[0] = 24 * 3600.0 * 10  # a day of measuring at ten times real time
    assert now() <= datetime.now(UTC)


def test_no_virtual_session_stands_before_a_real_one(plan_file: Path, tmp_path: Path) -> None:
    before = measured(plan_file, tmp_path / "before", REAL)
    for by in (VIRTUAL, REAL):
        now = read_session(measured(plan_file, tmp_path / f"now-{by.name}", by))
        found = [session.folder for _, session in former_sessions(now, tmp_path)]
        assert (before in found) is (by is REAL)


def test_the_port_of_emulate_is_marked_while_it_runs() -> None:
    port = "/dev/no-such-port-57"
    assert not is_virtual(port)
    with marked_virtual(port):
        assert is_virtual(port)
        _mark(port).write_text("999999999", "ascii")  # of a program that was killed
        assert not is_virtual(port)
    assert not is_virtual(port)
