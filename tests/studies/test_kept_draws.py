"""Draws of a study that are kept in a file."""

from __future__ import annotations

import pytest

from dbbstation.errors import StationError
from studies.kept_draws import drawn


class Counting:
    """Squares numbers and knows which."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def __call__(self, number: int) -> int:
        self.asked.append(number)
        return number**2


def test_an_interrupted_study_goes_on_where_it_ended(tmp_path):
    path, first, again = tmp_path / "draws.jsonl", Counting(), Counting()
    stopped = drawn(first, range(3), path, "squares")
    assert [next(stopped), next(stopped)] == [0, 1]
    stopped.close()
    assert list(drawn(again, range(4), path, "squares")) == [0, 1, 4, 9]
    assert again.asked == [2, 3]
    with path.open("a") as file:
        file.write("[4, 1")  # power was lost while this one was written
    assert list(drawn(again, range(5), path, "squares")) == [0, 1, 4, 9, 16]
    assert again.asked == [2, 3, 4]


def test_draws_of_something_else_are_refused(tmp_path):
    path = tmp_path / "draws.jsonl"
    list(drawn(Counting(), range(2), path, "squares"))
    with pytest.raises(StationError, match="no draws of: cubes"):
        list(drawn(Counting(), range(2), path, "cubes"))
    path.write_text("name\n")
    with pytest.raises(StationError, match="no file of draws"):
        list(drawn(Counting(), range(2), path, "squares"))
