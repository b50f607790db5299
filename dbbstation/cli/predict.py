"""`dbbstation predict`: actual poses for commanded ones."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.number_options import number_language, number_options
from dbbstation.cli.source_files import source_file_option


@click.command()
@click.option("--model", required=True, type=click.Path(path_type=Path), help="Model file of `calibrate`.")
@source_file_option
@click.option("--poses", required=True, type=click.Path(path_type=Path), help="CSV of commanded poses.")
@number_options
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="CSV of actual poses.")
@click.option("--force", is_flag=True, help="Overwrite the output file.")
@click.option("--json", "as_json", is_flag=True, help="Print a summary as JSON.")
def predict(
    *,
    model: Path,
    source_files: tuple[Path, ...],
    poses: Path,
    decimal: str | None,
    separator: str | None,
    out: Path,
    force: bool,
    as_json: bool,
) -> None:
    r"""Predict the actual poses for commanded ones, with standard uncertainties.

    Input columns: x_mm,y_mm,z_mm,a_deg,b_deg,c_deg. Output: the same columns with the actual pose, and u_x_mm,u_y_mm,
    u_z_mm, the standard uncertainties, always with dots and commas. Further columns are copied. Combinations of parameters that the calibration
    could not identify are not part of the uncertainty; they are named.

    \b
    Examples:
      dbbstation predict --model model.yaml --poses commanded.csv --out actual.csv
      dbbstation predict --model model.yaml --poses excel.csv --decimal , --out actual.csv
    """
    import numpy as np

    from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, print_json, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.cli.unknown_causes import say_unknown_causes, unknown_causes
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.formats.pose_table import read_poses, write_poses
    from dbbstation.files.own_sources import every_source
    from dbbstation.files.provenance import refuse_existing_table
    from dbbstation.machine.travel import check_travel
    from dbbstation.model.uncertainty import predicted_poses

    refuse_existing_table(out, force=force)
    identified = read_model(model, every_source(source_files))
    say_unknown_causes(identified.model)
    with stage_bar("prediction", STAGES) as progress:
        progress("reading poses")
        table = read_poses(poses, number_language(decimal, separator))
        progress("travel")
        check_travel(identified.model.machine, table.poses, where=str(poses))
        actual, uncertainty_mm = predicted_poses(
            identified, table.poses, lambda done, of: progress("predicting pose", done, of)
        )
        progress("writing")
        write_poses(out, actual, uncertainty_mm, table.others, provenance(), force=force)
    error_um = 1e3 * np.linalg.norm(actual[:, :3] - table.poses[:, :3], axis=1)
    worst_u_um = 1e3 * float(np.linalg.norm(uncertainty_mm, axis=1).max())
    if as_json:
        print_json(
            {
                "file": str(out),
                "poses": len(actual),
                "greatest_error_um": float(error_um.max()),
                "greatest_uncertainty_um": worst_u_um,
                "directions_lost": list(identified.directions_lost),
                "unknown_causes": unknown_causes(identified.model),
            }
        )
        return
    say(f"{len(actual)} poses written to {out}")
    say(
        f"greatest position error {error_um.max():.1f} µm; greatest uncertainty u {worst_u_um:.1f} µm, "
        f"{EXPANDED} {COVERAGE_FACTOR * worst_u_um:.1f} µm"
    )
    for text in identified.directions_lost:
        say(f"not known, and not in the uncertainty: {text}")


STAGES = {"reading": 0, "travel": 32, "predicting": 48, "writing": 67}
"""Stages of a prediction, and the share of its time that has passed by then [%]."""
