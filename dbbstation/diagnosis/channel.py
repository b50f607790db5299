"""The channel of bar readings as the inference sees it: blocks of columns for base, named sources and shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit import SMALLEST_NOISE_MM
from dbbstation.calibration.scatter import LEAST_STATED_MM
from dbbstation.diagnosis.shapes import PLAUSIBLE_MM, Ranges, Shape, ranges, shapes, strongest_waves, variables
from dbbstation.inference.race import Candidate, Race, Variant
from dbbstation.inference.square_root import Block, Columns, compress, joined
from dbbstation.trace.average import averaged, means, sector_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit import Calibration
    from dbbstation.calibration.layout import Layout, Term
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion, Parameter

SECTORS = 720
"""Samples per turn that a diagnosis works on, at the most: every half degree."""

MANY, SIZES = 6, (1.0, 0.1)
"""Amplitudes from which on a source is looked for at both sizes, in units of the plausible one: that all of many are
small is likely when one of them is, and the plausible size alone would count it as a miracle."""

SET_UP = ("mounting", "ball-coordinate", "bar-offset")
"""Random effects of the base that may be far larger than stated."""

OUTSIZE = 20.0
"""Size of such an effect in units of the stated one, one standard deviation."""

FEWEST_PER_SECTOR = 2
"""Samples per sector below which sectors are made wider."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Everything that a diagnosis compares.

    Attributes:
        observations: runs, averaged over sectors.
        blocks: compressed runs: columns of the base, then of all candidates; targets about the base fit.
        layout: terms of the base columns.
        held: base directions at nominal.
        columns: number of all columns.
        named: sources that have a name, as candidates.
        set_up: balls and bars that are off by far more than stated, as candidates: a variant for each of them.
        unnamed: shapes, as candidates; their names are `variable | strut | form`.
        residual_mm: per run, what the base fit leaves, measurement's effects included [mm].
        extent: of the variables that shapes are curves of.
    """

    observations: tuple[Observation, ...]
    blocks: tuple[Block, ...]
    layout: Layout
    held: NDArray[np.float64]
    columns: int
    named: tuple[Candidate, ...]
    set_up: tuple[Candidate, ...]
    unnamed: tuple[Candidate, ...]
    residual_mm: tuple[NDArray[np.float64], ...]
    extent: Ranges

    @cached_property
    def joined(self) -> Block:
        """All runs as one block."""
        return joined(self.blocks, self.columns)

    def race(self, noise_mm: float) -> Race:
        """Candidates on what the base leaves, at a noise of one sample [mm]."""
        return Race([self.joined], self.base, self.held, self.columns, max(noise_mm, SMALLEST_NOISE_MM))

    @property
    def base(self) -> Columns:
        """Priors and scales of the base columns."""
        return self.layout.known

    @property
    def machine(self) -> Machine:
        """Nominal machine."""
        return self.layout.machine

    @property
    def known(self) -> Columns:
        """Priors and scales of all columns; amplitudes of candidates are random with their plausible sizes."""
        prior = np.concatenate([self.base.prior, np.full(self.columns - len(self.base.prior), np.inf)])
        for candidate in (*self.named, *self.set_up, *self.unnamed):
            for variant in candidate.variants:
                prior[variant.columns] = variant.plausible
        more = self.columns - len(self.base.prior)
        scale = np.concatenate([self.base.scale, prior[len(self.base.prior) :]])
        return Columns(prior, scale, np.concatenate([self.base.random, np.ones(more, dtype=bool)]))


def thinned(observation: Observation) -> Observation:
    """Return the run averaged over sectors, with what was commanded averaged alike."""
    raw = observation.raw
    sectors = min(SECTORS, max(len(raw) // FEWEST_PER_SECTOR, 1))
    commanded = observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)


def channel_of(calibration: Calibration, sources: Sequence[ErrorSource]) -> Channel:
    """Lay out base, sources and shapes over a calibrated set of runs.

    Args:
        calibration: the base model, fitted; its runs as thinned.
        sources: named candidates; each must be given what it needs by every run.
    """
    layout, machine = calibration.layout, calibration.layout.machine
    observations = calibration.observations
    motions = [observation.motion() for observation in observations]
    extent = ranges(motions, machine)
    model = calibration.model
    count = len(layout.known.prior)
    book = _Book(count)
    readings = [model.bar(motion) for motion in motions]
    left = [o.raw.length_mm - reading.length_mm for o, reading in zip(observations, readings, strict=True)]
    waves = strongest_waves(
        left,
        [r.sensitivity.response.per_strut[m.kept] for r, m in zip(readings, motions, strict=True)],
        [variables(m, machine)["strut-length"][m.kept] for m in motions],
    )
    outsize = _outsize(layout, observations)
    blocks = []
    for motion, reading, residual in zip(motions, readings, left, strict=True):
        terms = [term for term in layout.terms if term.acts_on(motion)]
        pieces = [reading.by_source(term.source, machine, calibration.x[term.columns]) for term in terms]
        columns = [np.r_[term.columns] for term in terms]
        for term, piece in list(zip(terms, pieces, strict=True)):
            seen = outsize.get((term.source.name, term.shared))
            if seen is not None:
                columns.append(book.set_up(term, OUTSIZE * layout.known.prior[term.columns][:seen]))
                pieces.append(piece[:, :seen])
        for source in sources:
            for numbers, piece in _source_columns(source, motion, machine, reading, book):
                columns.append(numbers)
                pieces.append(piece)
        for shape in shapes(motion, machine, extent, waves):
            columns.append(book.shape(shape))
            pieces.append(reading.by_parameters(shape.columns))
        numbers = np.concatenate(columns)
        jacobian = np.hstack(pieces)
        base = numbers < count
        target = residual + jacobian[:, base] @ (calibration.x - layout.nominal)[numbers[base]]
        blocks.append(compress(numbers, jacobian, target))
    return Channel(
        observations=observations,
        blocks=tuple(blocks),
        layout=layout,
        held=calibration.solution.held,
        columns=book.count,
        named=book.candidates(named=True),
        set_up=book.of_the_set_up(),
        unnamed=book.candidates(named=False),
        residual_mm=tuple(left),
        extent=extent,
    )


def _outsize(layout: Layout, observations: Sequence[Observation]) -> dict[tuple[str, str], int]:
    """Random effects that may be larger than stated, by source and set, and how many of their parameters runs see.

    A level bar does not see the height of its ball. A ball that was put up once only is no other matter than its
    mounting, and one that was set free may stand anywhere as it is.
    """
    setups = [observation.setup for observation in observations]
    put_up = {ball: {s.mounting for s in setups if s.ball == ball} for ball in {s.ball for s in setups}}
    raised = {o.setup.mounting for o in observations if o.raw.circle.elevation_deg != 0.0}
    found = {}
    for term in layout.terms:
        name, stated = term.source.name, layout.known.prior[term.columns]
        mountings = put_up.get(term.shared, set()) if name == "ball-coordinate" else {term.shared}
        once = name == "ball-coordinate" and len(mountings) == 1
        if name in SET_UP and not once and np.all(stated < LEAST_STATED_MM):
            found[name, term.shared] = min(len(stated), 3 if mountings & raised else 2)
    return found


def _source_columns(
    source: ErrorSource, motion: Motion, machine: Machine, reading: BarReading, book: _Book
) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Columns of every variant of a source for one run: amplitudes only, shape parameters at their values."""
    parameters = source.parameters(machine)
    amplitudes = [k for k, p in enumerate(parameters) if not p.shape]
    shaped = [k for k, p in enumerate(parameters) if p.shape]
    grid = parameters[shaped[0]].shape if shaped else ((),)
    found = []
    for value in grid:
        values = np.zeros(len(parameters))
        if shaped:
            values[shaped] = value
        derivative = reading.by_source(source, machine, values)[:, amplitudes]
        shape = tuple(float(values[k]) for k in shaped)
        numbers = book.source(source, source.shared_by(motion), shape, [parameters[k] for k in amplitudes])
        found.append((numbers, derivative))
    return found


