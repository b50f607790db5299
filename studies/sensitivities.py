"""Answers with their deciding constants halved and doubled."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from dbbstation.diagnosis.compare.comparison import compare
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.facts.serialise import plain
from dbbstation.files.recordings.drive_csv import read_drive
from dbbstation.results.comparison import comparison_result
from dbbstation.results.drive import drive_result
from dbbstation.results.mismatch import mismatch_result
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.system.processes import each
from dbbstation.tasks.diagnosed import default_candidates
from dbbstation.tasks.load import load_sessions
from dbbstation.tasks.tables import TableOptions, load_tables

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence
    from pathlib import Path


@dataclass(frozen=True)
class Constant:
    """A deciding constant.

    Attributes:
        module: below `dbbstation`.
        others: to try; empty: half and double.
    """

    module: str
    name: str
    others: tuple[float, ...] = ()

    @property
    def value(self) -> float:
        """Return its value."""
        return getattr(import_module(f"dbbstation.{self.module}"), self.name)

    @property
    def tried(self) -> tuple[float, ...]:
        """Return values to try, integers if it is one."""
        own = self.value
        if self.others:
            return self.others
        return (max(own // 2, 1), 2 * own) if isinstance(own, int) else (own / 2.0, 2.0 * own)


ENGINE = (
    Constant("inference.alternatives", "EQUIVALENT", (0.998, 0.9995)),
    Constant("inference.bank", "LEAST_LEFT"),
    Constant("inference.settle", "BETTER"),
)
"""Of whatever compares sets of causes. Of a cosine, what it lacks of one is halved and doubled."""

SAID = (
    Constant("inference.alternatives", "MOST_CANCELS", (0.35, 0.7)),
    Constant("inference.levels", "MOST_PUSHES"),
)
"""Of what is said of what was found in tables and drives. Of a root, its square is halved and doubled."""

DRIVE = (
    *ENGINE,
    *SAID,
    Constant("diagnosis.drive.channel", "METHOD_SHARE"),
    Constant("diagnosis.drive.channel", "PERIODS_IN_TRAVEL"),
    Constant("diagnosis.drive.channel", "WAVE_STEP"),
    Constant("diagnosis.drive.channel", "STRONGEST"),
    Constant("diagnosis.drive.fit", "METHOD_U_SHARE"),
    Constant("diagnosis.drive.signals", "ACCELERATING_SHARE"),
    Constant("diagnosis.drive.signals", "MOVING_SHARE"),
    Constant("diagnosis.drive.signals", "LEAST_SHARE", (0.25, 0.75)),
    Constant("diagnosis.drive.channel", "NEAR_STANDSTILL"),
    Constant("diagnosis.drive.signals", "MOST"),
    Constant("diagnosis.drive.pulses", "APART"),
)
"""Of `drive`."""

COMPARE = (
    *ENGINE,
    Constant("diagnosis.compare.causes", "HARDLY_DIFFERENT"),
    Constant("diagnosis.compare.channel", "CHANGE"),
    Constant("diagnosis.compare.set_up", "JIG_MM"),
    Constant("calibration.fit.methods", "CENTRED_MM"),
    Constant("diagnosis.compare.comparison", "CENTRED_SIGMA"),
    Constant("diagnosis.compare.comparison", "CENTRED_SHAPE"),
)
"""Of `compare`."""

SEARCHED = (
    Constant("inference.bank", "HARDLY_TAKEN", (0.9, 0.975)),
    Constant("inference.bank", "LARGE"),
    Constant("inference.bent", "DEPARTS"),
    Constant("inference.bent", "AT_ONCE", (0.25, 0.75)),
    Constant("inference.bent", "MADE", (0.8, 0.95)),
    Constant("inference.bent", "WIDEST", (0.9, 0.975)),
    Constant("inference.channel", "LARGEST"),
    Constant("inference.channel", "CONTINUOUS"),
    Constant("inference.coloured", "FEWEST_INDEPENDENT"),
    Constant("inference.coloured", "SHORTEST_OF_ALL"),
    Constant("inference.looks", "NEIGHBOUR", (0.4, 0.85)),
    Constant("inference.model_comparison", "MOST_SLACK"),
    Constant("inference.patterns", "CURVES", (5, 14)),
    Constant("inference.patterns", "DISTINCT"),
    Constant("inference.patterns", "WALK_STEPS"),
    Constant("inference.patterns", "WAVE_SHARE"),
    Constant("inference.stretches", "INDEPENDENT"),
    Constant("inference.stretches", "SHORTEST"),
)
"""Of the search of a table's channel and of its noise. Of a share near one, what it lacks of one is halved and doubled."""

