"""Draws what is hidden in a session, large enough to be seen, or small enough not to be, and says how large that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.families import families
from tests.plant.blind.limits import TESTABLE_SIGMA, Limits
from tests.plant.blind.listed import CONCEALED, LISTED, SINGLE
from tests.plant.blind.unlisted import UNLISTED
from tests.plant.linear import LinearSession

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.plant.arrays import FloatArray
    from tests.plant.blind.circumstances import Circumstances
    from tests.plant.blind.effect import Effect
    from tests.plant.mechanisms.base import Mechanism

DRAWS = 40
LARGEST = 10.0
"""Sizes go from barely testable to so many times that, evenly in the logarithm."""
FAINT = (0.1, 0.5)
"""Sizes of what nobody can see."""
SEPARABLE = 0.3
"""Share of an effect's standard deviations that must be left with the other one fitted too."""


@dataclass(frozen=True)
class Hidden:
    """An effect with its size, and what the answer says of it."""

    effect: Effect
    scale: float
    answer: dict[str, Any]

    @property
    def mechanism(self) -> Mechanism:
        """As it acts."""
        return self.effect.at(self.scale)


class Hider:
    """Hides effects in one session."""

    def __init__(self, rng: np.random.Generator, circumstances: Circumstances) -> None:
        self._rng = rng
        self._base: list[Mechanism] = [circumstances.kinematics]
        self._scene = circumstances.scene()
        self._session = LinearSession(self._scene)
        self._limits = Limits(
            self._session, circumstances.noise, circumstances.rate_hz, self._base, angles=circumstances.angles
        )

    def single(self, name: str) -> list[Hidden]:
        """One effect of the list; another one where this one cannot be large enough on this plan."""
        for draw in range(DRAWS):
            effect = self._drawn(name if draw < DRAWS // 4 else str(self._rng.choice(SINGLE)))
            scale = self._size() * TESTABLE_SIGMA / self._limits.sigmas(self._unit(effect))
            if scale <= effect.most:
                return [self._hidden(effect, scale, None)]
        raise ArithmeticError("nothing of the list shows on this plan")

    def pair(self) -> list[Hidden]:
        """Two effects of the list, each of which shows with the other one fitted too."""
        for _ in range(DRAWS):
            names = [str(name) for name in self._rng.choice([*SINGLE, "cog-shift"], 2, replace=False)]
            effects = [self._drawn(name) for name in names]
            if any(effect.carriers for effect in effects):
                # What needs gravity is hidden beside it.
                effects = [e for e in effects if e.carriers] + [*next(e for e in effects if e.carriers).carriers]
            found = self._together(effects)
            if found:
                return found
        raise ArithmeticError("no two effects of the list show together on this plan")

    def outside(self, name: str) -> list[Hidden]:
        """One effect outside the list, of which no effect of the list leaves less than the size asked for."""
        rivals = families(self._session)
        for draw in range(DRAWS):
            kind = name if draw < DRAWS // 4 else str(self._rng.choice(list(UNLISTED)))
            effect: Effect = UNLISTED[kind](self._rng, self._scene)
            unit = self._unit(effect)
            left = {rival: self._limits.sigmas(unit, columns) for rival, columns in rivals.items()}
            nearest = min(left, key=lambda rival: left[rival])
            scale = self._size() * TESTABLE_SIGMA / max(left[nearest], 1e-9)
            if scale <= effect.most and left[nearest] > SEPARABLE * self._limits.sigmas(unit):
                hidden = self._hidden(effect, scale, rivals[nearest])
                hidden.answer.update(listed=False, nearest=nearest)
                return [hidden]
        raise ArithmeticError("nothing outside the list shows on this plan")

    def concealed(self, name: str) -> list[Hidden]:
        """One effect that the kinematic parameters swallow so far that nobody can see it."""
        effect: Effect = CONCEALED[name](self._rng, self._scene)
        sigmas = self._limits.sigmas(self._unit(effect), self._columns(effect.carriers))
        scale = min(float(self._rng.uniform(*FAINT)) * TESTABLE_SIGMA / max(sigmas, 1e-9), effect.most)
        hidden = [self._hidden(effect, scale, self._columns(effect.carriers))]
        return [*hidden, *(self._hidden(c, c.carrier_amplitude, None) for c in effect.carriers)]

    def _together(self, effects: Sequence[Effect]) -> list[Hidden]:
        columns = [self._columns([effect]) for effect in effects]
        found = []
        for effect, beside in zip(effects, reversed(columns), strict=True):
            unit = self._unit(effect)
            alone, left = self._limits.sigmas(unit), self._limits.sigmas(unit, beside)
            scale = effect.carrier_amplitude or self._size() * TESTABLE_SIGMA / max(left, 1e-9)
            if left < SEPARABLE * alone or scale > effect.most:
                return []
            found.append(self._hidden(effect, scale, beside))
        return found

    def _drawn(self, name: str) -> Effect:
        effect: Effect = LISTED[name](self._rng, self._scene)
        return effect

    def _size(self) -> float:
        return float(np.exp(self._rng.uniform(0.0, np.log(LARGEST))))

    def _unit(self, effect: Effect) -> FloatArray:
        """Signature `(m,)` [mm] per unit of the largest amplitude."""
        return self._change(effect, effect.direction)

    def _change(self, effect: Effect, amplitudes: FloatArray) -> FloatArray:
        # A thousandth of what could happen is small; steps of gaps and balls are proportional to it anyway.
        step = 1e-3 * effect.most
        carriers = [*self._base, *effect.carried_by()]
        return self._session.change(effect.make(step * amplitudes), carriers) / step

    def _columns(self, effects: Sequence[Effect]) -> FloatArray | None:
        """All amplitudes of effects `(m, d)`, one at a time."""
        columns = [
            self._change(effect, sign * row)
            for effect in effects
            for sign, row in zip(effect.signs(), np.eye(len(effect.direction)), strict=True)
        ]
        return np.stack(columns, axis=1) if columns else None

    def _hidden(self, effect: Effect, scale: float, beside: FloatArray | None) -> Hidden:
        unit = self._unit(effect)
        sigmas = scale * self._limits.sigmas(unit, beside)
        amplitudes = scale * effect.direction
        own = self._limits.information(self._columns([effect]), beside)
        # What nothing tells of may be as large as it likes, within what could happen.
        deviations = np.sqrt(np.diag(np.linalg.inv(own + np.eye(len(own)) / effect.most**2)))
        singly = float(np.max(np.abs(amplitudes) / deviations))
        answer = {
            "name": effect.name,
            "listed": True,
            "testable": sigmas >= TESTABLE_SIGMA * (1.0 - 1e-9),
            "size": sigmas / TESTABLE_SIGMA,
            "size_with_all_amplitudes_free": singly / TESTABLE_SIGMA,
            "largest_amplitude": scale,
            "unit": effect.unit,
            "struts": list(effect.struts),
            "variables": list(effect.variables),
            "amplitudes": dict(zip(effect.keys, amplitudes.tolist(), strict=True)) if effect.keys else {},
            "signature_rms_um": 1000.0 * scale * float(np.sqrt(np.mean(unit**2))),
            "unconcealed_rms_um": scale * self._limits.left_rms_um(unit),
        }
        return Hidden(effect, scale, answer)
