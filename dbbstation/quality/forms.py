"""Joint normal distribution of the forms of runs with shared causes, extended run by run.

The covariance of forms is a sum over machine causes, causes shared by several runs, and each run's own part. For each
size of machine errors, a matrix whitens all forms. A further run adds rows to this matrix, as to a Cholesky factor
[Golub and Van Loan, Matrix Computations, 4.2]. A projection removes runs [Rasmussen and Williams, Gaussian Processes
for Machine Learning (2006), section 5.4.2].
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.stated import unseen_um2
from dbbstation.trace.expected import COEFFICIENTS, HIGHEST_HARMONIC, along_travel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.quality.knowledge import Seen

SIZES = np.geomspace(0.03, 3.0, 9)
"""Machine errors relative to their usual or stated size: from a machine calibrated to hundredths of a millimetre to a
carelessly assembled one."""

FIRST_COSINE, FIRST_SINE = 1, HIGHEST_HARMONIC + 1
"""Indices of the first harmonic's coefficients, which a shift of the circle changes."""

ANYWHERE_UM = 1e4
"""Standard deviation [µm] that removes the centre's influence for a ball set up under the spindle."""


LEAST_UM2 = 1e-12
"""Least variance of a coefficient [µm²], a picometre squared, so forms without noise can be whitened too."""


@dataclass(frozen=True, eq=False)
class RunForm:
    """The form of one run along its travel, with the effects of causes.

    Attributes:
        effects_um: changes by one standard deviation of each cause, shape (7, p) each [µm]; keys are the cause and the
            label of runs with shared values, empty for machine causes.
        own_um: standard deviation of the run's own part, shape (7,) [µm].
        off_um: columns of forms minus the expectation that uses no other runs, shape (7, k) [µm].
        started_s: start of the run [s].
        drift_um_s: drift of the reading at one place during its turn [µm/s].
    """

    effects_um: Mapping[tuple[str, str], Floats]
    own_um: Floats
    off_um: Floats
    started_s: float
    drift_um_s: float


def form_of(one: Seen, off_um: Floats) -> RunForm:
    """Return a run's form and effects; `off_um` as in `RunForm.off_um`."""
    signs = along_travel(one.run.circle)[:, None]
    effects = {} if one.run.expected is None else one.run.expected.effects_um
    along = {key: signs * effect for key, effect in effects.items()}
    return RunForm(along, np.sqrt(own_um2(one)), off_um, one.run.started_s or 0.0, one.drift_um_s)


def own_um2(one: Seen) -> Floats:
    """Return each coefficient's variance due to the run's own part, shape (7,) [µm²]."""
    own = np.full(COEFFICIENTS, max(0.5 * unseen_um2(one, one), LEAST_UM2))
    if one.run.expected is not None and not one.run.expected.place_known:
        own[[FIRST_COSINE, FIRST_SINE]] += ANYWHERE_UM**2
    return own


Held = tuple["Seen", ...]
"""Key of a form: a run, or a run and the run as which it is judged."""


