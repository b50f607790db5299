"""Bar readings as a channel, with columns of base and causes."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import chain, product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import LEAST_STATED_MM, misfit_of
from dbbstation.calibration.fit.calibrate import LISTED_WITHIN, SMALLEST_NOISE_MM
from dbbstation.diagnosis.parts import SourceOverRuns, by_terms, is_shape, seen_of
from dbbstation.diagnosis.shapes import variables
from dbbstation.inference.bank import parts_of, spacing_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import NAMED_ODDS
from dbbstation.inference.harmonics import noise_left_by
from dbbstation.inference.model_comparison import MOST_SLACK, Cause, Variant, largest_sd
from dbbstation.inference.projection import BesideBase, CauseColumns
from dbbstation.inference.square_root import Block, compress, free_directions, slices, with_random
from dbbstation.inference.triangle import axes_of, rms

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.harmonics import Spectrum
    from dbbstation.inference.square_root import Columns
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Parameter

SETUP_ODDS = float(np.log(0.01 / 0.99))
"""Log prior odds of a displaced ball, wrong CMM row or wrong bar, each in one session of a hundred."""

SET_UP = ("mounting", "ball-coordinate", "bar-offset")
"""Random effects of the base that may be far larger than stated."""

LEAST_SLACK = 0.1
"""Smallest change of a formula, in standard deviations of all readings together, that is kept: it moves a log Bayes factor by 0.005."""

SEEN = 1e-5
"""Least relative singular value of identifiable directions of machine parameters; only these absorb effects."""

OUTSIZE = 20.0
"""Prior standard deviation of such an effect, in stated standard deviations."""


class CircleChannel:
    """Runs, base and causes of a diagnosis.

    Attributes:
        set_up: causes for displaced balls and wrong bars, one variant each.
        sources: candidates; laws of one cause share a name. Runs must provide their inputs.
    """

    def __init__(self, calibration: Calibration, sources: Sequence[ErrorSource]) -> None:
        self.calibration = calibration
        self.machine: Machine = calibration.layout.machine
        self.motions = [observation.motion() for observation in calibration.observations]
        self.readings = [calibration.model.bar(motion) for motion in self.motions]
        self.runs = slices(len(reading.length_mm) for reading in self.readings)
        base = np.vstack([by_terms(reading, calibration.layout, calibration.x) for reading in self.readings])
        self.columns = CauseColumns(base, room=BOUNDS.room)
        self.sources = {(source.name, source.law): source for source in sources}
        self.set_up = self._outsize()
        self.over = {key: self._over(source) for key, source in self.sources.items()}
        self._laid = {key: self._on_a_grid(over) for key, over in self.over.items()}
        self._refined: dict[tuple[str, str], tuple[Variant, ...]] = {}
        self._refined_anew: set[tuple[str, str]] = set()
        self._former: list[Variant] = []
        self._last: tuple[Calibration, list[BarReading]] = calibration, self.readings

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Return runs averaged over sectors."""
        return self.calibration.observations

    @property
    def base(self) -> Columns:
        """Return the base's priors and scales."""
        return self.calibration.layout.known

    @property
    def held(self) -> Floats:
        """Return base directions held at nominal."""
        return self.calibration.solution.held

    @property
    def named(self) -> tuple[Cause, ...]:
        """Return named causes; all laws and forms of a cause have equal prior probability."""
        found = []
        for name in dict.fromkeys(name for name, _ in self.sources):
            laws = [key for key in self.sources if key[0] == name]
            variants = [
                replace(variant, log_weight=variant.log_weight - float(np.log(len(laws))))
                for key in laws
                for variant in self._refined.get(key, self._laid[key])
            ]
            found.append(Cause(name, tuple(variants), NAMED_ODDS))
        return tuple(found)

    def known_with(self, variants: Sequence[Variant]) -> Columns:
        """Return priors and scales of the base, then of amplitudes of forms."""
        return with_random(self.base, [variant.plausible for variant in variants])

    def whole(self, name: str, variant: Variant) -> Variant:
        """Return a cause's form with all amplitudes at the same nonlinear parameters, without slack."""
        if not len(variant.whole):
            return replace(variant, slack=variant.slack[:0], slack_sd=variant.slack_sd[:0])
        sizes = [p.plausible for p in self.over[name, variant.law].amplitudes]
        plausible = np.tile(sizes, len(variant.whole) // len(sizes))
        return Variant(variant.whole, plausible, variant.nonlinear, law=variant.law)

    def source_of(self, name: str, variant: Variant) -> ErrorSource:
        """Return the source of a form."""
        return self.sources[name, variant.law]

    def forms(self) -> Iterator[Variant]:
        """Return initial forms of named causes."""
        return chain.from_iterable(self._laid.values())

    def happens_once(self, name: str) -> bool:
        """Return whether a cause is a single event in a session."""
        return any(source.happens_once for own, source in self.sources.items() if own[0] == name)

    def to_whole(self, variant: Variant) -> Floats:
        """Return the matrix from a form's amplitudes to the cause's, shape (p, q)."""
        if not len(variant.whole):
            return np.eye(len(variant.columns))
        same = (variant.whole[:, None] == variant.columns).astype(np.float64)
        return same if same.any() else np.ones((len(variant.whole), 1))

    def beside_base(
        self,
        noise_mm: float,
        scatter: float = 1.0,
        but_for: Flags | None = None,
        only: Integers | None = None,
    ) -> BesideBase:
        """Return causes with the base projected out; balls scatter `scatter` times as much as stated.

        Targets must be zero in held-out rows `but_for`, shape (n,). `only` are the needed columns, None for all.
        """
        columns = self.columns if but_for is None else self.columns.but_for(but_for, only)
        return BesideBase(columns, self._scattering(scatter), self.held, max(noise_mm, SMALLEST_NOISE_MM))

    def target(self, fit: Calibration) -> Floats:
        """Return the target for base and causes, linearised about a fit, shape (n,)."""
        base = len(self.base.prior)
        known = fit.x[:base] - fit.layout.nominal[:base]
        # The part explained by fitted columns is projected out anyway; omitting it reduces rounding.
        known = np.where(self.base.random, known, 0.0)
        target = np.concatenate(fit.residual_mm) + self.columns.base @ known
        for key, variants in self._refined.items():
            amplitudes = self._amplitudes_in(fit, key)
            if amplitudes is not None:
                target = target + self.columns.samples[:, variants[0].columns] @ amplitudes
        return target

    def noise(self, target: Floats, others: Sequence[Cause], noise_mm: float) -> Spectrum:
        """Estimate noise from the residual of base and all causes."""
        sd = largest_sd((*self.named, *self.set_up, *others), self.columns.count)
        rng = np.random.default_rng(self.columns.count)
        noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
        white = rng.standard_normal((len(target), BOUNDS.noise_draws))
        left = self.beside_base(noise_mm).left(np.column_stack([target, white]), sd)
        phases = [np.radians(o.raw.theta_deg) for o in self.observations]
        return noise_left_by([left[rows, 0] for rows in self.runs], phases, [left[rows, 1:] for rows in self.runs])

    def blocks(self, columns: Integers, target: Floats) -> list[Block]:
        """Return one information block per run, over base columns, then causes' columns."""
        every = np.arange(self.columns.base.shape[1] + len(columns))
        found = []
        for rows in self.runs:
            # Runs are processed one by one to save memory.
            samples = np.hstack([self.columns.base[rows], self.columns.samples[rows, columns]])
            touched = np.flatnonzero(samples.any(axis=0))
            found.append(compress(every[touched], samples[:, touched], target[rows]))
        return found

    def unconcealed(self, effect: Floats) -> Floats:
        """Return the part of an effect that identifiable machine parameters do not absorb, unweighted, shape (n,)."""
        return effect - self._of_parameters @ (self._of_parameters.T @ effect)

    @cached_property
    def _of_parameters(self) -> Floats:
        machine = np.flatnonzero(~self.base.random)
        return axes_of(self.columns.base[:, machine] @ free_directions(self.base, machine, self.held), SEEN)

    def refine(self, name: str, law: str, values: Mapping[str, Floats], fit: Calibration) -> None:
        """Add columns of a cause at parameter values, with tangents and slack."""
        over, replaced = self.over[name, law], self._refined.pop((name, law), ())
        if (name, law) in self._refined_anew:
            self._free(replaced)  # no comparison has used them
        else:
            self._former += replaced
        self._refined_anew.add((name, law))
        over = replace(over, readings=self._readings_about(fit))
        shaped, uncertain = is_shape(over.source, self.machine), over.source.form_uncertainty
        effects = over.effects(values[own] for own in over.shared)
        point = tuple(next(iter(values.values()))[shaped].tolist())
        # A tangent covers about 2.5 grid points of a nonlinear parameter.
        covered = [len(p.grid) / (1.0 if p.listed else 2.5) for p in over.shapes]
        weight = -float(np.log(max(float(np.prod(covered)), 1.0)))
        variants = self._variants(over, over.by_group(one.derivative[:, ~shaped] for one in effects), point, weight)
        tangents = np.vstack([one.derivative[:, shaped] for one in effects])
        tangent_sd = np.array([_spacing(p, value) for p, value in zip(over.shapes, point, strict=True)])
        least_mm = LEAST_SLACK * max(self.first_noise_mm, SMALLEST_NOISE_MM) / MOST_SLACK
        discrepancy, parts = (seen_of(columns, uncertain, least_mm) for columns in over.slack(effects))
        slack = self.columns.add(np.hstack([tangents, discrepancy, parts]))
        sd = np.concatenate([tangent_sd, np.full(discrepancy.shape[1] + parts.shape[1], uncertain)])
        plausible = np.array([p.plausible for p in over.amplitudes])
        at = max(rms(np.array([own[~shaped] / plausible for own in values.values()])), 1e-12)
        self._refined[name, law] = tuple(
            replace(
                variant,
                slack=slack,
                slack_sd=sd,
                tangents=tangents.shape[1],
                parts=parts.shape[1],
                slack_at=at / np.sqrt(np.mean(np.square(self.to_whole(variant).sum(axis=1)))),
            )
            for variant in variants
        )

    @cached_property
    def variables(self) -> list[dict[str, Floats]]:
        """Return every run's variables."""
        return [variables(motion, self.machine) for motion in self.motions]

    @cached_property
    def first_noise_mm(self) -> float:
        """Return the noise of a reading, estimated before any cause is known."""
        return misfit_of(self.calibration).noise

    def give_back(self) -> None:
        """Free the columns of forms that were replaced after the last comparison."""
        former, self._former = self._former, []
        self._refined_anew.clear()
        self._free(former)

    def _free(self, forms: Sequence[Variant]) -> None:
        if forms:
            columns = [part for one in forms for part in (one.columns, one.slack, one.whole)]
            self.columns.give_back(np.unique(np.concatenate(columns)))

    def _readings_about(self, fit: Calibration) -> list[BarReading]:
        if fit is self.calibration:
            return self.readings
        if fit is not self._last[0]:
            self._last = fit, [fit.model.bar(motion) for motion in self.motions]
        return self._last[1]

    def _amplitudes_in(self, fit: Calibration, key: tuple[str, str]) -> Floats | None:
        terms = [t for t in fit.layout.terms if (t.source.name, t.source.law) == key]
        base = {term.source.name for term in self.calibration.layout.terms}
        if not terms or key[0] in base:
            return None
        return fit.x[fit.layout.columns_of(key[0])[0]]

    def _scattering(self, times: float) -> Columns:
        if times == 1.0:
            return self.base
        prior = self.base.prior.copy()
        for term in self.calibration.layout.terms:
            if term.source.name in {"mounting", "ball-coordinate"}:
                own = prior[term.columns]
                prior[term.columns] = np.where(own < LEAST_STATED_MM, times * own, own)
        return replace(self.base, prior=prior)

    def _outsize(self) -> tuple[Cause, ...]:
        """Return random effects that may exceed their stated size, with the parameters that circles show."""
        # Level bars do not measure ball heights. For a ball mounted once, ball and mounting are one effect. Freed balls
        # are omitted.
        setups = [observation.setup for observation in self.observations]
        put_up = {ball: {s.mounting for s in setups if s.ball == ball} for ball in {s.ball for s in setups}}
        raised = {o.setup.mounting for o in self.observations if o.raw.circle.elevation_deg != 0.0}
        found: dict[str, list[Variant]] = {}
        for term in self.calibration.layout.terms:
            name, stated = term.source.name, self.base.prior[term.columns]
            mountings = put_up.get(term.shared, set()) if name == "ball-coordinate" else {term.shared}
            once = name == "ball-coordinate" and len(mountings) == 1
            if name in SET_UP and not once and np.all(stated < LEAST_STATED_MM):
                seen = min(len(stated), 3 if mountings & raised else 2)
                own = np.arange(term.columns.start, term.columns.start + seen)
                columns = self.columns.add(self.columns.base[:, own])
                found.setdefault(name, []).append(Variant(columns, OUTSIZE * stated[:seen], label=term.shared))
        return tuple(
            Cause(
                name,
                tuple(replace(v, log_weight=-float(np.log(len(every)))) for v in every),
                SETUP_ODDS,
                setup=True,
                named=False,
            )
            for name, every in found.items()
        )

    def _over(self, source: ErrorSource) -> SourceOverRuns:
        shared = [source.shared_by(motion) for motion in self.motions]
        return SourceOverRuns(source, self.machine, self.motions, self.readings, shared, self.variables)

    def _on_a_grid(self, over: SourceOverRuns) -> tuple[Variant, ...]:
        points = list(product(*(p.grid for p in over.shapes)))
        points = [point for point in points if over.source.shows(self.motions, point)] or points[:1]
        weight = -float(np.log(len(points)))
        forms = (self._variants(over, over.columns(point), point, weight) for point in points)
        return tuple(chain.from_iterable(forms))

    def _variants(
        self, over: SourceOverRuns, samples: Floats, nonlinear: tuple[float, ...], log_weight: float
    ) -> tuple[Variant, ...]:
        """Return a source's forms, with columns of all groups' amplitudes, shape (n, p)."""
        whole = columns = self.columns.add(samples)
        if over.alike:
            columns = np.append(whole, self.columns.add(samples.sum(axis=1, keepdims=True)))
        every = Variant(
            columns,
            np.array([p.plausible for p in over.every]),
            nonlinear,
            law=over.source.law,
            whole=whole,
            log_weight=log_weight,
            positive=tuple(p.positive for p in over.every),
            form_uncertainty=over.source.form_uncertainty,
        )
        return parts_of(every, over.forms)


def _spacing(parameter: Parameter, value: float) -> float:
    if len(parameter.grid) == 1:
        return parameter.plausible
    if parameter.listed:
        return LISTED_WITHIN * value
    return spacing_of(sorted(parameter.grid), value)
