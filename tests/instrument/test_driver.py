from __future__ import annotations

import time
from itertools import pairwise

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from tests.instrument.scripted_port import expected

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder", "no-checksum")


def test_the_nd281b_is_asked_with_one_byte_for_each_reading() -> None:
    with expected((b"\x02", b"+  150.0003    \r\n"), (b"\x02", b"-    5.2300  = \r\n")) as port:
        with Instrument(ND, port) as instrument:
            before_s = time.monotonic()
            readings = list(instrument.readings(2))
        assert [reading.length_mm for reading in readings] == [150.0003, -5.23]
        assert readings[0].t_s < readings[1].t_s < before_s + 1.0
        assert instrument.tally.lost == instrument.tally.garbage_bytes == 0


def test_a_garbled_reply_is_asked_for_again_and_counted_as_lost() -> None:
    script = (b"\x02", b"+  1\xff0.0003    \r\n"), (b"\x02", b"+  150.0003    \r\n"), (b"\x02", b"+  150.0004    \r\n")
    with expected(*script) as port, Instrument(ND, port) as instrument:
        assert [(one.length_mm, one.lost) for one in instrument.readings(2)] == [(150.0003, 1), (150.0004, 0)]
        assert instrument.tally.garbage == b"+  1\xff0.0003    \r\n"


def test_bytes_from_before_are_not_taken_for_a_reply() -> None:
    with (
        expected((b"", b"+  111.1111    \r\n"), (b"\x02", b"+  150.0003    \r\n")) as port,
        Instrument(ND, port) as instrument,
    ):
        assert instrument.read().length_mm == 150.0003
        assert instrument.tally.garbage == b"+  111.1111    \r\n"


def test_the_stream_is_listened_to_without_a_word() -> None:
    stream = b"1,A\r\n00006,+0150.00031,A\r\n00007,+0150.00032,A\r\n00011,-0000.50000,A\r\n00012,+0000.00000,F\r\n"
    with expected((b"", stream)) as port, Instrument(ENCODER, port) as instrument:
        readings = list(instrument.readings(4))
    assert [one.counter for one in readings] == [6, 7, 11, 12]
    assert [one.lost for one in readings] == [0, 0, 3, 0]
    assert [one.length_mm for one in readings] == [150.00031, 150.00032, -0.5, None]
    assert readings[3].status == "fault"
    assert instrument.tally.lost == 3
    assert instrument.tally.garbage_bytes == 0


def test_times_rise_though_lines_come_together() -> None:
    stream = b"\r\n" + b"".join(b"%05d,+0150.00000,A\r\n" % n for n in range(50))
    with expected((b"", stream)) as port, Instrument(ENCODER, port) as instrument:
        times_s = [one.t_s for one in instrument.readings(50)]
    assert all(later > earlier for earlier, later in pairwise(times_s))


def test_readings_that_came_are_given_before_the_error() -> None:
    stream = b"\r\n" + b"".join(b"%05d,+0150.00031,A\r\n" % n for n in (6, 7, 1, 2, 3))
    with expected((b"", stream)) as port, Instrument(ENCODER, port) as instrument:
        time.sleep(0.1)
        assert len(instrument.drain()) == 2
        with pytest.raises(InstrumentError, match="scripted: the sample counter went from 7 to 1 and continues"):
            instrument.drain()
        with pytest.raises(InstrumentError, match="the sample counter"):
            instrument.read()


def test_after_a_stop_there_is_nothing_to_wait_for() -> None:
    with expected((b"", b"\r\n00006,+0150.00031,A\r\n")) as port:
        instrument = Instrument(ENCODER, port)
        instrument.start()
        with pytest.raises(InstrumentError, match="the instrument is already being read"):
            instrument.start()
        time.sleep(0.05)
        instrument.close()
        assert instrument.read().counter == 6
        with pytest.raises(InstrumentError, match="the instrument is not being read"):
            instrument.read()
        instrument.close()


def test_a_fault_inside_the_reader_is_not_swallowed() -> None:
    class Broken:
        name = "broken"
        in_waiting = 0

        def read(self, size: int = 1) -> bytes:
            raise RuntimeError(f"no {size} bytes")

        def write(self, data: bytes) -> int:
            return len(data)

    with (
        Instrument(ND, Broken()) as instrument,
        pytest.raises(InstrumentError, match="broken: reading failed: RuntimeError"),
    ):
        instrument.read()
