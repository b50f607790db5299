"""`dbbstation predict`: actual poses for commanded ones."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.shared_options import number_options, source_file_option


@click.command()
@click.argument("poses", type=click.Path(path_type=Path), metavar="POSES.csv")
@click.option("--model", required=True, type=click.Path(path_type=Path), help="Model file of `calibrate`.")
@source_file_option
@number_options
@click.option(
    "--table", "out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="CSV of actual poses."
)
@click.option("--force", is_flag=True, help="Overwrite the output file.")
@click.option("--json", "as_json", is_flag=True, help="Print a summary as JSON.")
def predict(
    poses: Path,
    *,
    model: Path,
    source_files: tuple[Path, ...],
    decimal: str | None,
    separator: str | None,
    out: Path,
    force: bool,
    as_json: bool,
) -> None:
    r"""Predict the actual poses for commanded ones, with standard uncertainties.

    Input columns: x_mm,y_mm,z_mm,a_deg,b_deg,c_deg. Output: the same columns with the actual pose, and u_x_mm,u_y_mm,
    u_z_mm, the standard uncertainties, always with dots and commas. Further columns are copied. An uncertainty that depends on undetermined parameters is left empty, with the reason in u_not_known_because; joint_tolerance_mm in the machine file
    of the calibration bounds it.

    \b
    Examples:
      dbbstation predict --model model.yaml commanded.csv --table actual.csv
      dbbstation predict --model model.yaml poses.csv --decimal , --table actual.csv
    """
    from dbbstation.cli.model_warnings import say_model_warnings
    from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, print_result, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.formats.number_language import PLAIN, number_language
    from dbbstation.files.own_sources import every_source
    from dbbstation.files.provenance import refuse_existing_table
    from dbbstation.tasks.models import model_of
    from dbbstation.tasks.predict import STAGES
    from dbbstation.tasks.predict import predict as predicted

    refuse_existing_table(out, force=force)
    identified = model_of(model, every_source(source_files))
    say_model_warnings(identified)
    with stage_bar("prediction", STAGES) as progress:
        result = predicted(
            identified,
            poses,
            out=out,
            force=force,
            numbers=number_language(decimal, separator) or PLAIN,
            provenance=provenance,
            progress=progress,
        )
    if as_json:
        print_result(result)
        return
    say(f"{result.poses} poses written to {out}")
    shift = ", ".join(f"{axis} {um:+.1f}" for axis, um in zip("XYZ", result.common_shift_um, strict=True))
    say(
        f"position errors {result.error_rms_um:.1f} µm rms, {result.greatest_error_um:.1f} µm at most; their mean is {shift} µm, "
        f"and they are {result.error_about_mean_rms_um:.1f} µm rms about it"
    )
    u_um = result.greatest_uncertainty_um
    if u_um is not None:
        say(f"greatest uncertainty u {u_um:.1f} µm, {EXPANDED} {COVERAGE_FACTOR * u_um:.1f} µm")
        return
    by_axis = result.greatest_uncertainty_by_axis_um
    known = [f"{axis.upper()} {u:.1f}" for axis, u in by_axis.items() if u is not None]
    unknown = [axis.upper() for axis, u in by_axis.items() if u is None]
    say(
        f"{'greatest uncertainty u ' + ', '.join(known) + ' µm; ' if known else ''}"
        f"u of {', '.join(unknown)} is not known: {result.uncertainty_not_known_because}"
    )
    if identified.null_space is not None:
        say("  a joint_tolerance_mm in the machine file of the calibration, or tests that show it, would tell")
