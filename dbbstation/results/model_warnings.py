"""What has to be said of a model wherever its numbers are used: physics that it lacks, causes that are not decided or unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.machine_model import MachineModel

LEAST_PRINTED = 1e-99
"""Probabilities below are printed alike."""


def model_warnings(identified: IdentifiedModel) -> tuple[str, ...]:
    """Return what whoever uses a model has to know first, one sentence each; empty where nothing speaks against it.

    Args:
        identified: the model, with the numbers that its fit reported.
    """
    report = identified.report
    told = [*missing_physics_warnings(report), *_undecided(report), *unknown_cause_notes(identified.model)]
    return tuple(told)


def lacks_physics(report: Mapping[str, Any]) -> bool:
    """Return whether the fit of a model said that physics is missing."""
    misfit = report.get("misfit")
    return isinstance(misfit, Mapping) and misfit.get("missing_physics") is True


def missing_physics_warnings(report: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the warning that physics is missing; empty where chance explains what the model leaves."""
    if not lacks_physics(report):
        return ()
    misfit = report["misfit"]
    return (
        (
            f"physics is missing from the model: {exceeds(misfit['rms_um'], misfit['probability'])}. Its parameters make up for what is "
            "missing: they may be off by many times their u, and predictions with them"
        ),
    )


def exceeds(rms_um: float, probability: float) -> str:
    """Return by how much a residual exceeds what chance explains, in words.

    Args:
        rms_um: beyond noise and mountings [µm].
    """
    return f"the residual exceeds noise and mountings by {rms_um:.2f} µm rms (probability by chance {chance_in_words(probability)})"


def chance_in_words(probability: float) -> str:
    """Return the probability of an F test as printed; the smallest ones underflow."""
    return "below 1e-99" if probability < LEAST_PRINTED else f"{probability:.1g}"


def _undecided(report: Mapping[str, Any]) -> list[str]:
    """Causes that a diagnosis could not tell apart, and what it found that predicts worse."""
    said = report.get("diagnosis")
    if not isinstance(said, Mapping):
        return []
    told = [f"these recordings cannot tell {' from '.join(names)}: the model has one of them" for names in _lists(said)]
    if said.get("held_out_worse") is True:
        told.append("held-out tests are predicted worse by the model than by the kinematic calibration alone")
    return told


def _lists(said: Mapping[str, Any]) -> list[Sequence[str]]:
    return [names for names in said.get("ambiguous", ()) if len(names) > 1]


def unknown_cause_notes(model: MachineModel) -> list[str]:
    """Say of a model that keeps an error that its cause is unknown."""
    return [
        f"the model has {name}, an error whose cause is unknown; it holds where it was measured, while it lasts"
        for name in unknown_causes(model)
    ]


def unknown_causes(model: MachineModel) -> tuple[str, ...]:
    """Names of the sources of a model that describe an error without a cause."""
    own = model.of_the_machine().sources
    return tuple(fitted.source.name for fitted in own if not fitted.source.candidate and fitted.values.any())
