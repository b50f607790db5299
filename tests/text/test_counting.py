"""Names and runs in the order in which people count."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.errors import InputError, Problem
from dbbstation.text.written import natural, repeats_in_order


@dataclass(frozen=True)
class One:
    test: str
    direction: str
    repeat: int


def test_names_are_sorted_as_people_count():
    assert sorted(["w10", "w9", "w9a", "a"], key=natural) == ["a", "w9", "w9a", "w10"]


def test_repeats_take_each_others_places_and_no_others():
    given = [One("b", "cw", 1), One("a", "ccw", 1), One("a", "ccw", 10), One("a", "cw", 3), One("a", "ccw", 2)]
    assert repeats_in_order(given) == (given[0], given[1], given[4], given[3], given[2])


def test_faults_of_files_are_listed_as_people_count():
    error = InputError([Problem(f"a-ccw-{k}.csv", line, 0, "is cut off") for k in (10, 1, 2) for line in (11, 3)])
    assert [(one.file, one.line) for one in error.problems] == [
        (f"a-ccw-{k}.csv", line) for k in (1, 2, 10) for line in (3, 11)
    ]
