"""Damaged characters that no instrument's line shows: `python -m tests.instrument.undetected [NAME …]`.

Frames of a bar on a circle are written by each instrument, one of them is damaged on its way, and all are read: the system's
marks of wrong parity, decoder, sample counter, doubts, and what the feed allows. Counted is what comes out as `ok` and is not the
length that was sent. One character is lost, changed (into every other one, its parity bit included), inserted (every one, at every place)
or swapped with its neighbour: all cases. Of two such errors in one frame a sample with a seed.

The circle: a bar of 150 mm, 1000 mm/min, a machine that is 40 µm off centre and 15 µm elliptic, noise of 0.5 µm, each instrument at its own rate.
"""

from __future__ import annotations

import argparse
import copy
import random
import sys
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.instrument.codec import Decoder, decode, encode
from dbbstation.instrument.damaged import Marks
from dbbstation.instrument.doubt import Doubts, Piece
from dbbstation.instrument.library import known_instruments, load_variants, with_zero
from dbbstation.instrument.polling import PolledReply
from dbbstation.instrument.reading import OK
from dbbstation.instrument.sequence import SampleOrder
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.reachable import Reachable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dbbstation.instrument.protocol import LineSettings, Protocol
    from dbbstation.instrument.reading import Reading

BAR_MM = 150.0
CIRCLE = Circle((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), BAR_MM, (0.0, 0.0, 0.0), 1000.0, 0.0, 45.0, 1.5, 0.0, Direction.CCW)

BEFORE, BEHIND = 5, 4
"""Good frames on either side of the damaged one: as many as it takes to learn how it writes, and to say what was lost."""

PLACES_DEG = (20.0, 95.0, 170.0, 245.0, 320.0)
"""Where on the circle the damaged frame is."""

PAIRS, SEED = 2000, 28
"""Of the table of the documentation."""

KINDS = ("lost", "changed", "inserted", "swapped")

_WIRE = 256
"""Characters that a line has, seven bits and parity or eight bits."""

Code = tuple[int, ...]
"""Characters as they are on the wire."""


def usable_variants(names: Iterable[str] = ()) -> list[Protocol]:
    """Return every instrument with every profile, those of a short display set to zero at the bar's length."""
    variants = [one for name in names or known_instruments() for one in load_variants(name)]
    return [with_zero(one, BAR_MM) if one.length.relative else one for one in variants]


def on_wire(raw: bytes, line: LineSettings) -> Code:
    """Return characters with their parity as the eighth bit, where the line has seven and parity."""
    if line.data_bits == 8:
        assert line.parity == "none"
        return tuple(raw)
    assert line.parity == "even"
    return tuple(byte | byte.bit_count() % 2 << 7 for byte in raw)


def off_wire(code: Code, protocol: Protocol, *, guarded: bool) -> bytes:
    """Return what a program reads: through the system's marks, or without them as pyserial alone opens a port."""
    seven = protocol.line.data_bits == 7
    if not guarded or not protocol.is_text:
        return bytes(one & 0x7F if seven else one for one in code)
    marked = b""
    for one in code:
        if seven and one.bit_count() % 2:
            marked += bytes([0xFF, 0, one & 0x7F])
        else:
            byte = one & 0x7F if seven else one
            marked += b"\xff\xff" if byte == 0xFF else bytes([byte])
    return Marks(protocol.line.data_bits).taken_out(marked)


def one_character(code: Code) -> Iterator[tuple[str, Code]]:
    seen = {code}
    cases: dict[str, Iterator[Code]] = {
        "lost": (code[:at] + code[at + 1 :] for at in range(len(code))),
        "changed": ((*code[:at], one, *code[at + 1 :]) for at in range(len(code)) for one in range(_WIRE)),
        "swapped": (code[:at] + code[at : at + 2][::-1] + code[at + 2 :] for at in range(len(code) - 1)),
        "inserted": ((*code[:at], one, *code[at:]) for at in range(len(code) + 1) for one in range(_WIRE)),
    }
    for kind, damaged in cases.items():
        for one in damaged:
            if one not in seen:
                seen.add(one)
                yield kind, one


