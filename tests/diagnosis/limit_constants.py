"""How much the answers of sessions hang on constants of the comparison: each is moved, and the sets that are found are compared.

python -m tests.diagnosis.limit_constants FOLDER --out docs/validation/limit-constants.json
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest import mock

from dbbstation.diagnosis import explain, shapes, unmodelled
from dbbstation.diagnosis.diagnose import sectors_for, thinned, usable_sources, without_doubtful
from dbbstation.sources.causes import servo_lag
from dbbstation.sources.laws import unlike_struts
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.diagnosed import default_candidates
from dbbstation.tasks.load import load_sessions

MOVED: dict[str, tuple[Any, str, tuple[Any, ...], int]] = {
    "IDLE": (explain, "IDLE", (0.7, 0.97), 4),
    "ROUGH": (explain, "ROUGH", (0.03, 0.3), 92),
    "HALF": (unmodelled, "HALF", (0.25, 1.0), 4),
    "WALK_STEPS": (shapes, "WALK_STEPS", (3, 12), 2),
    "STICKING_MM": (shapes, "STICKING_MM", (0.02, 0.08), 23),
    "STICKING_HALVES": (shapes, "STICKING_HALVES", (4, 6), 23),
    "UNLIKE": (unlike_struts, "UNLIKE", (1.5, 3.0), 32),
    "HALVES": (unlike_struts, "HALVES", ((0.71, 1.41), (0.35, 0.5, 0.71, 1.41, 2.0, 2.8)), 4),
    "USUAL_MS": (servo_lag, "USUAL_MS", (0.1, 1.0), 52),
    "OF_SECOND": (servo_lag, "OF_SECOND", (0.25, 1.0), 164),
}
"""By constant: its module and name, other values, and the session on which it decides most."""


def found(folder: Path) -> tuple[str, float, float]:
    """Named causes with their laws and number of unmodelled effects; the residual [µm]; processor time [s]."""
    recorded, began = load_sessions([folder]), time.process_time()
    runs = [thinned(one, sectors_for(len(recorded.observations))) for one in recorded.observations]
    known = known_sources()
    usable, _ = usable_sources(recorded.machine, runs, sources_named(default_candidates(known), known))
    explained = without_doubtful(explain.explain(recorded.machine, runs, usable, lambda _: None))
    settled = explained.settled
    named = sorted(f"{m.cause.name} ({m.variant.law})" for m in settled.members)
    others = len(settled.best.members) - len(named)
    said = f"{', '.join(named) or 'no cause'}; {others} without a name"
    return said, 1e3 * settled.left.rms, time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.diagnosis.limit_constants", description=__doc__.splitlines()[0]
    )
    parser.add_argument("folder", type=Path, help="that `python -m tests.plant.foreign make` wrote")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", choices=MOVED, help="move this one; keep the others' stored figures")
    given = parser.parse_args()
    columns: dict[str, tuple[str, float, float]] = {}
    if given.only:
        columns = {key: tuple(cells) for key, cells in json.loads(given.out.read_text("utf-8"))["figures"].items()}
    for name in [given.only] if given.only else MOVED:
        module, attribute, values, session = MOVED[name]
        usual = getattr(module, attribute)
        for value in (usual, *values):
            told = ", ".join(f"{one:g}" for one in (value if isinstance(value, tuple) else (value,)))
            key = f"session {session}, as it is" if value == usual else f"session {session}, {name} {told}"
            if key in columns:
                continue
            with mock.patch.object(module, attribute, value):
                columns[key] = found(given.folder / f"{session:04d}")
            sys.stderr.write(f"{key}: {columns[key]}\n")
    kept = {
        "question": "Do answers hang on the constants of the comparison?",
        "data": "Five sessions of `python -m tests.plant.foreign`, seed 48, and two of seed 53 with `--wide` (92, 164); usual values are 0.9, 0.1, 0.5, 6, 0.04 mm, 5, 2, 0.5 to 2, 0.3 ms and 0.5.",
        "command": "python -m tests.diagnosis.limit_constants FOLDER",
        "date": datetime.now(UTC).date().isoformat(),
        "seed": 48,
        "limits": "One session for each constant, without held-out tests.",
        "columns": ["found", "left beyond noise / µm", "processor time / s"],
        "figures": {key: [said, round(left, 2), round(spent)] for key, (said, left, spent) in columns.items()},
    }
    given.out.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