class Forms:
    """Forms of a session's runs; computed runs are kept, and further runs are added."""

    def __init__(self, form: Callable[[Held], RunForm]) -> None:
        self._form = form
        self._held: list[tuple[Held, RunForm]] = []
        self._machine, self._rest = _Columns(), _Columns()
        self._whitening = np.zeros((len(SIZES), 0, 0))
        self._white = np.zeros((len(SIZES), 0, 0))
        self._log_determinants: list[Floats] = []

    def hold(self, runs: Sequence[Held]) -> None:
        """Compute these runs; discard stored runs from the first difference on."""
        pairs = enumerate(zip(runs, self._held, strict=False))
        alike = next((k for k, (one, (held, _)) in pairs if _key(one) != _key(held)), min(len(runs), len(self._held)))
        del self._held[alike:], self._log_determinants[alike:]
        for one in runs[alike:]:
            self._add(one, self._form(one))

    def _add(self, one: Held, form: RunForm) -> None:
        n = COEFFICIENTS * len(self._held)
        behind = n + COEFFICIENTS
        unit = 1.0 / form.own_um[:, None]
        of_machine = {key: unit * effect for key, effect in form.effects_um.items() if not key[1]}
        of_rest = {key: unit * effect for key, effect in form.effects_um.items() if key[1]}
        by_machine, by_rest = self._machine.add(n, of_machine), self._rest.add(n, of_rest)
        columns = unit * np.column_stack([form.off_um, form.started_s * np.eye(COEFFICIENTS)[0]])
        self._make_room(behind, columns.shape[1])
        covariance = SIZES[:, None, None] ** 2 * by_machine + by_rest
        before = self._whitening[:, :n, :n]
        shared = covariance[:, :, :n] @ before.mT
        variance, axes = np.linalg.eigh(covariance[:, :, n:] + np.eye(COEFFICIENTS) - shared @ shared.mT)
        variance = np.maximum(variance, 1.0)  # the run's own part; rounding may give less
        white = axes.mT / np.sqrt(variance)[:, :, None]
        self._whitening[:, :n, n:behind] = 0.0
        self._whitening[:, n:behind, :n] = -white @ (shared @ before)
        self._whitening[:, n:behind, n:behind] = white
        self._white[:, n:behind] = white @ (columns - shared @ self._white[:, :n])
        self._held.append((one, form))
        self._log_determinants.append(np.sum(np.log(variance), axis=1))

    def _make_room(self, rows: int, columns: int) -> None:
        room = self._whitening.shape[1]
        if rows > room:
            wider = np.zeros((len(SIZES), 2 * rows, 2 * rows))
            wider[:, :room, :room] = self._whitening
            white = np.zeros((len(SIZES), 2 * rows, columns))
            white[:, :room] = self._white[:, :room] if room else 0.0
            self._whitening, self._white = wider, white

    def part(self, runs: Sequence[Held], beside: Held | None = None) -> FormsBesides:
        """Return the distribution of some stored runs, which predicts the remaining ones.

        Args:
            beside: run to be compared, whose overlap also counts for the drift.
        """
        chosen = {_key(one) for one in runs}
        left_out = [k for k, (held, _) in enumerate(self._held) if _key(held) not in chosen]
        counted = chosen if beside is None else {*chosen, _key(beside)}
        rates = [form.drift_um_s for held, form in self._held if _key(held) in counted]
        return FormsBesides(self, left_out, sqrt(np.mean(np.square(rates))))

    def rows(self, runs: Sequence[Held]) -> Integers:
        """Return the row numbers of stored runs."""
        wanted = {_key(one) for one in runs}
        return rows_of([k for k, (held, _) in enumerate(self._held) if _key(held) in wanted])

    def all(self) -> tuple[Floats, Floats, Floats]:
        """Return the whitening matrices of all forms, shape (9, n, n), their whitened columns with drift, (9, n, k + 1), and log determinants."""
        n = COEFFICIENTS * len(self._held)
        return self._whitening[:, :n, :n], self._white[:, :n], np.sum(self._log_determinants, axis=0)

    def place(self, one: Held) -> tuple[int, Floats]:
        """Return the index of a stored run, and the standard deviation of its own part, shape (7,) [µm]."""
        return next((k, form.own_um) for k, (held, form) in enumerate(self._held) if _key(held) == _key(one))


