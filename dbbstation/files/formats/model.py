"""Read and write identified models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from dbbstation.catalogue import meant, nearest
from dbbstation.errors import ModelError, Problem
from dbbstation.facts.quantities import Quantity, Text
from dbbstation.facts.record import Sha256Hex
from dbbstation.files.atomic import refuse_existing, write_text
from dbbstation.files.formats.machine import MachineParts, machine_data
from dbbstation.files.inputs import open_book
from dbbstation.files.provenance import Provenance
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Schema, dotted, format_of, read_valid
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import ErrorSource, Fitted, Owner
from dbbstation.sources.registry import HOW_TO_ADD, known_sources

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.yaml.text import Location, YamlDocument
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter


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

    shared: Text
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


_ROUNDING = 1e-9
"""Largest asymmetry that rounding causes in a covariance, as a correlation."""

_NEGATIVE = 1e-6
"""Most negative eigenvalue that rounding causes in a correlation matrix."""


def read_model(
    path: str | PathLike[str], sources: Mapping[str, ErrorSource] | Iterable[ErrorSource] | None = None
) -> IdentifiedModel:
    """Read a model.

    Args:
        sources: None: sources of package and installed ones. A sequence: in addition to these, replacing equal names. A
            mapping: only its sources.

    Raises:
        InputError: every fault with its place; an installed source that cannot be used.
        ModelError: two of the sources have one name.
    """
    return without_faults(parse_model, Path(path), _by_name(sources))


def _by_name(sources: Mapping[str, ErrorSource] | Iterable[ErrorSource] | None) -> Mapping[str, ErrorSource]:
    if isinstance(sources, Mapping):
        return sources
    own = list(sources or ())
    names = [source.name for source in own]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ModelError(f"two of the given error sources are called {', '.join(twice)}", remedy="give each once")
    return {**known_sources(), **dict(zip(names, own, strict=True))}


def parse_model(path: Path, known: Mapping[str, ErrorSource], faults: list[Problem]) -> IdentifiedModel | None:
    """Read a model; None with faults added to `faults`."""
    read = read_valid(path, ModelFile, faults)
    if read is None:
        return None
    document, file = read
    if file.provenance is not None and file.provenance.virtual:
        open_book().note_virtual(path.name)
    machine = file.machine.to_domain()
    reader = _Sources(document, machine, known)
    fitted = [reader.fitted(("sources", i), source) for i, source in enumerate(file.sources)]
    effects = enumerate(file.measurement_effects)
    fitted += [reader.fitted(("measurement_effects", i), effect, effect.shared) for i, effect in effects]
    covariance = None
    if _is_square(file.covariance):
        count = len(file.covariance.rows)  # none at all in a model that was written by hand
        covariance = np.array(file.covariance.matrix, dtype=np.float64).reshape(count, count)
    _check_rows(document, file)
    _check_lengths(document, file)
    if covariance is None:
        what = f"covariance.matrix: {len(file.covariance.rows)} rows of as many numbers were expected, one per row name"
        document.fault(("covariance", "matrix"), what, "restore the file as it was written")
    elif (fault := covariance_fault(covariance)) is not None:
        document.fault(("covariance", "matrix"), f"covariance.matrix: {fault}", "restore the file")
    if faults or covariance is None:
        return None
    of_formulas = file.covariance.formula_variance
    return IdentifiedModel(
        model=MachineModel(machine, tuple(one for one in fitted if one is not None)),
        covariance_rows=file.covariance.rows,
        covariance=covariance,
        directions_lost=file.directions_lost,
        report=_lists(file.report),
        sessions=file.sessions,
        null_space=None if file.null_space is None else np.array(file.null_space, dtype=np.float64),
        formula_variance=None if of_formulas is None else np.array(of_formulas, dtype=np.float64),
    )


class _Sources:
    """Turns the named sources of a document into fitted sources."""

    def __init__(self, document: YamlDocument, machine: Machine, known: Mapping[str, ErrorSource]) -> None:
        self._machine = machine
        self._known = known
        self._fault = document.fault
        self._seen: set[tuple[str, str]] = set()

    def fitted(self, location: Location, entry: SourceSchema, shared: str = "") -> Fitted | None:
        source = self._known.get(entry.name)
        if source is None:
            remedy = f"{nearest(entry.name, self._known)}; {HOW_TO_ADD}"
            self._fault((*location, "name"), f"no error source is called `{entry.name}`", remedy)
            return None
        if (source.belongs_to is Owner.MACHINE) is bool(shared):
            right = "sources" if source.belongs_to is Owner.MACHINE else "measurement_effects"
            what = f"`{entry.name}` belongs to the {source.belongs_to}, not here"
            self._fault((*location, "name"), what, f"put it under `{right}`")
            return None
        if (entry.name, shared) in self._seen:
            self._fault((*location, "name"), f"`{entry.name}` stands here a second time", "remove one")
            return None
        self._seen.add((entry.name, shared))
        return self._with_values(location, entry, source, shared)

    def _with_values(self, location: Location, entry: SourceSchema, source: ErrorSource, shared: str) -> Fitted | None:
        try:
            laws = [source, *source.other_laws()]
            named = [[p.name for p in law.parameters(self._machine)] for law in laws]
            source = next(
                (law for law, names in zip(laws, named, strict=True) if entry.parameters.keys() == set(names)), source
            )
            parameters = source.parameters(self._machine)
        except ModelError as error:
            self._fault((*location, "name"), error.what, error.remedy)
            return None
        location = (*location, "parameters")
        expected = {parameter.name: parameter for parameter in parameters}
        for name, parameter in expected.items():
            if name not in entry.parameters and not parameter.newer:
                self._fault(location, f"{dotted(location)}: `{name}` of {source.name} is missing", "add it")
        for name, given in entry.parameters.items():
            if name not in expected:
                remedy = meant(name, expected, f"it has: {', '.join(expected)}")
                self._fault((*location, name), f"{source.name} has no parameter `{name}`", remedy, at_key=True)
            elif given.unit != expected[name].unit:
                what = f"{source.name} {name} is in {expected[name].unit}, not in {given.unit}"
                self._fault((*location, name, "unit"), what, "convert the number, do not only change the unit")
            elif source.belongs_to is Owner.MACHINE:
                self._check_value((*location, name, "value"), source, expected[name], given.value)
        may_lack = {name for name, parameter in expected.items() if parameter.newer}
        if set(entry.parameters) | may_lack != set(expected):
            return None
        stated = {name: given.value for name, given in entry.parameters.items()}
        values = np.array([stated.get(name, 0.0) for name in expected], dtype=np.float64)
        return Fitted(source, values, shared)

    def _check_value(self, location: Location, source: ErrorSource, parameter: Parameter, value: float) -> None:
        size = Quantity(parameter.unit, 0.0, parameter.largest, signed=True)
        if not size.fits(value):
            what = f"{source.name} {parameter.name}: {value:g} {parameter.unit} is not plausible, expected {size.range}"
            self._fault(location, what, "check the number and its unit")


def _is_square(covariance: CovarianceSchema) -> bool:
    count = len(covariance.rows)
    return len(covariance.matrix) == count and all(len(row) == count for row in covariance.matrix)


def _check_rows(document: YamlDocument, file: ModelFile) -> None:
    named = {(source.name, "", parameter) for source in file.sources for parameter in source.parameters}
    named |= {(e.name, e.shared, parameter) for e in file.measurement_effects for parameter in e.parameters}
    seen: set[tuple[str, str, str]] = set()
    for index, row in enumerate(file.covariance.rows):
        shown = " ".join(part for part in row if part)
        if row in seen:
            what = f"the covariance row `{shown}` stands here a second time"
            document.fault(("covariance", "rows", index), what, "remove one")
        elif row not in named:
            what = f"the covariance row `{shown}` names no parameter of this model"
            document.fault(("covariance", "rows", index), what, "restore the file")
        seen.add(row)


def _check_lengths(document: YamlDocument, file: ModelFile) -> None:
    lists: list[tuple[Location, tuple[float, ...] | None]] = [
        (("covariance", "formula_variance"), file.covariance.formula_variance),
        *((("null_space", k), row) for k, row in enumerate(file.null_space or ())),
    ]
    for location, numbers in lists:
        if numbers is not None and len(numbers) != len(file.covariance.rows):
            what = f"{dotted(location)}: {len(numbers)} numbers, {len(file.covariance.rows)} were expected, one per row name"
            document.fault(location, what, "restore the file as it was written")


def covariance_fault(covariance: Floats) -> str | None:
    """Return why a matrix, shape (k, k), is not a covariance, or None."""
    variance = np.diag(covariance)
    if (variance < 0).any():
        return f"the variance in row {int(np.argmax(variance < 0)) + 1} is negative"
    known = variance > 0
    if covariance[~known].any() or covariance[:, ~known].any():
        row = int(np.argmax(~known & (covariance.any(axis=1) | covariance.any(axis=0)))) + 1
        return f"row {row} has no variance, but covariances"
    scale = np.sqrt(variance[known])
    correlation = covariance[np.ix_(known, known)] / np.outer(scale, scale)
    skew = np.abs(correlation - correlation.T)
    if skew.size and skew.max() > _ROUNDING:
        row, column = np.flatnonzero(known)[list(np.unravel_index(int(np.argmax(skew)), skew.shape))] + 1
        return f"it is not symmetric: row {row} and column {column} differ"
    if correlation.size and np.linalg.eigvalsh(correlation).min() < -_NEGATIVE:
        return "it is not positive: some combination of parameters would have a negative variance"
    return None


def write_model(
    path: Path, model: IdentifiedModel, *, provenance: Provenance | None = None, force: bool = False
) -> None:
    """Write a model with exact numbers and its provenance.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
        ValueError: its covariance is invalid, or does not fit its rows.
    """
    refuse_existing(path, force=force)
    write_text(path, model_text(model, provenance), force=force)


def model_text(model: IdentifiedModel, provenance: Provenance | None = None) -> str:
    """Return a model's file text, with its provenance.

    Raises:
        ValueError: as `write_model`.
    """
    data = model_data(model)
    if provenance is not None:
        data["provenance"] = provenance.data()
    return yaml_text({**data, "format": format_of(ModelFile)})


def model_data(model: IdentifiedModel) -> dict[str, object]:
    """Return the content of a model's file."""
    count = len(model.covariance_rows)
    fault = None if model.covariance.shape == (count, count) else f"{model.covariance.shape} for {count} rows"
    if fault := fault or covariance_fault(model.covariance):
        raise ValueError(f"a model cannot be written with this covariance: {fault}")
    machine = model.model.machine
    own = [one for one in model.model.sources if one.source.belongs_to is Owner.MACHINE]
    others = [one for one in model.model.sources if one.source.belongs_to is not Owner.MACHINE]
    nominal = machine_data(machine)
    of_formulas, unseen = model.formula_variance, model.null_space
    data = {
        "machine": nominal,
        "sources": [_source_data(one, machine) for one in own],
        "measurement_effects": [_source_data(one, machine) for one in others],
        "covariance": {
            "rows": [list(row) for row in model.covariance_rows],
            "matrix": [row.tolist() for row in model.covariance],
            **({} if of_formulas is None or not of_formulas.any() else {"formula_variance": of_formulas.tolist()}),
        },
        "directions_lost": list(model.directions_lost),
        **({} if unseen is None or not len(unseen) else {"null_space": unseen.tolist()}),
        "report": dict(model.report),
        "sessions": dict(model.sessions),
    }
    return {"format": format_of(ModelFile), **data}


def _source_data(fitted: Fitted, machine: Machine) -> dict[str, object]:
    parameters = fitted.source.parameters(machine)
    return {
        "name": fitted.source.name,
        **({"shared": fitted.shared} if fitted.shared else {}),
        "parameters": {
            parameter.name: {"value": float(value), "unit": parameter.unit}
            for parameter, value in zip(parameters, fitted.values, strict=True)
        },
    }


def _lists(value: Any) -> Any:  # noqa: ANN401 - what fits report is theirs
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    return [_lists(item) for item in value] if isinstance(value, tuple) else value
