"""The channel of bar readings as the inference sees it: blocks of columns for base and named sources."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit import SMALLEST_NOISE_MM
from dbbstation.calibration.scatter import LEAST_STATED_MM
from dbbstation.inference.race import Candidate, Race, Variant, race_on
from dbbstation.inference.square_root import Block, Columns, compress, joined
from dbbstation.machine.geometry import STRUTS
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

SIZES = (1.0, 0.3, 0.1, 0.03)
"""Sizes at which a source is looked for, in units of the plausible one: a thirtieth of it may be seen clearly, and the plausible
size alone would count it as a miracle that several amplitudes are all small."""

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
        residual_mm: per run, what the base fit leaves, measurement's effects included [mm].
        sources: by name and law.
    """

    observations: tuple[Observation, ...]
    blocks: tuple[Block, ...]
    layout: Layout
    held: NDArray[np.float64]
    columns: int
    named: tuple[Candidate, ...]
    set_up: tuple[Candidate, ...]
    residual_mm: tuple[NDArray[np.float64], ...]
    sources: dict[tuple[str, str], ErrorSource]

    @cached_property
    def joined(self) -> Block:
        """All runs as one block."""
        return joined(self.blocks, self.columns)

    def race(self, noise_mm: float) -> Race:
        """Candidates on what the base leaves, at a noise of one sample [mm]."""
        return race_on([self.joined], self.base, self.held, self.columns, max(noise_mm, SMALLEST_NOISE_MM))

    @property
    def base(self) -> Columns:
        """Priors and scales of the base columns."""
        return self.layout.known

    def source_of(self, name: str, variant: Variant) -> ErrorSource:
        """Source that a form of a candidate is of: a cause may have one form over time, and one by thermometers."""
        return self.sources[name, variant.law]

    @property
    def machine(self) -> Machine:
        """Nominal machine."""
        return self.layout.machine

    @property
    def known(self) -> Columns:
        """Priors and scales of all columns; amplitudes of candidates are random with their plausible sizes."""
        prior = np.concatenate([self.base.prior, np.full(self.columns - len(self.base.prior), np.inf)])
        for candidate in (*self.named, *self.set_up):
            for variant in candidate.variants:
                prior[variant.columns] = variant.plausible
        more = self.columns - len(self.base.prior)
        scale = np.concatenate([self.base.scale, prior[len(self.base.prior) :]])
        return Columns(prior, scale, np.concatenate([self.base.random, np.ones(more, dtype=bool)]))


