"""Predict actual poses for commanded ones, with uncertainties."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from dbbstation.errors import ArgumentError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from typing import Unpack

    from numpy.typing import ArrayLike

    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.files.recordings.pose_csv import PoseTable
    from dbbstation.files.recordings.table_csv import Columns
    from dbbstation.results.prediction import PredictionResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks

    Poses = ArrayLike | Columns | str | PathLike[str]
else:
    Poses = Any

STAGES = {"reading": 0, "travel": 40, "predicting": 60}
"""Stages of a prediction, and the share of its time that has passed at each begin [%]."""

AXES = 6


@task("predict", label="prediction", stages=STAGES)
def predict(
    model: o.Model,
    poses: Annotated[
        Poses,
        Option(
            "CSV file; scripts may give rows of X, Y, Z [mm], A, B, C [deg], or a DataFrame.",
            kind="argument",
            metavar="POSES.csv",
        ),
    ],
    *,
    source_files: o.SourceFiles = (),
    decimal: o.Decimal = None,
    separator: o.Separator = None,
    known: Mapping[str, ErrorSource] | None = None,
    **hooks: Unpack[Hooks],
) -> PredictionResult:
    r"""Predict the actual poses for commanded ones, with standard uncertainties.

    Input columns: x_mm,y_mm,z_mm,a_deg,b_deg,c_deg. The output has the actual pose in these columns, and standard
    uncertainties in u_x_mm,u_y_mm,u_z_mm. The output always has decimal dots, and commas between columns. Further
    columns are copied. If an uncertainty depends on undetermined parameters, its cell is empty, and u_not_known_because
    has the reason. A joint_tolerance_mm in the machine file of the calibration bounds this uncertainty.

    \b
    Examples:
      dbbstation predict --model model.yaml commanded.csv --table actual.csv
      dbbstation predict --model model.yaml poses.csv --decimal , --table actual.csv

    Args:
        known: error sources by name; None: those of package, installed packages and `source_files`.

    Returns:
        Actual poses in memory; `save` writes them as CSV.

    Raises:
        ArgumentError: a value that it does not take, or poses of another shape.
        InputError: faults of files.
        TravelError: a pose outside the machine's travel.
        KinematicsError: a pose that the actual machine cannot take.
        ModelError: a source needs more than poses.
        StoppedError: `stop` returned True.
    """
    from dbbstation.control.commands import nominal_commands
    from dbbstation.files.formats.number_language import PLAIN, number_language
    from dbbstation.machine.travel import check_travel
    from dbbstation.model.identified import predicted_poses
    from dbbstation.results.model_warnings import model_warnings
    from dbbstation.results.prediction import prediction_result
    from dbbstation.tasks.models import model_of, sources_known

    telling = Telling(**hooks)
    every = sources_known(known, source_files)
    identified = model_of(model, every)
    machine = identified.model.machine
    telling.note(*model_warnings(identified))
    telling.stage("reading poses")
    table, where = _table(poses, number_language(decimal, separator) or PLAIN)
    telling.stage("travel")
    check_travel(machine, table.poses, where=where)
    commands = nominal_commands(machine, table.poses, every)
    actual, uncertainty_mm = predicted_poses(identified, commands, telling.counted("predicting pose"))
    return prediction_result(identified, table, actual, uncertainty_mm)


def _table(poses: Poses, numbers: NumberLanguage) -> tuple[PoseTable, str]:
    import numpy as np

    from dbbstation.files.recordings.pose_csv import POSE_COLUMNS, PoseTable, poses_of, read_poses
    from dbbstation.files.recordings.table_csv import given_table

    if isinstance(poses, str | PathLike):
        return read_poses(Path(poses), numbers), str(poses)
    if hasattr(poses, "columns") or isinstance(poses, Mapping):
        return poses_of(given_table(cast("Columns", poses), POSE_COLUMNS, "poses")), "poses"
    given = np.atleast_2d(np.asarray(cast("ArrayLike", poses), dtype=np.float64))
    if given.ndim != 2 or given.shape[1] != AXES or not np.isfinite(given).all():  # noqa: PLR2004 - rows and columns
        raise ArgumentError(
            "poses", f"poses are rows of six finite numbers, X, Y, Z [mm], A, B, C [deg], not {given.shape}"
        )
    return PoseTable(given, {}), "poses"
