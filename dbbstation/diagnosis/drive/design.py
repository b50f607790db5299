"""All columns of one recording in the band of the comparison: base, named causes, unnamed shapes; and its noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.shapes import PLAUSIBLE_SHARE, shapes
from dbbstation.diagnosis.drive.signals import derivatives
from dbbstation.inference.noise import Noise, noise_of
from dbbstation.inference.race import Candidate, Race, Variant, race_on
from dbbstation.inference.square_root import Columns, compress

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.contract import DriveSource, Form
    from dbbstation.diagnosis.drive.signals import Signals
    from dbbstation.inference.square_root import Block

BASE = ("mass_kg", "viscous_n_s_m")
"""Parameters of the base model, F = M a + F_v v."""

MOST_BLOCKS, FEWEST_BLOCKS = 30, 8
SAMPLES_PER_BLOCK = 30

SAME = 1e-6
"""Singular value, relative, below which columns say the same."""

SMALLEST_NOISE = 1e-6
"""Noise, of the force's root mean square, that is always there: simulated recordings may have none."""


@dataclass(frozen=True, eq=False)
class Design:
    """One recording, ready to be compared with models.

    Attributes:
        signals: it came from.
        force_n: in the band, shape (m,) [N].
        columns: in the band, base first, shape (m, k).
        groups: block of each sample, shape (m,); blocks follow each other in time.
        named: candidates with a name; the shape of a variant is the place of its form.
        unnamed: unnamed shapes, by variable.
        forms: of the variants of each named candidate.
        sources: by name.
        noise: of one sample, from what neither names nor shapes can follow.
        freedom: of the force, that names and shapes together take.
        noise_square: sum of squares that they leave.
    """

    signals: Signals
    force_n: NDArray[np.float64]
    columns: NDArray[np.float64]
    groups: NDArray[np.int64]
    named: tuple[Candidate, ...]
    unnamed: tuple[Candidate, ...]
    forms: Mapping[str, tuple[Form, ...]]
    sources: Mapping[str, DriveSource]
    noise: Noise
    freedom: int
    noise_square: float

    @property
    def noise_n(self) -> float:
        """Standard deviation of white noise that would leave the same uncertainty [N]."""
        return max(self.noise.effective, SMALLEST_NOISE * self.signals.scale.force_n)

    def blocks(self, columns: NDArray[np.float64]) -> list[Block]:
        """Compress columns, shape (m, k), block by block."""
        numbers = np.arange(columns.shape[1])
        return [
            compress(numbers, columns[rows], self.force_n[rows])
            for rows in (self.groups == group for group in range(int(self.groups[-1]) + 1))
        ]

    def race(self, base: NDArray[np.float64]) -> tuple[Race, tuple[Candidate, ...], tuple[Candidate, ...]]:
        """Race of all candidates on what a model leaves, with the named and unnamed ones numbered for it.

        Args:
            base: columns of the model so far, shape (m, b).
        """
        count = base.shape[1]
        whole = np.hstack([base, self.columns[:, len(BASE) :]])
        known = Columns(np.full(count, np.inf), 1.0 / _norms(base), np.zeros(count, dtype=bool))
        race = race_on(self.blocks(whole), known, np.zeros((0, count)), whole.shape[1], self.noise_n)
        shift = count - len(BASE)
        return race, _shifted(self.named, shift), _shifted(self.unnamed, shift)


def design_of(signals: Signals, sources: Sequence[DriveSource]) -> Design:
    """Make all columns of a recording and read its noise."""
    force = signals.compared(signals.force_n)
    # Of the position as measured: these columns are linear in it and have not passed its filter yet.
    speed, acceleration = derivatives(signals.measured_m, signals.rate_hz)
    base = signals.compared(np.column_stack([acceleration, speed]))
    families = [(shape.variable, signals.compared(shape.columns)) for shape in shapes(signals)]
    smooth = np.hstack([base, *(columns for _, columns in families)])
    residual, _ = _left(smooth, force)
    forms = {source.name: source.forms(signals, residual) for source in sources}
    pieces, count = [base], len(BASE)
    named: list[Candidate] = []
    for name, of_source in forms.items():
        variants = []
        for place, form in enumerate(of_source):
            pieces.append(signals.compared(form.columns(signals, form.value)))
            prior = np.array([parameter.plausible for parameter in form.amplitudes])
            variants.append(Variant(np.arange(count, count + len(prior)), prior, (float(place),)))
            count += len(prior)
        if variants:
            named.append(Candidate(name, tuple(variants)))
    unnamed: list[Candidate] = []
    for variable, columns in families:
        present = columns[:, _norms(columns) > SAME * np.sqrt(len(force))]
        pieces.append(present)
        prior = np.full(present.shape[1], PLAUSIBLE_SHARE * signals.scale.force_n)
        unnamed.append(Candidate(variable, (Variant(np.arange(count, count + len(prior)), prior),)))
        count += len(prior)
    whole = np.hstack(pieces)
    residual, freedom = _left(whole, force)
    blocks = int(np.clip(len(force) // SAMPLES_PER_BLOCK, FEWEST_BLOCKS, MOST_BLOCKS))
    return Design(
        signals=signals,
        force_n=force,
        columns=whole,
        groups=np.arange(len(force)) * blocks // len(force),
        named=tuple(named),
        unnamed=tuple(unnamed),
        forms=forms,
        sources={source.name: source for source in sources},
        noise=noise_of([residual], freedom),
        freedom=freedom,
        noise_square=float(residual @ residual),
    )


def _left(columns: NDArray[np.float64], force: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """What columns, some of which may say the same, leave of the force, and how many are independent."""
    u, s, _ = np.linalg.svd(columns / _norms(columns), full_matrices=False)
    u = u[:, s > SAME * s[0]]
    return force - u @ (u.T @ force), u.shape[1]


def _norms(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.maximum(np.linalg.norm(columns, axis=0), 1e-300))


def _shifted(candidates: Sequence[Candidate], shift: int) -> tuple[Candidate, ...]:
    """Candidates with their columns moved behind a longer base."""
    return tuple(
        Candidate(c.name, tuple(Variant(v.columns + shift, v.prior, v.shape) for v in c.variants)) for c in candidates
    )
