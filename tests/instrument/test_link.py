from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
import serial

from dbbstation.errors import InstrumentError
from dbbstation.instrument import link
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.instrument.link import open_link
from dbbstation.virtual.wire import VirtualInstrument

ND = load_instrument("heidenhain-nd281b")


def test_no_such_port() -> None:
    with pytest.raises(
        InstrumentError, match=r"/dev/ttyNONE9: there is no such port; .*see `dbbstation instrument ports`"
    ):
        open_link("/dev/ttyNONE9", ND.line)


def test_no_permission(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial.Serial, "open", refuse)
    with pytest.raises(InstrumentError, match="no permission to open the port; add yourself to the group that owns it"):
        open_link("/dev/null", ND.line)


@pytest.mark.skipif(not hasattr(os, "seteuid"), reason="Windows has no such permissions")
def test_no_permission_on_a_pseudo_terminal_names_its_group() -> None:
    with VirtualInstrument(ND, lambda _: 150.0) as virtual:
        port = Path(virtual.port)
        port.chmod(0)
        ours = os.geteuid()
        if ours == 0:
            os.seteuid(65_534)  # nobody: root may open anything
        try:
            with pytest.raises(InstrumentError) as caught:
                open_link(virtual.port, ND.line)
        finally:
            os.seteuid(ours)
        assert caught.value.what == "no permission to open the port"
        assert f"the group that owns it ({port.group()})" in caught.value.remedy


def test_in_use_by_another_program() -> None:
    with VirtualInstrument(ND, lambda _: 150.0) as virtual:
        first = open_link(virtual.port, ND.line)
        with pytest.raises(InstrumentError, match="another program has the port open; close the other program"):
            open_link(virtual.port, ND.line)
        first.close()
        open_link(virtual.port, ND.line).close()


def test_baud_rate_that_the_port_does_not_take(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise ValueError("Failed to set custom baud rate (123456): [Errno 22] Invalid argument")

    monkeypatch.setattr(serial.Serial, "open", refuse)
    with pytest.raises(
        InstrumentError, match="the port does not take the baud rate 123456; set the instrument to a usual"
    ):
        open_link("/dev/null", ND.line, baud=123456)


def test_a_file_is_no_port(tmp_path: Path) -> None:
    file = tmp_path / "port"
    file.touch()
    with pytest.raises(InstrumentError, match="this is no serial port that can be used"):
        open_link(str(file), ND.line)


def test_nobody_at_the_other_end_of_a_socket() -> None:
    with pytest.raises(InstrumentError, match=r"socket://127.0.0.1:1: cannot connect: .*refused"):
        open_link("socket://127.0.0.1:1", ND.line)


def test_the_settings_of_the_line_reach_the_port(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial.Serial, "open", lambda _: None)
    port = open_link("/dev/ttyUSB0", ND.line).port
    assert isinstance(port, serial.Serial)
    assert (port.baudrate, port.bytesize, port.parity, port.stopbits) == (9600, 7, "E", 2)
    assert (port.rtscts, port.xonxoff, port.exclusive) == (False, False, True)


def test_a_pseudo_terminal_can_be_opened_again_and_again() -> None:
    with VirtualInstrument(ND, lambda _: 150.0) as virtual:
        for _ in range(3):
            with Instrument(ND, virtual.port) as instrument:
                assert instrument.read().length_mm == 150.0


def test_an_open_port_is_used_and_stays_open() -> None:
    with VirtualInstrument(ND, lambda _: 150.0) as virtual:
        port = serial.Serial(virtual.port, 9600, timeout=0.02)
        with Instrument(ND, port) as instrument:
            assert instrument.read().length_mm == 150.0
            assert instrument.where == virtual.port
        assert port.is_open
        port.close()


def test_ports_have_name_and_description(monkeypatch: pytest.MonkeyPatch) -> None:
    class Found:
        device, description, hwid = "/dev/ttyUSB0", "FT232R USB UART", "USB VID:PID=0403:6001"

    monkeypatch.setattr(link.list_ports, "comports", lambda: [Found])
    assert link.connected_ports() == [("/dev/ttyUSB0", "FT232R USB UART", "USB VID:PID=0403:6001")]
