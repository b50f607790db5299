"""Predict actual poses for commanded ones, with uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from dbbstation.control.commands import nominal_commands
from dbbstation.errors import ArgumentError
from dbbstation.files.formats.number_language import PLAIN
from dbbstation.files.formats.pose_table import PoseTable, read_poses, write_poses
from dbbstation.files.inputs import in_a_book
from dbbstation.files.provenance import from_python, refuse_existing_table
from dbbstation.files.recordings.table_csv import given_table
from dbbstation.machine.travel import check_travel
from dbbstation.model.uncertainty import predicted_poses
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.prediction import NAMES, PredictionResult, prediction_result
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.models import model_of
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.files.provenance import Provenance
    from dbbstation.files.recordings.table_csv import Columns
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.models import Model
    from dbbstation.tasks.telling import Progress

STAGES = {"reading": 0, "travel": 32, "predicting": 48, "writing": 67}
"""Stages of a prediction, and the share of its time that has passed by then [%]."""

AXES = 6


@in_a_book
def predict(
    model: Model,
    poses: ArrayLike | Columns | str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    force: bool = False,
    numbers: NumberLanguage = PLAIN,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] = from_python,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
) -> PredictionResult:
    """Predict the actual poses for commanded ones, with standard uncertainties.

    Args:
        model: a model, its file, or the result of `calibrate` or `diagnose`.
        poses: commanded X, Y, Z [mm] and A, B, C [deg], shape (n, 6) or (6,), a DataFrame or CSV file with x_mm, y_mm, z_mm, a_deg, b_deg,
            c_deg.
        out: CSV file; None: none.
        force: overwrite it.
        numbers: notation of a CSV file.
        known: error sources by name, for a file; None: those of package and installed packages.
        provenance: called after all reading.
        progress: called with each stage.
        stop: asked at each stage.

    Raises:
        InputError: faults of files.
        TravelError: a pose outside the machine's travel.
        KinematicsError: a pose that the actual machine cannot take.
        ModelError: a source needs more than poses.
        OutputError: `out` exists without `force`.
        ArgumentError: another shape.
        StoppedError: `stop` returned True.
    """
    telling = Telling(progress, stop)
    if out is not None:
        refuse_existing_table(Path(out), force=force)
    identified = model_of(model, known)
    telling.stage("reading poses")
    table, where = _table(poses, numbers)
    telling.stage("travel")
    check_travel(identified.model.machine, table.poses, where=where)
    commands = nominal_commands(identified.model.machine, table.poses, known_sources() if known is None else known)
    actual, uncertainty_mm = predicted_poses(identified, commands, telling.counted("predicting pose"))
    if out is not None:
        telling.stage("writing")
        write_poses(
            Path(out),
            actual,
            uncertainty_mm,
            table.others,
            provenance(),
            why_unknown=identified.why_unknown,
            warning="; ".join(model_warnings(identified)),
            force=force,
        )
    return prediction_result(identified, table.poses, actual, uncertainty_mm, None if out is None else str(out))


def _table(poses: ArrayLike | Columns | str | PathLike[str], numbers: NumberLanguage) -> tuple[PoseTable, str]:
    if isinstance(poses, str | PathLike):
        return read_poses(Path(poses), numbers), str(poses)
    if hasattr(poses, "columns") or isinstance(poses, Mapping):
        table = given_table(cast("Columns", poses), NAMES, "poses")
        others = {name: list(table.cells[name]) for name in table.names if name not in NAMES}
        return PoseTable(np.column_stack([table.values[name] for name in NAMES]), others), "poses"
    given = np.atleast_2d(np.asarray(cast("ArrayLike", poses), dtype=np.float64))
    if given.ndim != 2 or given.shape[1] != AXES or not np.isfinite(given).all():  # noqa: PLR2004 - rows and columns
        raise ArgumentError(
            "poses", f"poses are rows of six finite numbers, X, Y, Z [mm], A, B, C [deg], not {given.shape}"
        )
    return PoseTable(given, {}), "poses"