def _forms(whole: Variant, struts: NDArray[np.int64]) -> list[Variant]:
    """Forms in which a source is looked for: all its amplitudes, at one size or two, and those of each strut alone.

    What wears or was made badly is often one strut only; all others free beside it would hide what is faint.

    Args:
        whole: all amplitudes.
        struts: that each amplitude is of, 0 for none, shape (p,).
    """
    sizes = SIZES if len(whole.columns) >= MANY else SIZES[:1]
    forms = [whole.scaled(size) for size in sizes]
    single = np.unique(struts)
    if len(single) > 1:
        of = [struts == strut for strut in single]
        forms += [replace(whole, columns=whole.columns[own], prior=whole.prior[own]) for own in of]
    return forms


class _Book:
    """Gives columns their numbers, the same in every run."""

    def __init__(self, first: int) -> None:
        self.count = first
        self._sources: dict[
            tuple[str, tuple[float, ...]], dict[str, tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]]
        ] = {}
        self._shapes: dict[tuple[str, int | None, str], tuple[NDArray[np.int64], float | None]] = {}
        self._set_up: dict[str, dict[str, Variant]] = {}

    def source(
        self, source: ErrorSource, shared: str, shape: tuple[float, ...], amplitudes: Sequence[Parameter]
    ) -> NDArray[np.int64]:
        """Columns of one variant of a source for one set that shares its values."""
        sets = self._sources.setdefault((source.name, shape), {})
        if shared not in sets:
            prior = np.array([p.plausible for p in amplitudes])
            sets[shared] = (self._new(len(prior)), prior, np.array([p.strut or 0 for p in amplitudes]))
        return sets[shared][0]

    def set_up(self, term: Term, prior: NDArray[np.float64]) -> NDArray[np.int64]:
        """Columns of a ball or bar that is off by far more than stated."""
        sets = self._set_up.setdefault(term.source.name, {})
        if term.shared not in sets:
            sets[term.shared] = Variant(self._new(len(prior)), prior, of=term.shared)
        return sets[term.shared].columns

    def of_the_set_up(self) -> tuple[Candidate, ...]:
        """Return balls and bars as candidates."""
        return tuple(Candidate(name, tuple(sets.values())) for name, sets in self._set_up.items())

    def shape(self, shape: Shape) -> NDArray[np.int64]:
        """Columns of a shape."""
        key = (shape.variable, shape.strut, shape.form)
        if key not in self._shapes:
            self._shapes[key] = (self._new(shape.count), shape.wave)
        return self._shapes[key][0]

    def candidates(self, *, named: bool) -> tuple[Candidate, ...]:
        """Return the candidates with their variants."""
        variants: dict[str, list[Variant]] = {}
        if named:
            for (name, form), sets in self._sources.items():
                columns = np.concatenate([columns for columns, _, _ in sets.values()])
                prior = np.concatenate([prior for _, prior, _ in sets.values()])
                struts = np.concatenate([struts for _, _, struts in sets.values()])
                variants.setdefault(name, []).extend(_forms(Variant(columns, prior, form), struts))
        else:
            for (variable, strut, _), (columns, wave) in self._shapes.items():
                form = () if wave is None else (wave,)
                prior = np.full(len(columns), PLAUSIBLE_MM)
                variants.setdefault(f"{variable} | {strut or ''}", []).append(Variant(columns, prior, form))
        return tuple(Candidate(name, tuple(forms)) for name, forms in variants.items())

    def _new(self, size: int) -> NDArray[np.int64]:
        self.count += size
        return np.arange(self.count - size, self.count)
