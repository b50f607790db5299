"""Circles held against the shop's tolerances."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.files.formats.settings import Settings
    from dbbstation.plan.tolerance import Tolerance

_WHEN = {"before": "nominal machine", "after": "model"}


def held_against(settings: Settings, summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Hold every tolerance against the runs of an evaluation, under the nominal machine and under the model.

    Args:
        settings: with the tolerances, and where they come from.
        summary: what `evaluate` prints as JSON; circular deviations are those of low-passed readings.

    Returns:
        For each tolerance what it is, and under `before` and `after` the worst run, its figure [µm] and whether that is
        within tolerance; null where it holds for none of the runs.
    """
    return [_held(tolerance, summary["runs"]) for tolerance in settings.tolerances]


def _held(tolerance: Tolerance, runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    from dbbstation.plan.tolerance import CircleFigure, worst

    found: dict[str, Any] = {
        "quantity": tolerance.figure.value,
        "largest_um": tolerance.largest_um,
        "tests": list(tolerance.tests),
        "directions": [direction.value for direction in tolerance.directions],
    }
    for when in _WHEN:
        figures = [
            {
                CircleFigure.CIRCULAR_DEVIATION: run["circularity_30_upr_um"][when],
                CircleFigure.CENTRE_DEVIATION: run[when]["centre_deviation_um"],
                CircleFigure.MEAN_RADIAL_ERROR: run[when]["mean_radial_error_um"],
            }
            for run in runs
        ]
        named = [(run["test"], run["direction"], run["repeat"], of) for run, of in zip(runs, figures, strict=True)]
        one = worst(tolerance, named)
        found[when] = None if one is None else {"run": one.run, "worst_um": one.size_um, "within": one.within}
    return found


def which_circles(tolerance: Mapping[str, Any]) -> str:
    """Say which circles a tolerance holds for."""
    tests = f"tests {', '.join(tolerance['tests'])}" if tolerance["tests"] else "every test"
    return tests + (f", {', '.join(tolerance['directions'])} only" if tolerance["directions"] else "")


def print_tolerances(held: Sequence[Mapping[str, Any]], origin: str) -> None:
    """Print the worst run of every tolerance; nothing where the shop has none."""
    from dbbstation.cli.output import print_table

    if not held:
        return
    echo()
    echo(
        f"tolerances [µm], from {origin}; the worst run of each, readings under the nominal machine and under the model"
    )
    rows = []
    for one in held:
        worst = [_told(one[when]) for when in _WHEN]
        rows.append(
            [one["quantity"], which_circles(one), f"{one['largest_um']:g}", *(t for pair in worst for t in pair)]
        )
    print_table(["quantity", "circles", "at most", *(title for name in _WHEN.values() for title in (name, ""))], rows)


def _told(worst: Mapping[str, Any] | None) -> tuple[str, str]:
    if worst is None:
        return "-", "no such run"
    return f"{worst['worst_um']:.1f}", f"{worst['run']}, {'within' if worst['within'] else 'EXCEEDED'}"
