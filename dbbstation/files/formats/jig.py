"""`dbb-jig/1`: the jig plate, its holders and the balls that were measured on it."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator

from dbbstation.errors import InputError, Problem
from dbbstation.facts.quantities import (
    Coordinate,
    ExpansionUmMK,
    FormUm,
    Point,
    Quantity,
    TemperatureDegc,
    Text,
    complaint,
)
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Schema, dotted, format_of, read_document, validate
from dbbstation.files.yaml.text import Location, YamlDocument, parse_yaml

BY_CMM, UNDER_SPINDLE = "cmm", "under-spindle"
"""Position of a ball: measured by a CMM, or unknown."""

_CLOSEST_BORES_MM = 5.0

_OF_THE_CMM = ("bore", "holder", "uncertainty_um")
"""Keys that only CMM-measured balls have."""


def _spaced(bores: dict[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
    names = list(bores)
    for place, bore in enumerate(names):
        for other in names[:place]:
            distance = math.dist(bores[bore], bores[other])
            if distance < _CLOSEST_BORES_MM:
                apart = f"bores {other} and {bore} are {distance:g} mm apart, less than the width of a holder"
                raise complaint(f"{apart}; expected mm", "implausible")
    return bores


class JigSchema(Schema):
    """The plate on the table."""

    bores: Annotated[dict[int, tuple[Coordinate, Coordinate]], AfterValidator(_spaced)]
    """Number of each bore with its x, y as designed, jig frame [mm]."""
    origin_in_machine_mm: Point
    """Position of the jig frame's origin in the machine frame: x, y, z [mm]."""
    rotation_about_z_deg: Annotated[float, Quantity("deg", 0, 360, signed=True)] = 0.0
    """Angle from the machine's +X to the jig's +X, towards +Y positive [deg]."""
    cmm_temp_c: TemperatureDegc | None = None
    """Temperature of the plate while its balls were measured [degC]."""
    plate_expansion_um_m_k: ExpansionUmMK | None = None
    """Thermal expansion of the plate [µm/(m K)]."""


class HolderSchema(Schema):
    """A holder, which carries a ball."""

    repeatability_um: Annotated[float, Quantity("µm", 0.01, 1_000, or_zero=True)]
    """Standard deviation per axis of the ball's position between mountings [µm]."""


class BallSchema(Schema):
    """A ball that a CMM measured, or a ball that is put up under the spindle."""

    placed: Literal["cmm", "under-spindle"] = "cmm"
    """`cmm`: a CMM measured its position; `under-spindle`: it is put up at the tool tip, as in the standard circular
    test, and its position is unknown."""
    bore: int | None = None
    """Bore of the ball; null for a ball without bore."""
    holder: str | None = None
    """Holder of the ball; only for a ball measured by CMM."""
    centre_mm: Point
    """Centre: x, y, z, jig frame; under the spindle, the machine's commanded position when it is put up [mm]."""
    uncertainty_um: Annotated[float, Quantity("µm", 0.01, 1_000, or_zero=True)] | None = None
    """Standard uncertainty of each coordinate; only for a ball measured by CMM [µm]."""
    form_um: FormUm | None = None
    """Largest deviation from a sphere by its certificate [µm]; it enters U of figures if the bar's ball has one too."""


class JigFile(Schema):
    """A jig plate with its holders and the CMM sheet of its balls."""

    format: Literal["dbb-jig/1"]
    """Name and version of this format."""
    name: Text | None = None
    """Name of the plate."""
    jig: JigSchema
    """The plate."""
    holders: dict[str, HolderSchema]
    """Holders by name."""
    balls: dict[str, BallSchema]
    """Balls by name, one per bore and holder used."""


def parse_jig(path: Path, faults: list[Problem]) -> JigFile | None:
    """Read a jig file; None with faults added to `faults`."""
    return _checked(read_document(path, JigFile, faults))


def _checked(document: YamlDocument | None) -> JigFile | None:
    if document is None:
        return None
    jig = validate(document, JigFile)
    check_balls(document, document.data.get("jig"), document.data.get("holders"))
    return jig


