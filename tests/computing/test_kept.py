"""Results that are kept as long as an object lives."""

from __future__ import annotations

from dbbstation.computing.kept import once_for_each


class Thing:
    pass


def test_each_object_and_each_way_of_asking_has_its_own_result():
    asked = []

    @once_for_each
    def told(thing, *words, mark=""):
        asked.append((thing, words, mark))
        return len(asked)

    one, other = Thing(), Thing()
    every = [told(one), told(one, "a"), told(one, "a", mark="!"), told(one, "a", mark="?"), told(other, "a")]
    assert every == [1, 2, 3, 4, 5]
    assert [told(one), told(one, "a", mark="!"), told(other, "a")] == [1, 3, 5]
    assert len(asked) == 5