JUDGED = (
    Constant("inference.alternatives", "EVEN", (0.25, 0.75)),
    Constant("inference.channel", "BEYOND"),
    Constant("inference.channel", "NEGATIVE_SIGMA"),
    Constant("inference.folds", "ENOUGH_BLOCKS"),
    Constant("inference.folds", "LEAST_PARTS"),
    Constant("inference.folds", "WIDEST_GAP", (0.25, 0.75)),
    Constant("inference.followed", "LEAST_ADDED"),
    Constant("inference.followed", "MOST_PARTS", (0.25, 0.75)),
    Constant("inference.left_over", "BINS"),
    Constant("inference.left_over", "FEWEST"),
    Constant("inference.left_over", "SIGNIFICANT"),
    Constant("inference.levels", "ONE_SIZE", (0.998, 0.9995)),
    Constant("inference.levels", "OUT"),
    Constant("inference.levels", "PARTS_WITH_GAIN", (0.55, 0.85)),
    Constant("inference.levels", "SEEN_WORSE"),
    Constant("inference.levels", "SURE", (0.9, 0.975)),
    Constant("inference.levels_of", "CARRIES", (0.25, 0.75)),
    Constant("inference.levels_of", "DETERMINED", (0.8, 0.95)),
    Constant("inference.levels_of", "MARGIN", (1.0, 1.5)),
    Constant("inference.levels_of", "POWER", (0.8, 0.95)),
    Constant("inference.levels_of", "SLOW"),
)
"""Of verdicts and answers from probabilities, held-out parts and residuals."""

TABLE = (
    *ENGINE,
    Constant("diagnosis.table.data", "REFITTED"),
    Constant("diagnosis.table.mismatch", "FAR_STATED"),
    *SAID,
    *SEARCHED,
    *JUDGED,
)
"""Of `mismatch`."""


@dataclass(frozen=True)
class Variation:
    """One question.

    Attributes:
        constant: that is changed; None: none.
        paths: a drive recording, a table, or sessions A and B.
        force_per_ampere: [N/A]; None: the recording has a force.
        columns: measured and simulated column of a table, else None.
    """

    constant: Constant | None
    value: float
    paths: tuple[Path, ...]
    force_per_ampere: float | None = None
    columns: tuple[str, str] | None = None

    @property
    def data(self) -> str:
        """What it was asked of."""
        return " and ".join(path.stem for path in self.paths)


@dataclass(frozen=True)
class Answer:
    """One answer.

    Attributes:
        verdicts: by name.
        values: value and standard uncertainty by parameter.
    """

    verdicts: dict[str, str]
    values: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Change:
    """The effect of another value on one answer.

    Attributes:
        constant: with its module.
        parameter: may be empty.
    """

    constant: str
    own: float
    tried: float
    data: str
    verdicts: tuple[str, ...]
    largest: float
    parameter: str


def study(
    drives: Sequence[tuple[Path, float | None]],
    pairs: Sequence[tuple[Path, Path]],
    jobs: int,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
    only: Collection[str] = (),
    tables: Sequence[tuple[Path, str, str]] = (),
) -> list[Change]:
    """Ask for every answer with every constant as is, halved and doubled.

    Args:
        drives: with force per ampere [N/A].
        pairs: sessions A and B.
        only: constants to vary; empty for all.
        tables: with measured and simulated column.

    Raises:
        StationError: a recording cannot be read or judged.
    """
    asked: list[tuple[Variation, tuple[Constant, ...]]] = [
        *((Variation(None, 0.0, (path,), scale), DRIVE) for path, scale in drives),
        *((Variation(None, 0.0, pair), COMPARE) for pair in pairs),
        *((Variation(None, 0.0, (path,), columns=(one, other)), TABLE) for path, one, other in tables),
    ]
    variations = [
        replace(as_it_is, constant=constant, value=value)
        for as_it_is, constants in asked
        for constant, value in [
            (None, 0.0),
            *(
                (constant, value)
                for constant in constants
                if not only or constant.name in only
                for value in constant.tried
            ),
        ]
    ]
    answers: dict[Variation, Answer] = {}
    for place, answer in each(answer_to, variations, jobs):
        answers[variations[place]] = answer
        progress(len(answers), len(variations))
    return [
        _change(
            variation,
            variation.constant,
            answers[variation],
            answers[replace(variation, constant=None, value=0.0)],
        )
        for variation in variations
        if variation.constant is not None
    ]


