"""The commands `ports`, `instruments`, `monitor` and `replay`."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from dbbstation.cli.instruments import instruments, ports
from dbbstation.cli.monitor import monitor, replay
from dbbstation.errors import InstrumentError, OutputError
from dbbstation.instrument import link
from dbbstation.instrument.library import load_instrument
from dbbstation.virtual.wire_clock import ScaledClock
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    from pathlib import Path

    import click

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder")


def run(command: click.Command, *arguments: str) -> tuple[str, str]:
    result = CliRunner().invoke(command, arguments, catch_exceptions=False, standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout, result.stderr


@pytest.mark.parametrize("command", [ports, instruments, monitor, replay], ids=lambda command: command.name)
def test_help_has_an_example(command: click.Command) -> None:
    text, _ = run(command, "--help")
    assert "Example" in text
    name = "list" if command is instruments else command.name
    assert f"\n    dbbstation instrument {name}" in text


def test_help_loads_no_serial_library() -> None:
    code = (
        "import sys; from dbbstation.cli import instruments, monitor; "
        "sys.exit(', '.join({'serial', 'pydantic', 'ruamel'} & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""


def test_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "connected_ports", lambda: [("/dev/ttyUSB0", "FT232R", "USB VID")])
    assert run(ports)[0] == "/dev/ttyUSB0     FT232R  (USB VID)\n"
    expected = [{"port": "/dev/ttyUSB0", "description": "FT232R", "hardware": "USB VID"}]
    assert json.loads(run(ports, "--json")[0])["ports"] == expected
    monkeypatch.setattr(link, "connected_ports", list)
    assert run(ports) == ("", "No serial port is connected: plug in the adapter of the instrument.\n")


def test_instruments() -> None:
    text, _ = run(instruments)
    assert "heidenhain-nd281b (stx, a0200, a0200-inch)\n" in text
    assert "statements about it are not verified" in text
    assert "9600 baud, 7 data bits, even parity, 2 stop bits, about 14 readings per second" in text
    listed = json.loads(run(instruments, "--json")[0])["instruments"]
    assert {one["name"] for one in listed} >= {"heidenhain-nd281b", "streaming-encoder"}
    # What the project defines itself needs no page of somebody else.
    assert {one["name"] for one in listed if not one["not_verified"]} == {
        "streaming-encoder",
        "streaming-encoder-binary",
    }


def test_one_instrument() -> None:
    text, _ = run(instruments, "heidenhain-nd281b")
    assert "asked with 02" in text
    assert "NOT VERIFIED" in text
    assert "fault: the display shows a fault" in text
    shown = json.loads(run(instruments, "heidenhain-nd281b", "--json")[0])
    assert shown["protocol"]["ask"]["request"] == "\x02"
    assert 'example   "+  150.0003    \\r\\n" is 150.00030 mm' in text


def test_monitor_counts_and_logs_and_replay_reads_the_log(tmp_path: Path) -> None:
    log = tmp_path / "bytes.txt"
    with VirtualInstrument(ND, lambda _: 150.0003, clock=ScaledClock(5)) as virtual:
        arguments = ["--instrument", ND.name, "--port", virtual.port, "--count", "3", "--log", str(log)]
        text, talk = run(monitor, *arguments)
        with pytest.raises(OutputError, match="exists already"):
            run(monitor, *arguments)
        run(monitor, *arguments, "--force")
    assert text.count("150.00030 mm\n") == 3
    assert "3 readings, 0 lost" in talk or "4 readings, 0 lost" in talk
    text, talk = run(replay, str(log))
    assert text.count("150.00030 mm\n") >= 3
    assert ", 0 lost, " in talk
    shown = json.loads(run(replay, str(log), "--instrument", ND.name, "--json")[0])
    assert shown["readings"][0]["length_mm"] == 150.0003
    # Nothing, or the end of the reply that was under way when the first monitor stopped, or the beginning of the one that
    # was under way when the second stopped.
    first_s, last_s = shown["readings"][0]["t_s"], shown["readings"][-1]["t_s"]
    for row in shown["not_understood"]:
        begins, ends = row["t_s"] < first_s, row["t_s"] > last_s and row["why"] == "the log ends within it"
        assert begins or ends, row


def test_monitor_prints_json_lines_only() -> None:
    with VirtualInstrument(ENCODER, lambda _: None) as virtual:
        text, _ = run(monitor, "--instrument", ENCODER.name, "--port", virtual.port, "--count", "2", "--json")
    rows = [json.loads(line) for line in text.splitlines()]
    assert [row["status"] for row in rows[:2]] == ["fault", "fault"]
    assert rows[0]["t_s"] == 0.0
    assert rows[0]["length_mm"] is None
    assert rows[2]["totals"]["lost"] == 0


def test_monitor_of_a_port_that_is_not_there() -> None:
    with pytest.raises(InstrumentError, match="there is no such port"):
        run(monitor, "--instrument", ND.name, "--port", "/dev/ttyNONE9")


def test_ctrl_c_ends_the_monitor_with_its_totals() -> None:
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from dbbstation.cli import main; main()"
    with VirtualInstrument(ENCODER, lambda _: 150.0) as virtual:
        command = [
            sys.executable,
            "-c",
            code,
            "instrument",
            "monitor",
            "--instrument",
            ENCODER.name,
            "--port",
            virtual.port,
            "--json",
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as monitoring:
            assert monitoring.stdout is not None
            monitoring.stdout.readline()
            monitoring.send_signal(signal.SIGINT)
            text, talk = monitoring.communicate(timeout=20)
    assert monitoring.returncode == 0, talk
    assert talk == ""
    assert json.loads(text.splitlines()[-1])["totals"]["garbage_bytes"] == 0


def test_monitor_shows_a_doubtful_reading_as_one_and_counts_it(tmp_path: Path) -> None:
    log = tmp_path / "bytes.txt"
    sylvac = load_instrument("sylvac-opto-rs", "continuous")
    taken: list[float] = []

    def length_mm(t_s: float) -> float:
        taken.append(t_s)
        if len(taken) == 6:
            virtual.damage_next_frame(lambda raw: raw.replace(b"+1", b"+"))
        return 150.123

    with VirtualInstrument(sylvac, length_mm, rate_hz=50.0) as virtual:
        words = ["--instrument", sylvac.name, "--profile", "continuous", "--port", virtual.port, "--count", "9"]
        shown, talk = run(monitor, *words, "--spy", str(log))
    (doubtful,) = [line for line in shown.splitlines() if "doubtful" in line]
    assert "50.12300 mm  doubtful: its number has 2 digits before the point, the lines before had 3" in doubtful
    assert "0 lost, 1 doubtful, 0 bytes not understood" in talk
    shown, talk = run(replay, str(log))
    assert len([line for line in shown.splitlines() if "doubtful" in line]) == 1
    assert "0 lost, 1 doubtful, " in talk


def test_monitor_says_where_a_port_does_not_tell_of_wrong_parity() -> None:
    for pty, said in ((True, False), (False, True)):
        with VirtualInstrument(ND, lambda _: 150.0, pty=pty) as virtual:
            talk = run(monitor, "--instrument", ND.name, "--port", virtual.port, "--count", "1")[1]
        assert ("this port does not tell of characters with a wrong parity" in talk) is said
