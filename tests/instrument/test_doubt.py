"""Numbers of another form than those before: a digit lost, a point that moved, another unit."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.instrument.codec import Decoder, encode
from dbbstation.instrument.doubt import BELIEVED_AFTER, Doubts, Piece, Written
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument, with_zero
from tests.instrument.scripted_port import expected
from tests.instrument.undetected import PAIRS, PLACES_DEG, SEED, rows, unnoticed, usable_variants

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.instrument.reading import Reading

SYLVAC = load_instrument("sylvac-opto-rs")
ND287 = load_instrument("heidenhain-nd287")


def judged(protocol: Protocol, frames: Iterable[bytes]) -> list[Reading]:
    doubts, decoder = Doubts(protocol), Decoder(protocol, joining=False)
    pieces = [one for raw in frames for one in decoder.feed(raw) if isinstance(one, Piece)]
    return [doubts.judged(one) for one in pieces]


def test_a_lost_digit_is_a_doubtful_length() -> None:
    """150.123 as 50.123, between good ones: it is handed out with its number, but not as good."""
    asked = b"?\r"
    frames = [b"+150.123\r", b"+150.124\r", b"+50.125\r", b"+150.126\r"]
    with expected(*((asked, one) for one in frames)) as port, Instrument(SYLVAC, port) as instrument:
        readings = list(instrument.readings(4))
    assert [one.length_mm for one in readings] == [150.123, 150.124, 50.125, 150.126]
    assert [one.status for one in readings] == ["ok", "ok", "doubtful", "ok"]
    assert readings[2].said == (
        "its number has 2 digits before the point, the lines before had 3: a character was damaged or lost"
    )
    assert instrument.tally.doubtful == 1


@pytest.mark.parametrize(
    ("raw", "why"),
    [
        (b"+150.12\r", "2 digits behind the point, the lines before had 3"),
        (b"+50.123\r", "2 digits before the point, the lines before had 3"),
        (b"+5.123\r", "1 digit before the point, the lines before had 3"),
        (b"+15.0123\r", "4 digits behind the point, the lines before had 3"),
        (b"+150\r", "0 digits behind the point"),
    ],
)
def test_what_is_different_is_said(raw: bytes, why: str) -> None:
    last = judged(SYLVAC, [b"+150.123\r", b"+150.123\r", raw])[-1]
    assert last.status == "doubtful"
    assert why in last.said


def test_another_unit_is_doubtful() -> None:
    mahr = with_zero(load_instrument("mahr-c1202"), 150.0)
    readings = judged(mahr, [b"1 +012.34 um\r", b"1 +012.35 um\r", b"1 +000.34 mm\r"])
    assert [one.status for one in readings] == ["ok", "ok", "doubtful"]
    assert readings[2].said.startswith("its unit is mm, that of the lines before was um")


def test_a_digit_put_into_a_number_with_leading_zeros_is_no_power_of_ten() -> None:
    """12.34 µm as 112.34: four digits begin with a zero, so nothing was passed."""
    mahr = with_zero(load_instrument("mahr-c1202"), 150.0)
    readings = judged(mahr, [b"1 +012.34 um\r", b"1 +0112.34 um\r", b"1 +012.35 um\r"])
    assert [one.status for one in readings] == ["ok", "doubtful", "ok"]


def test_a_manual_that_has_a_sign_allows_none_to_be_missing() -> None:
    for protocol, raw in ((SYLVAC, b"150.123\r"), (load_instrument("keyence-dl-rs1a", "il-300"), b"M0,9150.12\r\n")):
        assert not any(isinstance(one, Piece) for one in Decoder(protocol, joining=False).feed(raw))


def test_a_number_narrower_than_the_manual_says_is_no_reading() -> None:
    """ND 287 user manual, page 108: the displayed position value has 10 to 13 characters."""
    decoder = Decoder(ND287, joining=False)
    assert isinstance(decoder.feed(b"\x02  150.0003\r\n")[0], Piece)
    assert not isinstance(decoder.feed(b"\x02 150.0003\r\n")[0], Piece)
    assert not isinstance(decoder.feed(b"\x02 50.0003\r\n")[0], Piece)


def test_a_bar_of_100_mm_has_two_and_three_digits_on_one_circle() -> None:
    """Noise about 100 mm passes the power of ten hundreds of times; none of it is a lost digit."""
    dice = np.random.default_rng(28)
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)
    lengths = 100.0 + 0.05 * np.cos(angle) + dice.normal(0.0, 0.01, len(angle))
    for protocol in (SYLVAC, load_instrument("heidenhain-nd281b"), ND287):
        readings = judged(protocol, (encode(protocol, float(one)) for one in lengths))
        assert sum(abs(np.diff(lengths >= 100.0))) > 50
        assert {one.status for one in readings} == {"ok"}


def test_another_form_is_believed_when_it_stays() -> None:
    frames = [b"+150.123\r"] * 3 + [b"+150.12\r"] * 5 + [b"+150.123\r"]
    said = [one.status for one in judged(SYLVAC, frames)]
    assert said == ["ok"] * 3 + ["doubtful"] * (BELIEVED_AFTER - 1) + ["ok"] * 3 + ["doubtful"]


def test_damaged_lines_between_good_ones_are_never_believed() -> None:
    frames = [b"+150.123\r", b"+150.12\r"] * 20
    said = [one.status for one in judged(SYLVAC, frames)]
    assert said == ["ok", "doubtful"] * 20


def test_no_lost_or_inserted_digit_looks_like_a_number_that_passed_a_power_of_ten() -> None:
    """Every whole number up to 20 000 and every digit of it, by brute force."""
    for number in range(20_000):
        digits = str(number)
        for place in range(len(digits)):
            without = digits[:place] + digits[place + 1 :]
            if without:
                damaged, good = _written(without), _written(digits)
                assert not damaged.continues(good)
                assert not good.continues(damaged)


def test_every_step_across_a_power_of_ten_is_allowed() -> None:
    for place in (1.0, 10.0, 100.0, 1000.0):
        below, above = place * (1.0 - 1e-3), place * (1.0 + 1e-3)
        pair = [Written(one, len(str(int(one))), 3) for one in (below, above)]
        for one, other in itertools.permutations(pair):
            assert one.continues(other)


def _written(digits: str) -> Written:
    return Written(float(digits), len(digits), 3)


def test_bytes_beside_a_reply_make_it_doubtful() -> None:
    asked = b"?\r"
    frames = [b"+150.123\r", b"+15\r+150.124\r", b"+150.125\r"]
    with expected(*((asked, one) for one in frames)) as port, Instrument(SYLVAC, port) as instrument:
        readings = list(instrument.readings(3))
    assert [one.status for one in readings] == ["ok", "doubtful", "ok"]
    assert "bytes that belong to no reply" in readings[1].said


@pytest.mark.parametrize("protocol", usable_variants(), ids=lambda one: one.label)
def test_no_lost_character_gives_a_wrong_length(protocol: Protocol) -> None:
    found = unnoticed(protocol, guarded=True, kinds=("lost",), pairs=0)
    assert found.cases["lost"] >= 5 * 5
    assert found.wrong["lost"] == 0


@pytest.mark.parametrize("name", ["heidenhain-nd281b", "sylvac-opto-rs"])
def test_what_passes_unnoticed_is_smaller_than_the_feed_allows(name: str) -> None:
    """A changed or swapped digit within what the machine can do is not seen: 50 µm at once, and 0.6 mm/s by its errors."""
    protocol = load_instrument(name)
    found = unnoticed(protocol, guarded=True, kinds=("changed", "swapped"), places_deg=PLACES_DEG[:1], pairs=50)
    alone = unnoticed(protocol, guarded=False, kinds=("changed", "swapped"), places_deg=PLACES_DEG[:1], pairs=50)
    assert 0.0 < found.worst_um < 190.0
    assert alone.worst_um > 1e5
    assert found.wrong["changed"] < 0.25 * alone.wrong["changed"]


@pytest.mark.nightly
def test_the_stored_table_is_what_is_measured() -> None:
    kept = Path(__file__).parents[2] / "docs" / "validation" / "undetected.json"
    stated = json.loads(kept.read_text(encoding="utf-8"))["figures"]
    assert stated == dict(rows([], guarded=True, pairs=PAIRS, seed=SEED))
