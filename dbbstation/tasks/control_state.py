"""Parse the state of a control that a program does not contain: offsets, tool lengths, angles."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


def numbers_of(text: str, counts: set[int]) -> list[float]:
    """Return the numbers of a text such as `X,Y,Z`; their count must be among `counts`.

    Raises:
        ValueError: the text has another count or is no list of numbers.
    """
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(abs(number) < float("inf") for number in numbers):
        wanted = " or ".join({1: "one number", 3: "three", 6: "six numbers with commas"}[one] for one in sorted(counts))
        raise ValueError(f"{text!r} is not {wanted}")
    return numbers


def named_numbers(texts: Iterable[str], counts: set[int]) -> dict[str, list[float]]:
    """Return the numbers of each `NAME=1,2,3`; errors as for `numbers_of`."""
    pairs = [text.partition("=") for text in texts]
    for text in (name for name, equals, _ in pairs if not equals):
        raise ValueError(f"{text!r} lacks its name: write {'1=52.1' if counts == {1} else 'G54=20,-35,-1000'}")
    return {name.strip().upper(): numbers_of(numbers, counts) for name, _, numbers in pairs}


def lengths_by_tool(texts: Iterable[str]) -> dict[int, float]:
    """Return lengths [mm] by tool number from each `TOOL=MM`; errors as for `numbers_of`."""
    found = {}
    for name, (length,) in named_numbers(texts, {1}).items():
        number = name.lstrip("TH")
        if not number.isdecimal():
            raise ValueError(f"{name!r} is not the number of a tool")
        found[int(number)] = length
    return found