def answer_to(variation: Variation) -> Answer:
    """Return the answer with another constant, restored afterwards."""
    ask = partial(_drive_answer, variation)
    if variation.columns is not None:
        ask = partial(_table_answer, variation.paths[0], *variation.columns)
    elif len(variation.paths) > 1:
        ask = partial(_pair_answer, *variation.paths)
    constant = variation.constant
    if constant is None:
        return ask()
    own = constant.value
    # Modules that import it have it under the same name: a constant of another module of that name is another object or number.
    holders = [
        module
        for name, module in sys.modules.items()
        if name.startswith("dbbstation.") and getattr(module, constant.name, None) is own
    ]
    for module in holders:
        setattr(module, constant.name, variation.value)
    try:
        return ask()
    finally:
        for module in holders:
            setattr(module, constant.name, own)


def _drive_answer(variation: Variation) -> Answer:
    recording = read_drive(variation.paths[0]).recording(variation.force_per_ampere)
    summary = plain(drive_result(identify([recording], list(known_drive_sources().values()))))
    base = {name: one for name, one in summary["parameters"].items() if one["identifiable"]}
    return _and_whether_cancelling(_answer(summary["sources"], _values(base)), summary)


def _pair_answer(a: Path, b: Path) -> Answer:
    one, other = load_sessions([a]), load_sessions([b])
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(one.machine, [*one.observations, *other.observations], candidates)
    summary = plain(comparison_result(compare(one.machine, one.observations, other.observations, usable, lacking)))
    answer = _answer(summary["causes"], {})
    answer.verdicts["the sessions"] = "differ" if summary["differ"] else "do not differ"
    return answer


def _table_answer(path: Path, measured: str, simulated: str) -> Answer:
    table = load_tables([path], TableOptions(measured, simulated)).table
    summary = plain(mismatch_result(find_mismatch(table)))
    answer = _answer(summary["findings"], _values({one["name"]: one["after"] for one in summary["parameters"]}))
    for one in summary["parameters"]:
        answer.verdicts[f"{one['name']}, as far as is known of it"] = "beyond" if one["far"] else "within"
    return _and_whether_cancelling(answer, summary)


def _and_whether_cancelling(answer: Answer, summary: dict[str, Any]) -> Answer:
    answer.verdicts["effects"] = "cancel each other" if summary["cancelling"] else "do not cancel"
    return answer


def _answer(causes: Sequence[dict[str, Any]], values: dict[str, tuple[float, float]]) -> Answer:
    for cause in causes:
        if cause["verdict"] in {"identified", "happened"}:
            own = cause.get("parameters") or cause.get("values") or {}
            values |= _values({f"{cause['name']} {name}": one for name, one in own.items()})
    return Answer({cause["name"]: cause["verdict"] for cause in causes}, values)


def _values(numbers: dict[str, dict[str, Any]]) -> dict[str, tuple[float, float]]:
    return {name: (one["value"], one["uncertainty"]) for name, one in numbers.items() if one["uncertainty"] is not None}


def _change(variation: Variation, constant: Constant, now: Answer, before: Answer) -> Change:
    verdicts = tuple(
        f"{name}: {verdict} -> {now.verdicts.get(name, 'not asked')}"
        for name, verdict in before.verdicts.items()
        if now.verdicts.get(name) != verdict
    )
    shifts = {
        name: abs(now.values[name][0] - value) / uncertainty
        for name, (value, uncertainty) in before.values.items()
        if name in now.values and uncertainty > 0.0
    }
    most = max(shifts, key=lambda name: shifts[name], default="")
    return Change(
        constant=f"{constant.module} {constant.name}",
        own=constant.value,
        tried=variation.value,
        data=variation.data,
        verdicts=verdicts,
        largest=shifts.get(most, 0.0),
        parameter=most,
    )
