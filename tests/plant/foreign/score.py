"""Verdicts of commits against what was put in: answers, names, values, residuals, time and memory."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.diagnosis.foreign_levels import levels_of
from tests.plant.foreign.judge import TRUE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

NAMED = ("identified", "happened")
WITHIN_U = 3.0
"""A value is right where it lies within so many of its standard uncertainties: one of 370 does not by chance."""
SILENT = ("clean", "walk", "stick-slip")
"""Kinds of session in which nothing of the list is."""


def scored(
    folder: Path, commits: Sequence[str], sessions: Sequence[str], seed: int, former: Path | None = None
) -> dict[str, Any]:
    """Score what each commit said; sessions of a former score stand in for verdicts that are gone."""
    earlier = {} if former is None else _read(former)
    if earlier and earlier["seed"] != seed:
        raise ValueError(f"{former} is of seed {earlier['seed']}, not {seed}")
    rows: dict[str, dict[str, Any]] = {}
    for commit in commits:
        kept = earlier.get("commits", {}).get(commit, {"each": {}})["each"]
        rows[commit] = {name: kept[name] for name in sessions if name in kept}
        for name, verdict in _verdicts(folder / "verdicts" / commit, sessions).items():
            rows[commit][name] = compare(_read(folder / "answers" / f"{name}.json"), verdict)
        for name, verdict in _verdicts(folder / "verdicts" / f"{commit}{TRUE}", sessions).items():
            if name in rows[commit] and (least := _held_out_um(verdict)):
                rows[commit][name]["held_out_over_true"] = rows[commit][name]["held_out_um"] / least
    shared = [name for name in sessions if all(name in of for of in rows.values())]
    return {
        "question": "Do causes whose laws are not the textbook's keep their names, beside what is on no list?",
        "command": "python -m tests.plant.foreign make|run|score FOLDER, and --former of commit 0c608670",
        "seed": seed,
        "date": datetime.now(UTC).date().isoformat(),
        "commits": {commit: _figures(of) for commit, of in rows.items()},
        "sessions_that_all_have": {commit: _figures({k: of[k] for k in shared}) for commit, of in rows.items()},
    }


def as_table(figures: Mapping[str, Any], limits: str) -> dict[str, Any]:
    """The figures as the validation page takes them: a column a commit, over all its sessions and over those that all have."""
    groups = {"": figures["commits"], ", same sessions": figures["sessions_that_all_have"]}
    columns = {f"{commit}{which}": one for which, of in groups.items() for commit, one in of.items()}
    of = [one for one in columns.values() if one["sessions"]]
    rows = {
        "sessions": [one["sessions"] for one in of],
        "without any answer": [len(one["without_answer"]) for one in of],
        "listed causes that were named": [f"{one['named_right']} of {one['listed']}" for one in of],
        "sessions with a wrong name": [len(one["wrong_names"]) for one in of],
        "nothing listed is there, and nothing is named": [
            f"{sum(int(text.split()[0]) for text in one['silent'].values())} of "
            f"{sum(int(text.split()[-1]) for text in one['silent'].values())}"
            for one in of
        ],
        "values within 3u": [f"{one['values_within_3u']} of {one['values']}" for one in of],
        "median residual with causes / µm": [round(one["residual_um_median"]["after"], 2) for one in of],
        "median processor time / s": [round(one["processor_s"]["median"]) for one in of],
        "most processor time / s": [round(one["processor_s"]["most"]) for one in of],
        "most memory / MB": [one["memory_mb_most"] for one in of],
    }
    head = {key: figures[key] for key in ("question", "command", "date", "seed")}
    data = "Sessions of two simulated robots whose laws are not the program's own."
    names = [name for name, one in columns.items() if one["sessions"]]
    return {**head, "data": data, "limits": limits, "columns": names, "figures": rows}


def compare(answer: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, Any]:
    """One session: what was put in, what was named, rightly or not, and how well its values fit."""
    listed = {effect["name"]: effect["amplitudes"] for effect in answer["effects"] if effect["listed"]}
    summary = verdict.get("summary") or {"sources": [], "mismatch": False, "residual_rms_um": {}}
    by_name = {source["name"]: source for source in summary["sources"]}
    classes = {name: {name, *by_name[name].get("class", ())} for name in by_name}
    named = [name for name, source in by_name.items() if source["verdict"] in NAMED]
    unsure = {n: {n, *s["ambiguous_with"]} for n, s in by_name.items() if s["verdict"] == "ambiguous"}
    wrong = [name for name in named if not classes[name] & listed.keys()]
    wrong += [f"({name})" for name, group in unsure.items() if not group & listed.keys()]
    residual = summary["residual_rms_um"]
    testable = [name for name, source in by_name.items() if source["verdict"] != "not-testable"]
    return {
        "kind": answer["kind"],
        "robot": answer["circumstances"]["machine"],
        "put_in": [_told(effect) for effect in answer["effects"]],
        "listed": len(listed),
        "named": named,
        "unsure": sorted(unsure),
        "right": [name for name in listed if any(name in classes[one] for one in named)],
        "right_or_unsure": [n for n in listed if any(n in s for s in [*(classes[k] for k in named), *unsure.values()])],
        "wrong": wrong,
        "without_answer": bool(summary["mismatch"]) and not testable and residual["before"] == residual["after"],
        "values_u": {
            f"{name} {key}": z for name in named if name in listed for key, z in _off_u(listed[name], by_name[name])
        },
        "residual_um": residual,
        "held_out_um": _held_out_um(verdict),
        "levels": levels_of(answer, summary),
        "silent": not named and not unsure,
        "error": verdict.get("error", ""),
        "processor_s": round(verdict["processor_s"], 1),
        "memory_mb": round(verdict["memory_mb"]),
    }


def _held_out_um(verdict: Mapping[str, Any]) -> float:
    return float((verdict.get("summary", {}).get("held_out_rms_um") or {}).get("after") or 0.0)


def _off_u(amplitudes: Mapping[str, float], source: Mapping[str, Any]) -> Iterable[tuple[str, float]]:
    for key, value in amplitudes.items():
        found = source["parameters"].get(key, {})
        if found.get("uncertainty"):
            yield key, round((found["value"] - value) / found["uncertainty"], 2)


def _told(effect: Mapping[str, Any]) -> str:
    forms = ", ".join((effect.get("deviation") or {}).get("forms", ()))
    return f"{effect['name']} {effect['largest_amplitude']:.3g} {effect['unit']}" + (f" ({forms})" if forms else "")


def _figures(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    causes = [row for row in rows.values() if row["kind"] not in SILENT]
    values = np.abs([z for row in rows.values() for z in row["values_u"].values()])
    seconds = [row["processor_s"] for row in rows.values()]
    return {
        "sessions": len(rows),
        "broken": [name for name, row in rows.items() if row["error"]],
        "without_answer": [name for name, row in rows.items() if row["without_answer"]],
        "names_given": sum(len(row["named"]) for row in rows.values()),
        "wrong_names": {name: row["wrong"] for name, row in rows.items() if row["wrong"]},
        "listed": sum(row["listed"] for row in causes),
        "named_right": sum(len(row["right"]) for row in causes),
        "named_right_or_in_an_ambiguity": sum(len(row["right_or_unsure"]) for row in causes),
        "values": len(values),
        "values_within_3u": int((values < WITHIN_U).sum()),
        "residual_um_median": {
            at: float(np.median([row["residual_um"][at] for row in causes if row["residual_um"]])) if causes else None
            for at in ("before", "after")
        },
        "silent": {
            kind: f"{sum(row['silent'] for row in of)} of {len(of)}"
            for kind in SILENT
            if (of := [row for row in rows.values() if row["kind"] == kind])
        },
        "processor_s": {"median": float(np.median(seconds)), "most": max(seconds)} if seconds else None,
        "memory_mb_most": max((row["memory_mb"] for row in rows.values()), default=None),
        "each": rows,
    }


def _verdicts(folder: Path, sessions: Sequence[str]) -> dict[str, dict[str, Any]]:
    return {name: _read(folder / f"{name}.json") for name in sessions if (folder / f"{name}.json").exists()}


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8")))
