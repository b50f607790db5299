"""An instrument stays open from the checklist over bar and circles to what follows, and comes back by itself."""

from __future__ import annotations

import time
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.instrument import driver
from dbbstation.instrument.library import load_instrument
from dbbstation.service import held_line
from dbbstation.service.choice import Choice
from dbbstation.service.front import Front
from dbbstation.service.held_line import HeldLine
from dbbstation.service.memory import VIRTUAL, Line, Memory
from dbbstation.station import events
from dbbstation.station.commands import Quit
from dbbstation.virtual.wire import VirtualInstrument

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.service.board import SequenceOpened

PATIENCE_S = 30.0
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"


@pytest.fixture
def protocol() -> Protocol:
    return load_instrument("streaming-encoder")


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    ports: list[str] = []
    open_link = driver.open_link

    def noted(port: str, *args: object, **options: object) -> object:
        ports.append(port)
        return open_link(port, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(driver, "open_link", noted)
    return ports


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def test_one_after_the_other_reads_an_instrument_that_is_opened_once(protocol: Protocol, opened: list[str]) -> None:
    with VirtualInstrument(protocol, lambda _t_s: 150.25) as wire, closing(HeldLine(protocol, wire.port)) as line:
        until(lambda: line.latest is not None)
        for _ in range(2):
            lent_s = time.monotonic()
            with line.lent() as source:
                reading = source.read()
                assert reading.length_mm == pytest.approx(150.25, abs=1e-3)
                # A sample of before would be older than any line delays it.
                assert reading.t_s > lent_s - 0.05
                line.seen()
                time.sleep(0.1)
                assert line.seen() == ()
            until(lambda: bool(line.seen()))
        assert line.failure is None
    assert opened == [wire.port]


def test_what_is_seen_meanwhile_tells_length_and_rate(protocol: Protocol) -> None:
    with VirtualInstrument(protocol, lambda _t_s: None) as wire, closing(HeldLine(protocol, wire.port)) as line:
        until(lambda: line.latest is not None and line.rate.per_s is not None)
        assert line.latest is not None
        assert (line.latest.length_mm, line.latest.status) == (None, "fault")
        assert line.rate.per_s == pytest.approx(protocol.fastest_hz(None), rel=0.5)


def test_an_instrument_that_went_away_is_opened_again(
    protocol: Protocol, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(held_line, "AGAIN_S", 0.1)
    port = tmp_path / "adapter"
    with VirtualInstrument(protocol, lambda _t_s: 150.0) as wire:
        port.symlink_to(wire.port)
        line = HeldLine(protocol, str(port))
        until(lambda: line.latest is not None)
    with closing(line):
        until(lambda: line.failure is not None)
        assert line.latest is None
        with pytest.raises(InstrumentError), line.lent():
            pass
        with VirtualInstrument(protocol, lambda _t_s: 151.0) as wire:
            port.unlink()
            port.symlink_to(wire.port)
            until(lambda: line.latest is not None)
            assert line.failure is None
            with line.lent() as source:
                assert source.read().length_mm == pytest.approx(151.0, abs=1e-3)


@contextmanager
def at_the_desk(tmp_path: Path) -> Iterator[Front]:
    front = Front(tmp_path / "shop", Memory(tmp_path / "state" / "station.json"))
    front.under.mkdir()
    try:
        yield front
    finally:
        front.close()


def test_checklist_bar_and_circles_share_one_opening(protocol: Protocol, opened: list[str], tmp_path: Path) -> None:
    with VirtualInstrument(protocol, lambda _t_s: 150.0) as wire, at_the_desk(tmp_path) as front:
        by = Line(instrument="streaming-encoder", port=wire.port)
        bar = front.bar_calibration(by, {})
        until(lambda: bar.latest is not None)
        bar.close()
        choice = Choice(front.under / "session", MACHINE, PLAN, by, bar_waiver="a test")
        prepared = front.prepare(choice)
        assert prepared.first == next(iter(read_inline_plan(PLAN).to_domain().tests.values())).circle
        line = front.hold(prepared.protocol, by)
        assert line is not None
        until(lambda: line.latest is not None)
        runner = front.open(choice, prepared).runner
        came: list[events.Event | SequenceOpened] = []

        def told(kind: type) -> bool:
            came.extend(runner.mail())
            return any(isinstance(event, kind) for event in came)

        runner.start()
        until(lambda: told(events.RunAnnounced) and told(events.ReadingsSeen))
        runner.send(Quit())
        runner.wait()
        told(events.StateChanged)
        came.clear()
        # The sequence is over, and the reading goes on.
        until(lambda: told(events.ReadingsSeen))
        assert opened == [wire.port]
        # Whoever asks a port has it for himself: what was held is closed before.
        assert front.probe(by).answers
        assert opened == [wire.port] * 2


def test_a_virtual_instrument_is_not_held_before_its_sequence(protocol: Protocol, tmp_path: Path) -> None:
    with at_the_desk(tmp_path) as front:
        assert front.hold(protocol, Line(instrument="streaming-encoder", port=next(iter(VIRTUAL)))) is None