def thinned(observation: Observation) -> Observation:
    """Return the run averaged over sectors, with what was commanded averaged alike; as it is where it is short."""
    raw = observation.raw
    if len(raw) <= SECTORS:
        return observation
    sectors = min(SECTORS, max(len(raw) // FEWEST_PER_SECTOR, 1))
    commanded = observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)


def channel_of(calibration: Calibration, sources: Sequence[ErrorSource]) -> Channel:
    """Lay out base and sources over a calibrated set of runs.

    Args:
        calibration: the base model, fitted; its runs as thinned.
        sources: named candidates; each must be given what it needs by every run.
    """
    machine, model = calibration.layout.machine, calibration.model
    motions = [observation.motion() for observation in calibration.observations]
    book = _Book(len(calibration.layout.known.prior))
    readings = [model.bar(motion) for motion in motions]
    outsize = _outsize(calibration.layout, calibration.observations)
    left, blocks = [], []
    for observation, motion, reading in zip(calibration.observations, motions, readings, strict=True):
        numbers, jacobian = base_columns(calibration, motion, reading)
        left.append(observation.raw.length_mm - reading.length_mm)
        columns, pieces = [numbers], [jacobian]
        for term, seen in outsize:
            if term.acts_on(motion):
                own = np.arange(term.columns.start, term.columns.start + seen)
                columns.append(book.set_up(term, OUTSIZE * calibration.layout.known.prior[own]))
                pieces.append(jacobian[:, np.searchsorted(numbers, own)])
        for source in sources:
            for own, piece in _source_columns(source, motion, machine, reading, book):
                columns.append(own)
                pieces.append(piece)
        target = left[-1] + jacobian @ (calibration.x - calibration.layout.nominal)[numbers]
        blocks.append(compress(np.concatenate(columns), np.hstack(pieces), target))
    return Channel(
        observations=calibration.observations,
        blocks=tuple(blocks),
        layout=calibration.layout,
        held=calibration.solution.held,
        columns=book.count,
        named=book.candidates(),
        set_up=book.of_the_set_up(),
        sources=book.sources,
        residual_mm=tuple(left),
    )


def _outsize(layout: Layout, observations: Sequence[Observation]) -> list[tuple[Term, int]]:
    """Random effects that may be larger than stated, as terms, and how many of their parameters runs see.

    A level bar does not see the height of its ball. A ball that was put up once only is no other matter than its
    mounting, and one that was set free may stand anywhere as it is.
    """
    setups = [observation.setup for observation in observations]
    put_up = {ball: {s.mounting for s in setups if s.ball == ball} for ball in {s.ball for s in setups}}
    raised = {o.setup.mounting for o in observations if o.raw.circle.elevation_deg != 0.0}
    found = []
    for term in layout.terms:
        name, stated = term.source.name, layout.known.prior[term.columns]
        mountings = put_up.get(term.shared, set()) if name == "ball-coordinate" else {term.shared}
        once = name == "ball-coordinate" and len(mountings) == 1
        if name in SET_UP and not once and np.all(stated < LEAST_STATED_MM):
            found.append((term, min(len(stated), 3 if mountings & raised else 2)))
    return found


def base_columns(
    calibration: Calibration, motion: Motion, reading: BarReading
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Numbers and values of the columns of a fit that act on one run, shapes (k,) and (n, k)."""
    machine = calibration.layout.machine
    terms = [term for term in calibration.layout.terms if term.acts_on(motion)]
    pieces = [reading.by_source(term.source, machine, calibration.x[term.columns]) for term in terms]
    return np.concatenate([np.r_[term.columns] for term in terms]), np.hstack(pieces)


def _source_columns(
    source: ErrorSource, motion: Motion, machine: Machine, reading: BarReading, book: _Book
) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Columns of every variant of a source for one run: amplitudes only, shape parameters at their values."""
    parameters = source.parameters(machine)
    amplitudes = [k for k, p in enumerate(parameters) if not p.shape]
    shaped = [k for k, p in enumerate(parameters) if p.shape]
    found = []
    for shape in product(*(parameters[k].shape for k in shaped)):
        values = np.zeros(len(parameters))
        values[shaped] = shape
        derivative = reading.by_source(source, machine, values)[:, amplitudes]
        numbers = book.source(source, source.shared_by(motion), shape, [parameters[k] for k in amplitudes])
        if len(numbers) > len(amplitudes):
            derivative = np.column_stack([derivative, derivative.sum(axis=1)])
        found.append((numbers, derivative))
    return found


@dataclass(frozen=True, eq=False)
class _Set:
    """Columns of one variant of a source for one set that shares its values.

    Attributes:
        columns: of its amplitudes, shape (p,).
        prior: plausible sizes, shape (p,).
        struts: that each amplitude is of, 0 for none, shape (p,).
        common: column of one amplitude that all struts share; none where they have several each, or none.
    """

    columns: NDArray[np.int64]
    prior: NDArray[np.float64]
    struts: NDArray[np.int64]
    common: NDArray[np.int64]


def _forms(sets: Sequence[_Set], law: str, shape: tuple[float, ...]) -> list[Variant]:
    """Forms in which a source is looked for: all amplitudes, those of each strut alone, one for all struts.

    What wears or was made badly is often one strut, or all alike; all others free beside it would hide what is faint.
    """
    columns, prior, struts = (
        np.concatenate([getattr(s, name) for s in sets]) for name in ("columns", "prior", "struts")
    )
    whole = Variant(columns, prior, shape, law=law)
    forms = [whole]
    single = np.unique(struts)
    if len(single) > 1:
        of = [struts == strut for strut in single]
        forms += [replace(whole, columns=columns[own], prior=prior[own]) for own in of]
    if len(sets) == 1 and len(sets[0].common):
        forms.append(replace(whole, columns=sets[0].common, prior=prior[:1]))
    return forms


class _Book:
    """Gives columns their numbers, the same in every run."""

    def __init__(self, first: int) -> None:
        self.count = first
        self.sources: dict[tuple[str, str], ErrorSource] = {}
        self._sets: dict[tuple[str, str, tuple[float, ...]], dict[str, _Set]] = {}
        self._set_up: dict[str, dict[str, Variant]] = {}

    def source(
        self, source: ErrorSource, shared: str, shape: tuple[float, ...], amplitudes: Sequence[Parameter]
    ) -> NDArray[np.int64]:
        """Columns of one variant of a source for one set that shares its values; that of all struts alike comes last."""
        self.sources[source.name, source.varies_with] = source
        sets = self._sets.setdefault((source.name, source.varies_with, shape), {})
        if shared not in sets:
            prior, struts = np.array([p.plausible for p in amplitudes]), np.array([p.strut or 0 for p in amplitudes])
            each = sorted(struts.tolist()) == list(range(1, STRUTS + 1))
            sets[shared] = _Set(self._new(len(prior)), prior, struts, self._new(1 if each else 0))
        return np.concatenate([sets[shared].columns, sets[shared].common])

    def set_up(self, term: Term, prior: NDArray[np.float64]) -> NDArray[np.int64]:
        """Columns of a ball or bar that is off by far more than stated."""
        sets = self._set_up.setdefault(term.source.name, {})
        if term.shared not in sets:
            sets[term.shared] = Variant(self._new(len(prior)), prior, of=term.shared)
        return sets[term.shared].columns

    def of_the_set_up(self) -> tuple[Candidate, ...]:
        """Return balls and bars as candidates."""
        return tuple(Candidate(name, tuple(sets.values())) for name, sets in self._set_up.items())

    def candidates(self) -> tuple[Candidate, ...]:
        """Return the candidates with their variants."""
        variants: dict[str, list[Variant]] = {}
        for (name, law, shape), sets in self._sets.items():
            variants.setdefault(name, []).extend(_forms(list(sets.values()), law, shape))
        return tuple(Candidate(name, tuple(forms), SIZES) for name, forms in variants.items())

    def _new(self, size: int) -> NDArray[np.int64]:
        self.count += size
        return np.arange(self.count - size, self.count)
