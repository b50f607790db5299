"""Compare the machines of a fleet."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts import of_facts
from dbbstation.machine.geometry import NOT_PREDICTED, differences, in_words
from dbbstation.results.fleet import FleetComparison, Scored, SharedCause
from dbbstation.sisters.unlike import FEWEST, held_against_sisters
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.machine.geometry import Difference, Machine
    from dbbstation.results.fleet import FleetFound, FleetValue
    from dbbstation.sisters.unlike import Sisters

MOST_NAMED = 5
"""Greatest number of machines that a note names."""

CLAIMED = frozenset({"identified", "happened"})
"""Verdicts that claim a cause."""


@dataclass(frozen=True, eq=False)
class Sister:
    """One machine, represented by its last session."""

    name: str
    session: str
    machine: Machine
    found: FleetFound


_Key = tuple[str, ...]


def compared(sisters: Sequence[Sister], false_alarms: float) -> FleetComparison:
    """Compare machines."""
    kinds, notes = _geometries(sisters)
    rows: dict[_Key, dict[int, FleetValue]] = defaultdict(dict)
    for place, sister in enumerate(sisters):
        for value in sister.found.values:
            kind = "" if value.kind == "figure" else str(kinds[place])
            rows[value.kind, value.quantity, value.of, value.unit, kind][place] = value
    keys = list(rows)
    numbers, u = (np.full((len(keys), len(sisters)), np.nan) for _ in range(2))
    for row, key in enumerate(keys):
        for place, value in rows[key].items():
            number, sure = value.value, value.uncertainty or 0.0
            if value.logarithmic and number > 0.0:
                number, sure = float(np.log(number)), sure / number
            numbers[row, place], u[row, place] = number, sure
    held = held_against_sisters(numbers, u, false_alarms)
    scored = [
        _scored(sisters[place], value, held, (row, place), len(rows[key]) - 1)
        for row, key in enumerate(keys)
        for place, value in rows[key].items()
    ]
    enough = sum(len(of) >= FEWEST for of in rows.values())
    notes += _alone([key for key in keys if len(rows[key]) < FEWEST])
    return FleetComparison(
        false_alarms=false_alarms,
        machines=len(sisters),
        quantities=enough,
        scored=tuple(sorted(scored, key=lambda one: one.machine)),
        causes=_causes(sisters),
        notes=tuple(notes),
    )


def _scored(sister: Sister, value: FleetValue, held: Sisters, at: tuple[int, int], others: int) -> Scored:
    middle, scatter, score, smallest = (
        float(of[at]) for of in (held.middle, held.scatter, held.score, held.smallest_seen)
    )
    if value.logarithmic:
        middle = float(np.exp(middle))
        scatter, smallest = middle * scatter, middle * float(np.expm1(min(smallest, _LARGEST_LOG)))
    found = (middle, scatter, score, smallest) if np.isfinite(score) else (None,) * 4
    by_others = dict(zip(("usual", "scatter", "score", "smallest_seen"), found, strict=True))
    further = {"machine": sister.name, "session": sister.session, "sisters": others, "unlike": bool(held.unlike[at])}
    return of_facts(Scored, value, **further, **by_others)


_LARGEST_LOG = 300.0
"""Largest logarithm that is converted to a number. With three machines no difference is detectable, and the logarithm
is larger."""


def _geometries(sisters: Sequence[Sister]) -> tuple[list[int], list[str]]:
    first: list[int] = []
    kinds: list[int] = []
    for place, sister in enumerate(sisters):
        same = (k for k, other in enumerate(first) if not _unlike(sisters[other].machine, sister.machine))
        kind = next(same, len(first))
        if kind == len(first):
            first.append(place)
        kinds.append(kind)
    notes = []
    for kind, place in enumerate(first[1:], start=1):
        names = [sister.name for sister, of in zip(sisters, kinds, strict=True) if of == kind]
        unlike = in_words(_unlike(sisters[first[0]].machine, sisters[place].machine), 2)
        notes.append(
            f"{listed(names, MOST_NAMED)}: another nominal machine than {sisters[first[0]].name} ({unlike}): compared with the others in "
            "figures only, parameters are departures from the nominal machine"
        )
    return kinds, notes


def _unlike(one: Machine, other: Machine) -> tuple[Difference, ...]:
    return tuple(found for found in differences(one, other) if found.first_key not in NOT_PREDICTED)


def _alone(keys: Sequence[_Key]) -> list[str]:
    if not keys:
        return []
    names = list(dict.fromkeys(key[1] for key in keys))
    return [f"fewer than {FEWEST} machines have these, which are not compared: {listed(names, MOST_NAMED)}"]


def _causes(sisters: Sequence[Sister]) -> tuple[SharedCause, ...]:
    there: dict[str, dict[str, float]] = defaultdict(dict)
    asked: dict[str, int] = defaultdict(int)
    for sister in sisters:
        for cause in sister.found.causes:
            asked[cause.name] += 1
            if cause.verdict in CLAIMED:
                there[cause.name][sister.name] = 1.0 if cause.probability is None else cause.probability
    return tuple(
        SharedCause(
            name=name,
            found_in=tuple(of),
            machines=asked[name],
            false_claims=sum(max(0.0, 1.0 - probability) for probability in of.values()),
        )
        for name, of in sorted(there.items(), key=lambda pair: (len(pair[1]), pair[0]))
    )
