"""Check the facts of a bar and its calibrator that the operator typed."""

from __future__ import annotations

from datetime import date, datetime
from typing import TYPE_CHECKING, get_args

from dbbstation.facts.quantities import Quantity
from dbbstation.files.formats.bar import BarFile, CalibratorSchema
from dbbstation.plan.circle import USUAL_STROKE_MM

if TYPE_CHECKING:
    from dbbstation.files.yaml.schema import Schema

USUAL_INTERVAL_YEARS = 3.0
"""Age above which a calibration is questioned. Laboratories recalibrate gauge blocks every one to three years [ISO 3650
leaves the interval to the user]."""

_RANGES: dict[str, tuple[type[Schema], str]] = {
    "calibrator_mm": (CalibratorSchema, "length_mm"),
    "calibrator_u_um": (CalibratorSchema, "uncertainty_um"),
    "temp_c": (BarFile, "temp_c"),
}
"""Format and key that define the range of each number."""

_DAYS_PER_YEAR = 365.25


def fault_of(
    name: str, text: str, reads_mm: float | None = None, stroke_mm: float | None = None, today: date | None = None
) -> str:
    """Return a typed text's fault, or an empty text."""
    if name == "certified" or (name == "valid_until" and text):
        return _fault_of_day(name, text, today or datetime.now().astimezone().date())
    if name not in _RANGES:
        return ""
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        return f"`{text}` is no number"
    quantity = _quantity(*_RANGES[name])
    if not quantity.fits(number):
        return f"{number:g} {quantity.unit} is not plausible, expected {quantity.range}{quantity.guess(number)}"
    stroke = USUAL_STROKE_MM if stroke_mm is None else stroke_mm
    if name == "calibrator_mm" and reads_mm is not None and abs(reads_mm - number) > stroke:
        return f"the bar reads {reads_mm:.4f} mm: it does not stand on a calibrator of {number:.10g} mm"
    return ""


def doubt_of(name: str, text: str, today: date | None = None) -> str:
    """Return a doubt about a faultless text, or an empty text."""
    if name != "certified":
        return ""
    years = ((today or datetime.now().astimezone().date()) - date.fromisoformat(text)).days / _DAYS_PER_YEAR
    if years <= USUAL_INTERVAL_YEARS:
        return ""
    return f"the certificate of {text} is {int(years)} years old: is that the date on it, and does it still hold?"


def _fault_of_day(name: str, text: str, today: date) -> str:
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return f"`{text}` is no date, expected such as 2026-11-20"
    if name == "valid_until":
        return (
            f"the certificate was valid until {text} only: the calibrator has to be certified anew"
            if day < today
            else ""
        )
    return f"the certificate of {text} is of the future" if day > today else ""


def _quantity(schema: type[Schema], key: str) -> Quantity:
    field = schema.model_fields[key]
    inside = [each for kind in get_args(field.annotation) for each in getattr(kind, "__metadata__", ())]
    return next(each for each in (*field.metadata, *inside) if isinstance(each, Quantity))
