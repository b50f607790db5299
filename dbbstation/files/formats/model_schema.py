"""`dbb-model/1`: an identified machine model with the uncertainty and provenance of its numbers."""

from typing import Annotated, Literal

from pydantic import Field

from dbbstation.files.formats.machine import MachineParts
from dbbstation.files.formats.session import Sha256Hex
from dbbstation.files.yaml.schema import Schema


class ValueSchema(Schema):
    """One number with its unit."""

    value: float
    """The number; a strut error is actual minus what the controller believes, a joint error actual minus nominal."""
    unit: str
    """Its unit, the one that the source declares."""


class SourceSchema(Schema):
    """An error source of the machine with its size."""

    name: str
    """Of the source, as `dbbstation` knows it."""
    parameters: dict[str, ValueSchema]
    """All parameters of the source by name."""


class EffectSchema(SourceSchema):
    """An error source of session, mounting or instrument with its size in one set of runs."""

    shared: Annotated[str, Field(min_length=1)]
    """Name of the set: the session, mounting, ball or bar whose runs share these numbers."""


class CovarianceSchema(Schema):
    """Uncertainty of all parameters together."""

    rows: tuple[tuple[str, str, str], ...]
    """Source, set (empty for the machine's own) and parameter of every row, and of every column in the same order."""
    matrix: tuple[tuple[float, ...], ...]
    """Symmetric, in the products of the parameters' units, with what formulas may be off by; a direction held at nominal has no
    variance."""
    formula_variance: tuple[float, ...] | None = None
    """Part of each row's variance that is what the formula of its source may be off by, the same in every session of a machine;
    absent where none is."""


class ProvenanceSchema(Schema):
    """Where a file comes from; no date, so that the same inputs and command give the same file."""

    program: str
    """Name and version of the program that wrote it."""
    command: str
    """What was asked for, files without their folders."""
    inputs: dict[str, Sha256Hex]
    """SHA-256 of every file that was read, by name; recordings have theirs in the session file."""
    virtual: tuple[str, ...] = ()
    """Inputs that come from a virtual machine; the model then says nothing of a real one."""


class ModelFile(Schema):
    """The nominal machine, the errors of the real one, and their uncertainty.

    Every key but `null_space` and `provenance` is required, even if empty, so that a truncated file is noticed.
    """

    format: Literal["dbb-model/1"]
    """Name and version of this format."""
    machine: MachineParts
    """The nominal machine, as in a `dbb-machine/1` file."""
    sources: tuple[SourceSchema, ...]
    """What belongs to the machine: predicted, simulated and compensated."""
    measurement_effects: tuple[EffectSchema, ...]
    """What belongs to session, mounting or instrument: reported, never compensated."""
    covariance: CovarianceSchema
    """Uncertainty of the parameters."""
    directions_lost: tuple[str, ...]
    """What the recordings could not determine, in words; held at nominal, or prescribed parameters in its place."""
    null_space: tuple[tuple[float, ...], ...] | None = None
    """The same in numbers: combinations of the covariance's rows, each at its plausible size in the parameters' units; absent
    where nothing was lost."""
    report: dict[str, object]
    """What the fit reported, by name."""
    sessions: dict[str, Sha256Hex]
    """SHA-256 of each session file that the model comes from, by folder name."""
    provenance: ProvenanceSchema | None = None
    """Where the model comes from; absent in models that were written by hand."""
