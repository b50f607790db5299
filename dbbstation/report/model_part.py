"""A model in a report: residual, parameters with U, invisible directions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.facts.serialise import as_objects
from dbbstation.results.words import unseen_sentence, weak_sentence
from dbbstation.sources.contract import Owner
from dbbstation.text.digits import to_its_place

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel


def parameters(identified: IdentifiedModel, coverage_factor: float) -> tuple[tuple[str, str, str, str, str], ...]:
    """Return source, parameter, value, U and unit; a dash for unknown U."""
    u = identified.uncertainties
    rows = []
    for fitted in identified.model.sources:
        if fitted.source.belongs_to is not Owner.MACHINE:
            continue
        named = fitted.source.parameters(identified.model.machine)
        for parameter, value in zip(named, fitted.values, strict=True):
            known = u.get((fitted.source.name, fitted.shared, parameter.name))
            shown = (f"{float(value):.5g}", "-")
            if known is not None:
                shown = to_its_place(float(value), coverage_factor * float(known))
            rows.append((fitted.source.name, parameter.name, *shown, parameter.unit))
    return tuple(rows)


def quality_of_fit(identified: IdentifiedModel) -> str:
    """Return a fit's residual beside noise, in words; may be empty."""
    report = identified.report
    keys = ("nominal_rms_um", "residual_within_mounting_rms_um", "noise_um")
    nominal, left, noise = (report.get(key) for key in keys)
    if not (isinstance(nominal, float) and isinstance(left, float) and isinstance(noise, float)):
        return ""
    return (
        f"In its own recordings the model leaves {left:.2f} µm rms within each mounting, the nominal machine {nominal:.1f} µm in all; "
        f"one reading has {noise:.2f} µm of noise."
    )


def not_visible(identified: IdentifiedModel) -> tuple[str, ...]:
    """Return what a model's recordings could not see, or saw least."""
    seen = as_objects(identified.report.get("observability"))
    return (
        *map(unseen_sentence, identified.directions_lost),
        *map(weak_sentence, getattr(seen, "weak_directions", ())),
    )
