"""Counters out of order: what was damaged, doubled, lost, and what is a restart."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.errors import InstrumentError
from dbbstation.instrument.sequence import SampleOrder


def placed(counters: list[int], modulus: int = 100_000) -> tuple[list[tuple[int, int]], list[int]]:
    sequence = SampleOrder[int](modulus, "COM3")
    out = [one for counter in counters for one in sequence.place(counter, counter)]
    accepted = [(one.sample, one.lost) for one in out if one.lost is not None]
    return accepted, [one.sample for one in out if one.lost is None]


def test_what_counts_on_is_handed_out_at_once() -> None:
    assert placed([97, 98, 99, 0, 1], modulus=100) == ([(97, 0), (98, 0), (99, 0), (0, 0), (1, 0)], [])


def test_a_gap_is_counted_over_the_turn_of_the_counter_once_the_next_line_agrees() -> None:
    assert placed([97, 98, 1], modulus=100) == ([(97, 0), (98, 0)], [])
    assert placed([97, 98, 1, 2, 12, 13], modulus=100)[0] == [(97, 0), (98, 0), (1, 2), (2, 0), (12, 9), (13, 0)]


@pytest.mark.parametrize("digit", range(5))
@pytest.mark.parametrize("value", range(10))
def test_one_wrong_digit_of_a_counter_costs_that_line_alone(digit: int, value: int) -> None:
    right = list(range(12_340, 12_350))
    wrong = list(right)
    text = list(f"{wrong[5]:05d}")
    text[digit] = str(value)
    wrong[5] = int("".join(text))
    accepted, rejected = placed(wrong)
    if wrong == right:
        assert (accepted, rejected) == ([(counter, 0) for counter in right], [])
        return
    assert rejected == [wrong[5]]
    assert accepted == [(counter, 1 if counter == right[6] else 0) for counter in right if counter != right[5]]


def test_a_doubled_line_is_rejected_and_nothing_is_lost() -> None:
    assert placed([5, 6, 6, 7, 8]) == ([(5, 0), (6, 0), (7, 0), (8, 0)], [6])


def test_a_line_said_three_times() -> None:
    assert placed([5, 6, 6, 6, 7]) == ([(5, 0), (6, 0), (7, 0)], [6, 6])


def test_losses_in_a_row_are_losses() -> None:
    assert placed([5, 9, 14, 20, 21]) == ([(5, 0), (9, 3), (14, 4), (20, 5), (21, 0)], [])


def test_a_restart_is_believed_when_three_lines_count_on_from_behind() -> None:
    sequence = SampleOrder[int](100_000, "COM3")
    for counter in (500, 501, 0, 1):
        sequence.place(counter, counter)
    with pytest.raises(InstrumentError, match="COM3: the sample counter went from 501 to 0 and continues from there"):
        sequence.place(2, 2)


def test_a_counter_that_stands_still_is_never_a_reading() -> None:
    accepted, rejected = placed([5] * 50)
    assert accepted == [(5, 0)]
    assert set(rejected) == {5}
    assert len(rejected) >= 48


def test_a_wire_without_a_counter_holds_nothing() -> None:
    sequence = SampleOrder[str](None, "COM3")
    assert [one.lost for one in sequence.place(None, "a")] == [0]


@given(st.lists(st.integers(0, 99_999), max_size=60))
def test_no_counters_whatever_make_samples_vanish_or_appear(counters: list[int]) -> None:
    sequence = SampleOrder[int](100_000, "COM3")
    out: list[int] = []
    given_ = 0
    try:
        for counter in counters:
            given_ += 1
            out += [one.sample for one in sequence.place(counter, counter)]
    except InstrumentError:
        given_ -= 1  # the line that made a restart certain
    out += [one.sample for one in sequence.left()]
    assert out == counters[:given_]
