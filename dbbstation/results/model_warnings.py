"""Warnings of a model: missing physics, undecided and unknown causes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.machine_model import MachineModel

LEAST_PRINTED = 1e-99
"""Smallest probability that is printed as a number."""


def model_warnings(identified: IdentifiedModel) -> tuple[str, ...]:
    """Return a model's warnings, a sentence each; may be empty."""
    report = identified.report
    unknown = (
        f"the model has {name}, an error whose cause is unknown; it holds where it was measured, while it lasts"
        for name in unknown_causes(identified.model)
    )
    return (*missing_physics_warnings(report), *_undecided(report), *unknown)


def lacks_physics(report: Mapping[str, Any]) -> bool:
    """Return whether a fit reported missing physics."""
    misfit = report.get("misfit")
    return isinstance(misfit, Mapping) and misfit.get("missing_physics") is True


def missing_physics_warnings(report: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the warning about missing physics; empty if chance explains the residual."""
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
    """Return in words how far a residual exceeds chance."""
    return f"the residual exceeds noise and mountings by {rms_um:.2f} µm rms (probability by chance {chance_in_words(probability)})"


def chance_in_words(probability: float) -> str:
    """Return the printed probability of an F test; the smallest ones underflow."""
    return "below 1e-99" if probability < LEAST_PRINTED else f"{probability:.1g}"


def _undecided(report: Mapping[str, Any]) -> list[str]:
    said = report.get("diagnosis")
    if not isinstance(said, Mapping):
        return []
    alike = [names for names in said.get("ambiguous", ()) if len(names) > 1]
    told = [f"these recordings cannot tell {' from '.join(names)}: the model has one of them" for names in alike]
    if said.get("held_out_worse") is True:
        told.append("held-out tests are predicted worse by the model than by the kinematic calibration alone")
    return told + [str(text).rstrip(".") for text in said.get("limits", ())]


def unknown_causes(model: MachineModel) -> tuple[str, ...]:
    """Return a model's sources without a cause."""
    own = model.of_the_machine().sources
    return tuple(fitted.source.name for fitted in own if not fitted.source.candidate and fitted.values.any())