def two_characters(code: Code, dice: random.Random, count: int) -> Iterator[Code]:
    for _ in range(count):
        damaged = _once(_once(code, dice), dice)
        if damaged != code:
            yield damaged


def _once(code: Code, dice: random.Random) -> Code:
    at, new = dice.randrange(len(code)), dice.randrange(_WIRE)
    match dice.choice(KINDS):
        case "lost":
            return code[:at] + code[at + 1 :]
        case "changed":
            return (*code[:at], new, *code[at + 1 :])
        case "swapped":
            return code[:at] + code[at : at + 2][::-1] + code[at + 2 :]
    return (*code[:at], new, *code[at:])


class Passage:
    """One place on the circle: the frames there, and what a program makes of them when the middle one is damaged.

    Args:
        guarded: with parity, doubts and feed; without, a port as pyserial opens it and the decoder alone.
    """

    def __init__(self, protocol: Protocol, place_deg: float, *, guarded: bool) -> None:
        self._protocol, self._guarded = protocol, guarded
        self._period_s = 1.0 / protocol.fastest_hz()
        # Of an instrument that is asked, the driver knows the moment to a rectangle.
        self._u_s = float(np.ptp(protocol.latch_bounds_s()) / np.sqrt(12.0)) if protocol.ask.asked else 0.0
        number = np.arange(-BEFORE, BEHIND + 1)
        theta = np.radians(place_deg + number * self._period_s * CIRCLE.turning_deg_s)
        noise = np.random.default_rng(round(place_deg)).normal(0.0, 0.5e-3, len(number))
        lengths = BAR_MM + 0.04 * np.cos(theta) + 0.015 * np.cos(2.0 * theta) + noise
        self._frames = [encode(protocol, float(one), counter=100 + k) for k, one in enumerate(lengths)]
        self.true_mm = [decode(protocol, raw).length_mm or 0.0 for raw in self._frames]
        self.code = on_wire(self._frames[BEFORE], protocol.line)
        self._sequence_of = [100 + k for k in range(BEFORE)]
        self._doubts, self._reachable = Doubts(protocol), Reachable(CIRCLE)
        for k, raw in enumerate(self._frames[:BEFORE]):
            piece = Decoder(protocol, joining=False).feed(raw)[0] if not protocol.by_width else None
            if isinstance(piece, Piece):
                self._doubts.judged(piece)
            self._reachable.note((k - BEFORE) * self._period_s, self.true_mm[k], self._u_s)

    def read(self, code: Code) -> list[Reading]:
        raw = off_wire(code, self._protocol, guarded=self._guarded)
        pieces = self._asked(raw) if self._protocol.ask.asked else self._streamed(raw)
        doubts, reachable = copy.copy(self._doubts), copy.copy(self._reachable)
        readings = []
        for number, piece, clean in pieces:
            reading = doubts.judged(piece, clean=clean) if self._guarded else piece.reading
            if self._guarded and reading.status == OK and reading.length_mm is not None:
                why = reachable.doubt(number * self._period_s, reading.length_mm, self._u_s, on_turn=True)
                if why:
                    continue
            readings.append(reading)
        return readings

    def wrong_um(self, code: Code) -> float:
        """Return by how much the worst reading is wrong that comes out as good [µm]; 0 where none is."""
        worst = 0.0
        for reading in self.read(code):
            if reading.status == OK and reading.length_mm is not None:
                off = min(abs(reading.length_mm - true) for true in self.true_mm[BEFORE:])
                if off > 1e-7:
                    worst = max(worst, 1e3 * abs(reading.length_mm - self.true_mm[BEFORE]))
        return worst

    def _asked(self, raw: bytes) -> list[tuple[int, Piece, bool]]:
        """What the driver takes from one reply: the last of its readings; without one it asks again."""
        heard = Decoder(self._protocol, joining=False).feed(raw)
        pieces = [one for one in heard if isinstance(one, Piece)]
        return [(0, pieces[-1], PolledReply(pieces[-1], 0.0, raw).clean)] if pieces else []

    def _streamed(self, raw: bytes) -> list[tuple[int, Piece, bool]]:
        decoder = Decoder(self._protocol, joining=False)
        decoder.feed(b"".join(self._frames[:BEFORE]))
        sequence = SampleOrder[tuple[int, Piece, bool]](self._protocol.counter_modulus, "wire")
        if self._protocol.counter_modulus is not None:
            for counter in self._sequence_of:
                sequence.place(counter, None)  # type: ignore[arg-type]  # what comes back is thrown away
        taken = []
        for number, heard in enumerate(decoder.feed(raw + b"".join(self._frames[BEFORE + 1 :]))):
            if isinstance(heard, Piece):
                sample = (number, heard, True)
                taken += [one.sample for one in sequence.place(heard.reading.counter, sample) if one.lost is not None]
        return taken


