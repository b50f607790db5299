"""Malformed bytes into the decoder of every shipped instrument: no crash, no hang, bounded memory, nothing vanishes."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.instrument.codec import LONGEST_LINE, Decoder, Garbage, encode
from dbbstation.instrument.library import known_instruments, load_variants, with_zero

ALL = [protocol for name in known_instruments() for protocol in load_variants(name)]
EXAMPLES = 150
"""Per instrument and profile; `pytest -m nightly` runs ten times as many."""


def _broken(protocol) -> st.SearchStrategy[bytes]:
    """Bytes of any kind, and frames of the instrument with bytes removed, doubled, turned over and put between."""
    protocol = with_zero(protocol, 150.0) if protocol.length.relative else protocol
    good = [encode(protocol, length_mm, counter=7) for length_mm in (150.0, 149.9, None)]
    piece = st.one_of(st.sampled_from(good), st.binary(max_size=30), st.sampled_from(good).flatmap(_damaged))
    return st.lists(piece, max_size=12).map(b"".join)


def _damaged(raw: bytes) -> st.SearchStrategy[bytes]:
    places = st.integers(0, max(len(raw) - 1, 0))
    return st.one_of(
        places.map(lambda at: raw[:at] + raw[at + 1 :]),
        places.map(lambda at: raw[:at] + raw[at : at + 1] * 2 + raw[at + 1 :]),
        st.tuples(places, st.integers(1, 255)).map(lambda one: _turned(raw, *one)),
        places.map(lambda at: raw[:at]),
    )


def _turned(raw: bytes, at: int, bits: int) -> bytes:
    return raw[:at] + bytes([raw[at] ^ bits]) + raw[at + 1 :]


def _feed(protocol, raw: bytes, cuts: list[int], *, joining: bool) -> None:
    decoder = Decoder(protocol, joining=joining)
    heard = []
    edges = sorted({min(cut, len(raw)) for cut in cuts})
    for start, end in zip([0, *edges], [*edges, len(raw)], strict=True):
        heard += decoder.feed(raw[start:end])
        assert len(decoder.pending) <= 2 * LONGEST_LINE
    assert b"".join(one.raw for one in heard) + decoder.pending == raw
    for one in heard:
        if isinstance(one, Garbage):
            continue
        assert (one.reading.length_mm is None) <= (one.reading.status != "ok")
        assert one.reading.status == "ok" or one.reading.said


@pytest.mark.parametrize("protocol", ALL, ids=lambda one: one.label)
def test_no_bytes_break_a_decoder(protocol) -> None:
    _run(protocol, EXAMPLES)


@pytest.mark.nightly
@pytest.mark.parametrize("protocol", ALL, ids=lambda one: one.label)
def test_no_bytes_break_a_decoder_all_night(protocol) -> None:
    _run(protocol, 10 * EXAMPLES)


def _run(protocol, examples: int) -> None:
    @settings(max_examples=examples, deadline=1000, database=None)
    @given(raw=_broken(protocol), cuts=st.lists(st.integers(0, 200), max_size=6), joining=st.booleans())
    def feed(raw: bytes, cuts: list[int], joining: bool) -> None:  # noqa: FBT001 (drawn)
        _feed(protocol, raw, cuts, joining=joining)

    feed()