class FormsBesides:
    """Distribution of some stored runs for each of SIZES, and their prediction of omitted runs.

    The drift seen in overlaps adds a rank-one term to the covariance of all runs [Golub and Van Loan, 2.1.4].

    Attributes:
        white: whitened columns, shape (9, n, k).
        log_determinant: of the covariance, in units of each run's own part, shape (9,).
    """

    def __init__(self, forms: Forms, left_out: Sequence[int], rate_um_s: float) -> None:
        self._forms, self._left_out = forms, left_out
        self._whitening, columns, log_determinant = forms.all()
        self._basis, self._root = np.linalg.qr(self._whitening[:, :, rows_of(left_out)])
        self._along = self._basis.mT @ columns
        columns = columns - self._basis @ self._along
        sizes = np.abs(np.diagonal(self._root, axis1=1, axis2=2))
        self._drift, off = columns[:, :, -1:], columns[:, :, :-1]
        square = np.sum(self._drift**2, axis=(1, 2))
        grown = 1.0 + rate_um_s**2 * square
        self._share = ((1.0 - 1.0 / np.sqrt(grown)) / np.where(square > 0.0, square, 1.0))[:, None, None]
        self._variance = (rate_um_s**2 / grown)[:, None, None]
        self._amount = self._variance * (self._drift.mT @ off)
        self.white = off - self._share * self._drift @ (self._drift.mT @ off)
        self.log_determinant = log_determinant + 2.0 * np.sum(np.log(sizes), axis=1) + np.log(grown)

    def log_likelihoods(self) -> Floats:
        """Return each column's log density for each of SIZES, shape (9, k), up to a constant."""
        return -0.5 * (np.sum(self.white**2, axis=1) + self.log_determinant[:, None])

    def beside(self, one: Held) -> tuple[Floats, Floats]:
        """Return an omitted run's columns minus prediction, shape (9, 7, k) [µm], and their covariance, (9, 7, 7) [µm²]."""
        place, own_um = self._forms.place(one)
        rows = rows_of([self._left_out.index(place)])
        # For omitted runs, the residual is e = B^-1 p with covariance B^-1; B is their block of the inverse covariance,
        # and p their rows of the inverse times the readings.
        root = np.linalg.inv(self._root)[:, rows]
        apart = root @ self._along
        drift, off = apart[:, :, -1:], apart[:, :, :-1]
        covariance = root @ root.mT + self._variance * drift @ drift.mT
        return own_um[:, None] * (off - drift @ self._amount), own_um[:, None] * covariance * own_um

    def length_without(self, size: int, rows: Integers) -> float:
        """Return the distance of some rows from their prediction by all other rows, in standard deviations."""
        basis, drift = self._basis[size], self._drift[size]
        seen = self._whitening[size][:, rows]
        seen = seen - basis @ (basis.T @ seen)
        seen -= self._share[size] * drift @ (drift.T @ seen)
        pull = seen.T @ self.white[size][:, 0]
        return sqrt(pull @ np.linalg.solve(seen.T @ seen, pull))


class _Columns:
    def __init__(self) -> None:
        self._of: dict[tuple[str, str], slice] = {}
        self._effects = np.zeros((0, 0))

    def add(self, n: int, effects: Mapping[tuple[str, str], Floats]) -> Floats:
        """Append one form's rows after n others; return its covariances with all rows, shape (7, n + 7)."""
        wide = max((place.stop for place in self._of.values()), default=0)
        for cause, effect in effects.items():
            if cause not in self._of:
                self._of[cause] = slice(wide, wide + effect.shape[1])
                wide = self._of[cause].stop
        behind = n + COEFFICIENTS
        room = tuple(
            most if need <= most else max(2 * most, need)
            for need, most in zip((behind, wide), self._effects.shape, strict=True)
        )
        if room != self._effects.shape:
            effects_before, self._effects = self._effects, np.zeros(room)
            self._effects[:n, : effects_before.shape[1]] = effects_before[:n]
        self._effects[n:behind] = 0.0
        for cause, effect in effects.items():
            self._effects[n:behind, self._of[cause]] = effect
        return self._effects[n:behind, :wide] @ self._effects[:behind, :wide].T


def rows_of(places: Sequence[int]) -> Integers:
    """Return the row numbers of forms with these indices."""
    return (COEFFICIENTS * np.array(places, dtype=np.int64)[:, None] + np.arange(COEFFICIENTS)).ravel()


def _key(one: Held) -> tuple[int, ...]:
    return tuple(map(id, one))