@dataclass
class Unnoticed:
    """Damaged frames of one instrument.

    Attributes:
        wrong: those of which a wrong length came out as good, likewise.
    """

    cases: Counter[str] = field(default_factory=Counter)
    wrong: Counter[str] = field(default_factory=Counter)
    worst_um: float = 0.0

    def share(self, kind: str) -> str:
        """Return the share of unnoticed cases [%]."""
        share = 100.0 * self.wrong[kind] / max(self.cases[kind], 1)
        return "0" if not self.wrong[kind] else f"{share:.2g}"


def unnoticed(
    protocol: Protocol,
    *,
    guarded: bool,
    places_deg: Iterable[float] = PLACES_DEG,
    kinds: Iterable[str] = KINDS,
    pairs: int = PAIRS,
    seed: int = SEED,
) -> Unnoticed:
    found, dice, wanted = Unnoticed(), random.Random(seed), set(kinds)  # noqa: S311 (no secret hangs on it)
    for place_deg in places_deg:
        passage = Passage(protocol, place_deg, guarded=guarded)
        for kind, code in one_character(passage.code):
            if kind not in wanted:
                continue
            wrong_um = passage.wrong_um(code)
            found.cases[kind] += 1
            found.wrong[kind] += wrong_um > 0.0
            found.worst_um = max(found.worst_um, wrong_um)
        for code in two_characters(passage.code, dice, pairs):
            found.cases["two"] += 1
            found.wrong["two"] += passage.wrong_um(code) > 0.0
    return found


def rows(names: Iterable[str], *, guarded: bool, pairs: int, seed: int) -> Iterator[tuple[str, list[str]]]:
    """Yield instrument and profile with readings per second, shares [%] by kind of error, and the greatest error [µm]."""
    for protocol in usable_variants(names):
        found = unnoticed(protocol, guarded=guarded, pairs=pairs, seed=seed)
        shares = [found.share(kind) for kind in (*KINDS, "two")]
        label = f"`{protocol.name}`" + (f" `{protocol.profile}`" if protocol.profile else "")
        rate_hz = protocol.fastest_hz()
        yield label, [f"{rate_hz:.0f}" if rate_hz >= 100.0 else f"{rate_hz:.3g}", *shares, f"{found.worst_um:.3g}"]


def main() -> None:
    asked = argparse.ArgumentParser(description="Shares [%] of damaged frames that come out as a good, wrong length.")
    asked.add_argument("names", nargs="*", help="instruments; all of them without a name")
    asked.add_argument("--pairs", type=int, default=PAIRS, help="frames with two errors, at each place")
    asked.add_argument("--seed", type=int, default=SEED)
    asked.add_argument("--decoder-alone", action="store_true", help="without parity, doubts and feed")
    given = asked.parse_args()
    sys.stdout.write("| instrument | per second | " + " | ".join(KINDS) + " | two | greatest error [µm] |\n")
    sys.stdout.write("| --- | --- |" + " --- |" * (len(KINDS) + 2) + "\n")
    for label, cells in rows(given.names, guarded=not given.decoder_alone, pairs=given.pairs, seed=given.seed):
        sys.stdout.write(f"| {label} | {' | '.join(cells)} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
