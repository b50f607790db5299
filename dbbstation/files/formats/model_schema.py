"""`dbb-model/1`: an identified machine model with the uncertainty and provenance of its numbers."""

from typing import Annotated, Literal

from pydantic import Field

from dbbstation.facts.record import Sha256Hex
from dbbstation.files.formats.machine import MachineParts
from dbbstation.files.provenance import Provenance
from dbbstation.files.yaml.schema import Schema


class ValueSchema(Schema):
    """One number with its unit."""

    value: float
    """The number. A strut error is the actual minus the controller's value, a joint error actual minus nominal."""
    unit: str
    """Its unit, as the source declares."""


class SourceSchema(Schema):
    """An error source of the machine with its parameters."""

    name: str
    """Name of the source in `dbbstation`."""
    parameters: dict[str, ValueSchema]
    """All parameters of the source by name."""


class EffectSchema(SourceSchema):
    """An error source of session, mounting or instrument, with its parameters in one set of runs."""

    shared: Annotated[str, Field(min_length=1)]
    """Name of the set: the session, mounting, ball or bar whose runs share these numbers."""


class CovarianceSchema(Schema):
    """Uncertainty of all parameters together."""

    rows: tuple[tuple[str, str, str], ...]
    """Source, set (empty for the machine's own) and parameter of every row, and of every column in the same order."""
    matrix: tuple[tuple[float, ...], ...]
    """Symmetric matrix, in products of the parameters' units, with the formulas' own uncertainty; a direction held at
    nominal has no variance."""
    formula_variance: tuple[float, ...] | None = None
    """Part of each row's variance by the uncertainty of its source's formula, the same in every session of a machine;
    absent if all are zero."""


class ModelFile(Schema):
    """The nominal machine, the errors of the real one, and their uncertainty.

    Every key except `null_space` and `provenance` is required, even if empty, so that a truncated file is detected.
    """

    format: Literal["dbb-model/1"]
    """Name and version of this format."""
    machine: MachineParts
    """The nominal machine, as in a `dbb-machine/1` file."""
    sources: tuple[SourceSchema, ...]
    """Error sources of the machine, which are predicted, simulated and compensated."""
    measurement_effects: tuple[EffectSchema, ...]
    """Effects of session, mounting or instrument, which are reported, but never compensated."""
    covariance: CovarianceSchema
    """Uncertainty of the parameters."""
    directions_lost: tuple[str, ...]
    """Combinations that the recordings could not determine, in words. They are held at nominal, or prescribed
    parameters replace them."""
    null_space: tuple[tuple[float, ...], ...] | None = None
    """The same in numbers: combinations of the covariance's rows, each at its plausible size in the parameters' units;
    absent if there are none."""
    report: dict[str, object]
    """Results of the fit, by name."""
    sessions: dict[str, Sha256Hex]
    """SHA-256 of each session file of the fit, by folder name."""
    provenance: Provenance | None = None
    """Origin of the model; absent in models that were written by hand."""