def check_balls(document: YamlDocument, jig: Any, holders: Any) -> None:  # noqa: ANN401
    """Check the bores and holders of balls in the raw data, independently of other faults.

    Args:
        jig: mapping with the bores; None without a plate.
    """
    bores = _plain_bores(jig)
    for location, ball in document.entries("balls"):
        _check_placed(document, location, ball)
        if ball.get("placed") == UNDER_SPINDLE:
            continue
        holder = ball.get("holder")
        if isinstance(holders, dict | set) and isinstance(holder, str) and holder not in holders:
            known = ", ".join(sorted(map(str, holders))) or "none"
            what = f"{dotted(location)}: the holder `{holder}` is not in `holders`"
            document.fault((*location, "holder"), what, f"known: {known}")
        bore, centre = ball.get("bore"), ball.get("centre_mm")
        if bores is None or not isinstance(bore, int):
            continue
        if bore not in bores:
            known = ", ".join(map(str, bores))
            what = f"{dotted(location)}: bore {bore} is not on the jig"
            document.fault((*location, "bore"), what, f"known: {known}")
        elif isinstance(centre, tuple) and len(centre) == 3 and all(isinstance(c, int | float) for c in centre):  # noqa: PLR2004
            nearest = min(bores, key=lambda b: math.dist(bores[b], centre[:2]))
            # A holder may lean, but never over to the next bore.
            if math.dist(bores[nearest], centre[:2]) < math.dist(bores[bore], centre[:2]) - _CLOSEST_BORES_MM:
                off = math.dist(bores[bore], centre[:2])
                what = (
                    f"{dotted(location)}: the centre lies {off:.1f} mm from bore {bore}, at bore {nearest}; "
                    "expected mm in the jig frame"
                )
                document.fault((*location, "centre_mm"), what, "check bore, centre and unit")


def _check_placed(document: YamlDocument, location: Location, ball: dict[Any, Any]) -> None:
    if ball.get("placed") == UNDER_SPINDLE:
        for key in _OF_THE_CMM:
            if ball.get(key) is not None:
                what = f"{dotted(location)}: a ball that is put up under the spindle has no `{key}`"
                remedy = "take it out, or take `placed` out where a CMM measured the ball"
                document.fault((*location, key), what, remedy, at_key=True)
    elif ball.get("placed", BY_CMM) == BY_CMM:
        for key in ("holder", "uncertainty_um"):
            if ball.get(key) is None:
                what = f"{dotted(location)}: the key `{key}` is missing"
                document.fault((*location, key), what, "add it")


def _plain_bores(jig: Any) -> dict[int, tuple[float, float]] | None:  # noqa: ANN401 - raw data
    bores = jig.get("bores") if isinstance(jig, dict) else None
    if not isinstance(bores, dict):
        return None
    return {
        bore: place
        for bore, place in bores.items()
        if isinstance(place, tuple) and len(place) == 2 and all(isinstance(c, int | float) for c in place)  # noqa: PLR2004
    }


def read_jig(path: Path) -> JigFile:
    """Read a jig file.

    Raises:
        InputError: every fault with its place.
    """
    return without_faults(parse_jig, path)


def jig_text(jig: JigFile) -> str:
    """Return the text of a jig file."""
    balls = {
        name: {key: value for key, value in ball.model_dump(exclude_none=True).items() if (key, value) != _USUAL}
        for name, ball in jig.balls.items()
    }
    return yaml_text({**jig.model_dump(exclude_none=True), "format": format_of(JigFile), "balls": balls})


_USUAL = ("placed", BY_CMM)


def checked_jig(text: str, file: str) -> JigFile:
    """Return the checked jig of a text.

    Raises:
        InputError: the text is no valid jig file.
    """
    faults: list[Problem] = []
    jig = _checked(parse_yaml(text, file, faults))
    if jig is None or faults:
        raise InputError([replace(fault, line=0, column=0) for fault in faults])
    return jig
