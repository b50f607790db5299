"""What goes wrong about a line and is survived, or told with its cause: over pseudo-terminals and local sockets."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import termios
import threading
import time
import tracemalloc
from typing import TYPE_CHECKING

import pytest
import serial
from serial import rfc2217

from dbbstation.errors import InstrumentError
from dbbstation.instrument import link
from dbbstation.instrument.codec import Decoder, encode
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument, with_zero
from dbbstation.instrument.link import connected_ports, open_link
from dbbstation.instrument.symptoms import looks_like, parity_in
from dbbstation.system.ports import holders
from dbbstation.virtual.control import ControlServer
from dbbstation.virtual.wire import SocketEnd
from dbbstation.virtual.wire_clock import ScaledClock
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

ND = load_instrument("heidenhain-nd281b")
STREAM = load_instrument("streaming-encoder")
OLD = load_instrument("streaming-encoder", "no-checksum")
BINARY = load_instrument("streaming-encoder-binary")


def steady(_t_s: float) -> float:
    return 150.0003


# Port in use.


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="only Linux tells who has a port open")  # noqa: PTH112
def test_who_has_the_port_open_is_named() -> None:
    code = "import serial, sys; s = serial.Serial(sys.argv[1], exclusive=True); print('open', flush=True); sys.stdin.read()"
    with VirtualInstrument(ND, steady) as virtual:
        words = [sys.executable, "-c", code, virtual.port]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == "open\n"
            who = holders(virtual.port)
            with pytest.raises(
                InstrumentError, match=rf"has the port open: \S+ \(process {other.pid}\); close the other"
            ):
                open_link(virtual.port, ND.line)
            other.communicate()
    assert [one.rpartition(" ")[2] for one in who] == [f"{other.pid})"]


def test_where_the_system_does_not_tell_nobody_is_named(tmp_path: Path) -> None:
    assert holders("/dev/ttyUSB0", tmp_path / "no-such-folder") == []


# Cable pulled out and put back.


class _Plugged:
    """A USB port that `comports` finds."""

    def __init__(self, device: str, serial_number: str | None, location: str = "1-2") -> None:
        self.device = device
        self.vid, self.pid, self.serial_number, self.location = 0x0403, 0x6001, serial_number, location


@pytest.mark.parametrize("protocol", [ND, STREAM, BINARY], ids=lambda one: one.label)
def test_the_same_adapter_under_another_name_goes_on(monkeypatch: pytest.MonkeyPatch, protocol) -> None:
    plugged: list[_Plugged] = []
    monkeypatch.setattr(link.list_ports, "comports", lambda: list(plugged))
    clock = ScaledClock(5 if protocol is ND else 1)
    with contextlib.ExitStack() as stack:
        first = stack.enter_context(VirtualInstrument(protocol, steady, clock=clock))
        stranger = stack.enter_context(VirtualInstrument(protocol, lambda _: 99.0, clock=clock))
        plugged[:] = [_Plugged(first.port, "A50285BI")]
        instrument = stack.enter_context(Instrument(protocol, first.port, clock=clock, reconnect_s=20.0))
        before = list(instrument.readings(3))
        plugged[:] = [_Plugged(stranger.port, "ZZ000001")]  # another adapter of the same kind is not ours
        first.hang_up()
        time.sleep(0.6)
        again = stack.enter_context(VirtualInstrument(protocol, steady, clock=clock))
        assert again.port != stranger.port
        plugged.append(_Plugged(again.port, "A50285BI"))
        # What was on its way when the cable was pulled is handed out first.
        after = next(one for one in instrument.readings() if one.lost)
        assert (after.length_mm, after.status) == (150.0003, "ok")
        assert after.t_s > before[-1].t_s
        assert instrument.tally.reconnected == 1
        assert list(instrument.readings(3))[-1].length_mm == 150.0003


def test_an_adapter_that_does_not_come_back_is_an_error_after_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    with VirtualInstrument(STREAM, steady) as virtual:
        plugged = [_Plugged(virtual.port, None)]
        monkeypatch.setattr(link.list_ports, "comports", lambda: list(plugged))
        with Instrument(STREAM, virtual.port, reconnect_s=0.6) as instrument:
            list(instrument.readings(3))
            plugged.clear()
            virtual.hang_up()
            began_s = time.monotonic()
            with pytest.raises(InstrumentError, match="the line was closed while it was in use"):
                for _ in instrument.readings():
                    pass
            assert 0.4 < time.monotonic() - began_s < 5.0


def test_adapters_without_serial_number_are_told_apart_by_their_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    plugged = [_Plugged("/dev/ttyUSB0", None, "1-1"), _Plugged("/dev/ttyUSB1", None, "1-2")]
    monkeypatch.setattr(link.list_ports, "comports", lambda: plugged)
    second = link.adapter_of("/dev/ttyUSB1")
    assert second is not None
    plugged[:] = [_Plugged("/dev/ttyUSB7", None, "1-2")]
    assert link.port_of(second) == "/dev/ttyUSB7"
    plugged[:] = [_Plugged("/dev/ttyUSB1", None, "1-1")]
    assert link.port_of(second) is None
    assert link.adapter_of("/dev/ttyS0") is None


# The wrong instrument, the wrong settings.


@pytest.mark.parametrize(
    ("expected", "answering", "named"),
    [
        (STREAM, OLD, "--instrument streaming-encoder --profile no-checksum"),
        (OLD, STREAM, "--instrument streaming-encoder --profile crc"),
        (STREAM, BINARY, "--instrument streaming-encoder-binary"),
    ],
    ids=lambda one: one if isinstance(one, str) else one.label,
)
def test_another_instrument_that_streams_is_named(expected, answering, named: str) -> None:
    with (
        VirtualInstrument(answering, steady, baud=115200) as virtual,
        Instrument(expected, virtual.port, baud=115200, timeout_s=0.3) as instrument,
        pytest.raises(InstrumentError) as caught,
    ):
        instrument.read()
    assert f"what comes is not {expected.label}" in caught.value.what
    assert "it looks like another instrument: " in caught.value.remedy
    assert named in caught.value.remedy


def test_a_gauge_whose_replies_only_begin_as_those_of_another_is_refused() -> None:
    sylvac, tesa = load_instrument("sylvac-opto-rs"), with_zero(load_instrument("tesa-tt80"), 150.0)
    assert sylvac.ask.request == tesa.ask.request
    with (
        VirtualInstrument(tesa, lambda _: 150.1, clock=ScaledClock(10)) as virtual,
        Instrument(sylvac, virtual.port, clock=virtual.clock) as instrument,
        pytest.raises(InstrumentError, match="exchanges contain bytes that belong to no reply") as caught,
    ):
        for _ in instrument.readings():
            pass
    assert "--instrument tesa-tt80" in caught.value.remedy
    assert instrument.tally.readings < 20


def test_noise_looks_like_no_instrument() -> None:
    assert looks_like(bytes(range(256)), ND) == []


def test_the_parity_that_bytes_carry_is_named() -> None:
    text = b"+  150.0003    \r\n"
    even = bytes(byte | (byte.bit_count() % 2) << 7 for byte in text)
    odd = bytes(byte | (1 - byte.bit_count() % 2) << 7 for byte in text)
    assert (parity_in(even), parity_in(odd), parity_in(text), parity_in(even[:5])) == (
        "even parity",
        "odd parity",
        "",
        "",
    )
    with VirtualInstrument(ND, steady) as virtual:
        virtual.show_parity()
        with (
            Instrument(ND, virtual.port, timeout_s=0.15) as instrument,
            pytest.raises(
                InstrumentError, match="that bit is even parity: set data bits and parity of the port to 9600 baud, 7"
            ),
        ):
            instrument.read()


# Noise, and lines that never end.


@pytest.mark.parametrize("protocol", [STREAM, BINARY], ids=lambda one: one.label)
def test_bursts_of_noise_are_counted_and_bring_no_wrong_length(protocol) -> None:
    with VirtualInstrument(protocol, steady) as virtual, Instrument(protocol, virtual.port) as instrument:
        list(instrument.readings(20))
        for burst in range(20):
            virtual.send_garbage(bytes((burst * 37 + place * 101) % 256 for place in range(40)))
            assert {one.length_mm for one in instrument.readings(10)} == {150.0003}
        # Bursts wait behind frames that are on their way, and may follow each other there.
        for one in instrument.readings(20_000):
            assert one.length_mm == 150.0003
            if instrument.tally.garbage_bytes >= 20 * 40:
                break
    assert instrument.tally.garbage_bytes >= 20 * 40
    assert instrument.tally.rejected


@pytest.mark.parametrize("keep", [1, 5, 11])
def test_a_reply_cut_in_the_middle_costs_one_sample(keep: int) -> None:
    with (
        VirtualInstrument(BINARY, steady, rate_hz=1000.0) as virtual,
        Instrument(BINARY, virtual.port) as instrument,
    ):
        list(instrument.readings(20))
        virtual.cut_next_frame(keep)
        readings = list(instrument.readings(600))
    assert {one.length_mm for one in readings} == {150.0003}
    # The frame after the cut one is believed only when another follows it, so it is not lost.
    assert instrument.tally.lost == 1


@pytest.mark.parametrize("protocol", [ND, STREAM, BINARY], ids=lambda one: one.label)
def test_an_endless_line_takes_no_memory(protocol) -> None:
    decoder = Decoder(protocol, joining=True)
    piece = b"7" * 4096
    for _ in range(50):
        decoder.feed(piece)
    tracemalloc.start()
    try:
        for _ in range(2500):
            decoder.feed(piece)
            assert len(decoder.pending) <= 512
        grown = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert grown < 300_000


def test_an_endless_line_on_a_port_ends_with_its_bytes() -> None:
    with VirtualInstrument(STREAM, steady) as virtual, Instrument(STREAM, virtual.port, timeout_s=0.3) as instrument:
        list(instrument.readings(3))
        virtual._running = False
        virtual.send_garbage(b"7" * 20_000)
        with pytest.raises(InstrumentError, match="no line end in 256 bytes"):
            for _ in instrument.readings():
                pass


# Damaged digits.


@pytest.mark.parametrize("place", range(24))
def test_one_wrong_digit_is_never_a_length(place: int) -> None:
    """Every digit of a line of the streaming format, turned into every other one: CRC-16 sees any error of 16 bits in a row."""
    good = encode(STREAM, 150.00031, counter=42)
    for digit in b"0123456789ABCDEFO+-,.":
        bad = bytearray(good)
        bad[place] = digit
        heard = Decoder(STREAM, joining=False).feed(bytes(bad))
        lengths = [one.reading.length_mm for one in heard if hasattr(one, "reading")]
        assert lengths == ([150.00031] if bytes(bad) == good else [])


def test_damaged_lines_are_counted_by_reason() -> None:
    lines = [encode(STREAM, 150.0, counter=count) for count in range(8)]
    wrong = lines[3].replace(b"150.0", b"151.0")
    doubled = lines[5]

    class Port:
        name, raw = "scripted", b"\r\n" + b"".join([*lines[:3], wrong, *lines[4:6], doubled, *lines[6:]])

        @property
        def in_waiting(self) -> int:
            return len(self.raw)

        def read(self, size: int = 1) -> bytes:
            out, self.raw = self.raw[:size], self.raw[size:]
            time.sleep(0.0 if out else 0.01)
            return out

        def write(self, data: bytes) -> int:
            return len(data)

    with Instrument(STREAM, Port()) as instrument:
        readings = list(instrument.readings(7))
    assert [one.counter for one in readings] == [0, 1, 2, 4, 5, 6, 7]
    assert [one.lost for one in readings] == [0, 0, 0, 1, 0, 0, 0]
    assert {one.length_mm for one in readings} == {150.0}
    assert instrument.tally.rejected == {"checksum": 1, "counter": 1}
    assert instrument.tally.lost == 1


# Network instruments.


@contextlib.contextmanager
def _served(serve) -> Iterator[int]:
    server = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=lambda: serve(server.accept()[0]), daemon=True)
    thread.start()
    try:
        yield server.getsockname()[1]
    finally:
        server.close()
        thread.join(5.0)


def test_an_instrument_behind_a_socket_server() -> None:
    def serve(client: socket.socket) -> None:
        with client, contextlib.suppress(OSError):
            while client.recv(1) == b"\x02":
                client.sendall(b"+  150.0003    \r\n")

    with _served(serve) as number, Instrument(ND, f"socket://127.0.0.1:{number}") as instrument:
        assert [one.length_mm for one in instrument.readings(3)] == [150.0003] * 3


@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial says so of itself
def test_an_instrument_behind_a_server_of_rfc_2217() -> None:
    class NoBits(serial.Serial):
        """A pseudo-terminal has no parity and no modem lines; it takes note of the one and says yes to the other."""

        cts = dsr = ri = cd = property(lambda _: True)

        def _update_rts_state(self) -> None:
            """There is no such line."""

        _update_dtr_state = _update_break_state = _update_rts_state

        def _reconfigure_port(self, force_update: bool = False) -> None:  # noqa: FBT001, FBT002 (pyserial's)
            with contextlib.suppress(serial.SerialException, ValueError, OSError, termios.error):
                super()._reconfigure_port(force_update)

    def serve(client: socket.socket) -> None:
        class Connection:
            def write(self, data: bytes) -> None:
                client.sendall(data)

        with client, NoBits(virtual.port, 9600, timeout=0.01) as line, contextlib.suppress(OSError):
            manager = rfc2217.PortManager(line, Connection())
            client.settimeout(0.01)
            while True:
                with contextlib.suppress(TimeoutError):
                    raw = client.recv(1024)
                    if not raw:
                        return
                    line.write(b"".join(manager.filter(raw)))
                raw = line.read(line.in_waiting or 1)
                if raw:
                    client.sendall(b"".join(manager.escape(raw)))

    with (
        VirtualInstrument(ND, steady, clock=ScaledClock(5)) as virtual,
        _served(serve) as number,
        Instrument(ND, f"rfc2217://127.0.0.1:{number}?ign_set_control", timeout_s=3.0) as instrument,
    ):
        assert [one.length_mm for one in instrument.readings(2)] == [150.0003] * 2


def test_network_instruments_are_never_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket.socket, "connect", lambda *_: pytest.fail("something was connected to"))
    assert all("://" not in name for name, *_ in connected_ports())


def test_the_emulator_listens_on_this_computer_alone() -> None:
    end = SocketEnd()
    try:
        assert end._server.getsockname()[0] == "127.0.0.1"
    finally:
        end.close()

    class Nothing:
        quit = threading.Event()

        def __call__(self, _line: str) -> dict[str, object]:
            return {}

    with ControlServer(Nothing()) as control:  # type: ignore[arg-type]  # it only has to listen
        assert control.url.startswith("tcp://127.0.0.1:")
