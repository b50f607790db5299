"""The channel of bar readings as the inference sees it: base columns, columns of causes, and a target.

Columns are laid out once about the base fit. A cause that a joint fit has taken in, or that competes with one, is laid out
anew at its fitted values: exact columns, tangents of its nonlinear parameters, and what its formula may be off by.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit import SMALLEST_NOISE_MM
from dbbstation.calibration.scatter import LEAST_STATED_MM
from dbbstation.diagnosis.channel import OUTSIZE, SET_UP
from dbbstation.diagnosis.sets.discrepancy import BY_DIRECTION, modulated
from dbbstation.diagnosis.shapes import variables
from dbbstation.inference.harmonics import noise_left_by
from dbbstation.inference.model_comparison import Cause, Variant
from dbbstation.inference.projection import BesideBase, CauseColumns
from dbbstation.inference.square_root import Block, compress
from dbbstation.machine.geometry import STRUTS
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit import Calibration
    from dbbstation.inference.harmonics import Spectrum
    from dbbstation.inference.square_root import Columns
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion, Parameter

NAMED_ODDS = float(np.log(0.05 / 0.95))
"""Log prior odds of a named cause: one machine in twenty has any one of them so that it matters."""

SETUP_ODDS = float(np.log(0.01 / 0.99))
"""Log prior odds that a ball, a row of the CMM sheet or a bar is far off: one session in a hundred, each."""

STAGES_APART = 2
"""Points of the grid of time constants from one further stage of a warm-up to the next: a factor of two."""

DRAWS = 4
"""Draws of white noise from which it is seen how much of the noise a model takes out."""


class Channel:
    """Everything that a diagnosis compares.

    Args:
        calibration: the base model, fitted; its runs as thinned.
        sources: named candidates, several laws of one cause under one name; each must be given what it needs by every
            run.

    Attributes:
        calibration: the base fit.
        motions: of the runs.
        readings: as the base fit predicts them.
        columns: of all causes.
        named: causes that have a name.
        set_up: balls and bars that are off by far more than stated, a variant for each of them.
        sources: by name and law.
    """

    def __init__(self, calibration: Calibration, sources: Sequence[ErrorSource]) -> None:
        self.calibration = calibration
        self.machine: Machine = calibration.layout.machine
        self.motions = [observation.motion() for observation in calibration.observations]
        self.readings = [calibration.model.bar(motion) for motion in self.motions]
        ends = np.cumsum([0, *(len(reading.length_mm) for reading in self.readings)])
        self.runs = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.columns = CauseColumns(self._base())
        self.sources = {(source.name, source.varies_with): source for source in sources}
        self.set_up = self._outsize()
        self._laid: dict[tuple[str, str], tuple[Variant, ...]] = {}
        for key, source in self.sources.items():
            self._laid[key] = self._on_a_grid(source)
        self._refined: dict[tuple[str, str], tuple[Variant, ...]] = {}

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Runs, averaged over sectors."""
        return self.calibration.observations

    @property
    def base(self) -> Columns:
        """Priors and scales of the base columns."""
        return self.calibration.layout.known

    @property
    def held(self) -> NDArray[np.float64]:
        """Base directions at nominal."""
        return self.calibration.solution.held

    @property
    def named(self) -> tuple[Cause, ...]:
        """Causes with a name; laws and forms of one are equally likely."""
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

    def source_of(self, name: str, variant: Variant) -> ErrorSource:
        """Source that a form of a cause is of: a cause may have one form over time, and one by thermometers."""
        return self.sources[name, variant.law]

    def to_whole(self, variant: Variant) -> NDArray[np.float64]:
        """Amplitudes of a form to all amplitudes of its cause: some of these, or one for all of them, shape (p, q)."""
        if not len(variant.whole):
            return np.eye(len(variant.columns))
        same = (variant.whole[:, None] == variant.columns).astype(np.float64)
        return same if same.any() else np.ones((len(variant.whole), 1))

    def beside_base(self, noise_mm: float, scatter: float = 1.0) -> BesideBase:
        """Causes beside the base at a noise of one sample [mm], balls scattering `scatter` times as stated."""
        return BesideBase(self.columns, self._scattering(scatter), self.held, max(noise_mm, SMALLEST_NOISE_MM))

    def target(self, fit: Calibration) -> NDArray[np.float64]:
        """What readings say of base and causes, about a fit of the base and of causes laid out at its values, (n,).

        Args:
            fit: the base fit, or a joint one, which has the base's columns where they were and others behind.
        """
        base = len(self.base.prior)
        known = fit.x[:base] - fit.layout.nominal[:base]
        # What the fitted columns make of the target is projected out; leaving it out keeps digits.
        known = np.where(self.base.random, known, 0.0)
        target = np.concatenate(fit.residual_mm) + self.columns.base @ known
        for key, variants in self._refined.items():
            amplitudes = self._amplitudes_in(fit, key)
            if amplitudes is not None:
                target = target + self.columns.samples[:, variants[0].columns] @ amplitudes
        return np.asarray(target, dtype=np.float64)

    def noise(self, target: NDArray[np.float64], others: Sequence[Cause], noise_mm: float) -> Spectrum:
        """Noise from what base and all causes together leave of a target.

        Args:
            target: shape (n,) [mm].
            others: causes beside the named ones.
            noise_mm: of one sample, about [mm].
        """
        sd = np.zeros(self.columns.count)
        for cause in (*self.named, *self.set_up, *others):
            for variant in cause.variants:
                sd[variant.columns] = np.maximum(sd[variant.columns], variant.plausible)
        rng = np.random.default_rng(self.columns.count)
        noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
        white = rng.standard_normal((len(target), DRAWS))
        left = self.beside_base(noise_mm).left(np.column_stack([target, white]), sd)
        phases = [np.radians(o.raw.theta_deg) for o in self.observations]
        return noise_left_by([left[rows, 0] for rows in self.runs], phases, [left[rows, 1:] for rows in self.runs])

    def blocks(self, columns: NDArray[np.int64], target: NDArray[np.float64]) -> list[Block]:
        """Compressed runs of base columns, then of those of some causes, one block per run."""
        samples = np.hstack([self.columns.base, self.columns.samples[:, columns]])
        every = np.arange(samples.shape[1])
        found = []
        for rows in self.runs:
            touched = np.flatnonzero(samples[rows].any(axis=0))
            found.append(compress(every[touched], samples[rows][:, touched], target[rows]))
        return found

    def refine(self, name: str, law: str, values: Mapping[str, NDArray[np.float64]], fit: Calibration) -> None:
        """Lay out a cause at values of all its parameters, with tangents and slack.

        Args:
            name: of the cause.
            law: which one it follows.
            values: by set, shape (p,).
            fit: about which.
        """
        source = self.sources[name, law]
        readings = self.readings if fit is self.calibration else [fit.model.bar(motion) for motion in self.motions]
        parameters = source.parameters(self.machine)
        shaped = [k for k, p in enumerate(parameters) if p.shape]
        amplitudes = [k for k, p in enumerate(parameters) if not p.shape]
        shared = [source.shared_by(motion) for motion in self.motions]
        derivatives = [
            reading.by_source(source, self.machine, values[own]) for reading, own in zip(readings, shared, strict=True)
        ]
        first = next(iter(values.values()))
        variants = self._variants(
            source, [d[:, amplitudes] for d in derivatives], shared, tuple(first[shaped].tolist())
        )
        tangents = np.vstack([d[:, shaped] for d in derivatives])
        tangent_sd = np.array([_spacing(parameters[k], float(first[k])) for k in shaped])
        discrepancy = self._discrepancy(source, values, shared, readings, derivatives)
        slack = self.columns.add(np.hstack([tangents, discrepancy]))
        sd = np.concatenate([tangent_sd, np.full(discrepancy.shape[1], source.form_uncertainty)])
        size = [values[own][amplitudes] / np.array([parameters[k].plausible for k in amplitudes]) for own in values]
        at = max(float(np.sqrt(np.mean(np.square(size)))), 1e-12)
        grid = np.prod([max(len(parameters[k].shape), 1) for k in shaped]) if shaped else 1.0
        # A tangent covers about as much of the range of a nonlinear parameter as 2.5 points of its grid.
        weight = -float(np.log(max(grid / 2.5 ** len(shaped), 1.0)))
        self._refined[name, law] = tuple(
            replace(
                variant,
                slack=slack,
                slack_sd=sd,
                slack_at=at / np.sqrt(np.mean(np.square(self.to_whole(variant).sum(axis=1)))),
                log_weight=variant.log_weight + weight,
            )
            for variant in variants
        )

    def _amplitudes_in(self, fit: Calibration, key: tuple[str, str]) -> NDArray[np.float64] | None:
        """Amplitudes of a cause in a fit; None where that fit is without it."""
        terms = [t for t in fit.layout.terms if (t.source.name, t.source.varies_with) == key]
        base = {term.source.name for term in self.calibration.layout.terms}
        if not terms or key[0] in base:
            return None
        return fit.x[fit.layout.columns_of(key[0])[0]]

    def _base(self) -> NDArray[np.float64]:
        """Columns of the base over all samples."""
        layout = self.calibration.layout
        samples = np.zeros((self.runs[-1].stop, len(layout.known.prior)))
        for rows, motion, reading in zip(self.runs, self.motions, self.readings, strict=True):
            for term in layout.terms:
                if term.acts_on(motion):
                    samples[rows, term.columns] = reading.by_source(
                        term.source, self.machine, self.calibration.x[term.columns]
                    )
        return samples

    def _scattering(self, times: float) -> Columns:
        """What is known of the base where balls scatter so many times as stated."""
        if times == 1.0:
            return self.base
        prior = self.base.prior.copy()
        for term in self.calibration.layout.terms:
            if term.source.name in {"mounting", "ball-coordinate"}:
                own = prior[term.columns]
                prior[term.columns] = np.where(own < LEAST_STATED_MM, times * own, own)
        return replace(self.base, prior=prior)

    def _outsize(self) -> tuple[Cause, ...]:
        """Random effects that may be larger than stated; the parameters of each that runs see.

        A level bar does not see the height of its ball. A ball that was put up once only is no other matter than its
        mounting, and one that was set free may stand anywhere as it is.
        """
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

    def _on_a_grid(self, source: ErrorSource) -> tuple[Variant, ...]:
        """Variants of a source at all points of the grid of its nonlinear parameters."""
        parameters = source.parameters(self.machine)
        amplitudes = [k for k, p in enumerate(parameters) if not p.shape]
        shaped = [k for k, p in enumerate(parameters) if p.shape]
        shared = [source.shared_by(motion) for motion in self.motions]
        points = list(product(*(parameters[k].shape for k in shaped)))
        found: list[Variant] = []
        for point in points:
            values = np.zeros(len(parameters))
            values[shaped] = point
            derivatives = [reading.by_source(source, self.machine, values)[:, amplitudes] for reading in self.readings]
            found += self._variants(source, derivatives, shared, point)
        return tuple(replace(v, log_weight=v.log_weight - float(np.log(len(points)))) for v in found)

    def _variants(
        self,
        source: ErrorSource,
        derivatives: Sequence[NDArray[np.float64]],
        shared: Sequence[str],
        nonlinear: tuple[float, ...],
    ) -> list[Variant]:
        """Forms of a source at one point: all amplitudes, those of each part (a strut) alone, one for all struts.

        What wears or was made badly is often one strut, or all alike; all others free beside it would hide what is faint.

        Args:
            source: the cause.
            derivatives: of the readings by its amplitudes, per run, shape (n, p).
            shared: set of each run.
            nonlinear: the point.
        """
        amplitudes = [p for p in source.parameters(self.machine) if not p.shape]
        sets = list(dict.fromkeys(shared))
        count = len(amplitudes)
        samples = np.zeros((self.runs[-1].stop, count * len(sets)))
        for rows, derivative, own in zip(self.runs, derivatives, shared, strict=True):
            place = count * sets.index(own)
            samples[rows, place : place + count] = derivative
        columns = self.columns.add(samples)
        plausible = np.tile([p.plausible for p in amplitudes], len(sets))
        parts = np.array([p.alone_with for p in amplitudes] * len(sets))
        whole = Variant(columns, plausible, nonlinear, law=source.varies_with)
        kinds = [[whole]]
        if len(set(parts.tolist())) > 1:
            kinds.append(
                [
                    replace(whole, columns=columns[own], plausible=plausible[own], label=part, whole=columns)
                    for part, own in ((part, parts == part) for part in sorted(set(parts.tolist())))
                ]
            )
        if len(sets) == 1 and [p.strut for p in amplitudes] == list(range(1, STRUTS + 1)):
            alike = self.columns.add(samples.sum(axis=1, keepdims=True))
            kinds.append(
                [replace(whole, columns=alike, plausible=plausible[:1], label="all struts alike", whole=columns)]
            )
        return [replace(one, log_weight=-float(np.log(len(kinds) * len(kind)))) for kind in kinds for one in kind]

    def _discrepancy(
        self,
        source: ErrorSource,
        values: Mapping[str, NDArray[np.float64]],
        shared: Sequence[str],
        readings: Sequence[BarReading],
        derivatives: Sequence[NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """Columns of what the formula of a source may be off by, shape (n, q)."""
        if source.form_uncertainty == 0.0:
            return np.zeros((self.runs[-1].stop, 0))
        amplitude = np.array([not p.shape for p in source.parameters(self.machine)])
        effects, along, signs = [], [], []
        for motion, own, reading, derivative in zip(self.motions, shared, readings, derivatives, strict=True):
            by_strut = _strut_contributions(source, motion, self.machine, values[own], reading)
            known = variables(motion, self.machine)
            if by_strut is None:
                followed = _followed(source, known, motion)[motion.kept]
                total = derivative[:, amplitude] @ values[own][amplitude]
                effects.append(np.repeat(total[:, None], followed.shape[1], axis=1))
                along.append(followed)
                continue
            effects.append(by_strut)
            followed = known["time" if source.varies_with in {"time", "temperature"} else "strut-length"]
            wide = np.broadcast_to(followed[:, None], (len(motion), STRUTS)) if followed.ndim == 1 else followed
            along.append(wide[motion.kept])
            if source.varies_with in BY_DIRECTION:
                signs.append(known["strut-speed-sign"][motion.kept])
        columns = modulated(effects, along, signs or None)
        return np.hstack([columns, self._other_stages(source, values, shared, readings)])

    def _other_stages(
        self,
        source: ErrorSource,
        values: Mapping[str, NDArray[np.float64]],
        shared: Sequence[str],
        readings: Sequence[BarReading],
    ) -> NDArray[np.float64]:
        """What grows over time by one law may have further stages: its effect with other time constants, shape (n, q)."""
        parameters = source.parameters(self.machine)
        if source.varies_with != "time":
            return np.zeros((self.runs[-1].stop, 0))
        amplitude = np.array([not p.shape for p in parameters])
        first = int(np.flatnonzero(~amplitude)[0]) if not amplitude.all() else None
        if first is None:
            return np.zeros((self.runs[-1].stop, 0))
        found = []
        for constant in parameters[first].shape[::STAGES_APART]:
            pieces = []
            for reading, own in zip(readings, shared, strict=True):
                other = values[own].copy()
                other[first] = constant
                pieces.append(reading.by_source(source, self.machine, other)[:, amplitude] @ other[amplitude])
            found.append(np.concatenate(pieces))
        return np.column_stack(found)


def _strut_contributions(
    source: ErrorSource, motion: Motion, machine: Machine, values: NDArray[np.float64], reading: BarReading
) -> NDArray[np.float64] | None:
    """What a source adds to the reading through each strut, shape (n, 6) [mm]; None where it acts otherwise too."""
    model = MachineModel(machine, (Fitted(source, values, source.shared_by(motion)),))
    effect = model.effect(motion, reading.actual)
    others = (
        effect.base_joint_mm,
        effect.platform_joint_mm,
        effect.tool_tip_mm,
        effect.fixed_ball_mm,
        effect.reading_mm,
    )
    if effect.strut_mm is None or any(other is not None for other in others):
        return None
    lengths = np.broadcast_to(np.asarray(effect.strut_mm), (len(motion), STRUTS))
    return np.asarray((reading.sensitivity.response.per_strut * lengths)[motion.kept], dtype=np.float64)


def _followed(source: ErrorSource, known: Mapping[str, NDArray[np.float64]], motion: Motion) -> NDArray[np.float64]:
    """Variables that the discrepancy of a source that acts on no single strut follows: its own, or the place, (n, q)."""
    name = "time" if source.varies_with == "temperature" else source.varies_with
    if name in known and known[name].ndim == 1:
        return known[name][:, None]
    if name == "reading" and motion.reading_mm is not None:
        return motion.reading_mm[:, None]
    return motion.poses[:, :2]


def _spacing(parameter: Parameter, value: float) -> float:
    """Spacing of the grid of a nonlinear parameter about a value."""
    grid = np.sort(np.array(parameter.shape))
    if len(grid) == 1:
        return parameter.plausible
    k = int(np.clip(np.searchsorted(grid, value), 1, len(grid) - 1))
    return float(grid[k] - grid[k - 1])
