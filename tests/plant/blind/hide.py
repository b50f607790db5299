"""Draws what is hidden in a session, large enough to be seen, or small enough not to be, and says how large that is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.disturbances import DISTURBANCES, NAME_ON_THE_LIST
from tests.plant.blind.families import families
from tests.plant.blind.limits import TESTABLE_SIGMA, Limits
from tests.plant.blind.listed import CONCEALED, LISTED, SINGLE
from tests.plant.blind.perturb import Perturbation, drawn_perturbation
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
UNSEEN = (0.1, 0.5)
"""Sizes of what nobody can see."""
SEPARABLE = 0.3
"""Share of an effect's standard deviations that must be left with the others fitted too."""
FAINT_SIGMAS = (3.0, 7.0)
"""Standard deviations of faint effects: log Bayes factors of about half the square, less what the size's prior costs."""


@dataclass(frozen=True)
class Hidden:
    """An effect with its size, and what the answer says of it."""

    effect: Effect
    scale: float
    answer: dict[str, Any]
    perturbation: Perturbation | None = None

    @property
    def mechanism(self) -> Mechanism:
        law = self.effect.at(self.scale)
        return law if self.perturbation is None else self.perturbation.apply(law)


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

    def at(self, effects: Sequence[Effect], scales: Sequence[float]) -> list[Hidden]:
        return [
            self._hidden(effect, scale, self._columns([other for other in effects if other is not effect]))
            for effect, scale in zip(effects, scales, strict=True)
        ]

    def single(self, name: str) -> list[Hidden]:
        for draw in range(DRAWS):
            effect = self._drawn(name if draw < DRAWS // 4 else str(self._rng.choice(SINGLE)))
            scale = self._size() * TESTABLE_SIGMA / self._limits.sigmas(self._unit(effect))
            if scale <= effect.most:
                return [self._hidden(effect, scale, None)]
        raise ArithmeticError("nothing of the list shows on this plan")

    def several(self, count: int) -> list[Hidden]:
        for _ in range(DRAWS):
            names = [str(name) for name in self._rng.choice([*SINGLE, "cog-shift"], count, replace=False)]
            effects = [self._drawn(name) for name in names]
            needy = next((effect for effect in effects if effect.carriers), None)
            if needy is not None:
                # What needs gravity is hidden beside it.
                first = [needy, *needy.carriers]
                known = {effect.name for effect in first}
                effects = [*first, *(effect for effect in effects if effect.name not in known)][:count]
            found = self._together(effects)
            if found:
                return found
        raise ArithmeticError(f"no {count} effects of the list show together on this plan")

    def faint(self, name: str) -> list[Hidden]:
        """One effect of the list, about as large as what is barely seen; every second time beside a loud one."""
        for draw in range(DRAWS):
            effect = self._drawn(name if draw < DRAWS // 4 else str(self._rng.choice(SINGLE)))
            loud = self._drawn(str(self._rng.choice([other for other in SINGLE if other != effect.name])))
            beside = [loud] if self._rng.random() < 0.5 else []
            found = self._together([effect, *beside], faint=1)
            if found:
                return found
        raise ArithmeticError("nothing of the list shows faintly on this plan")

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

    def disturbed(self, name: str) -> list[Hidden]:
        """One effect of the list, and a disturbance beside it; each shows with the other fitted too."""
        for draw in range(DRAWS):
            kind = name if draw < DRAWS // 2 else str(self._rng.choice(list(DISTURBANCES)))
            known = NAME_ON_THE_LIST.get(kind)
            listed = self._drawn(str(self._rng.choice([one for one in SINGLE if one != known])))
            found = self._together([listed, DISTURBANCES[kind](self._rng, self._scene)])
            if found:
                found[1].answer.update({"disturbance": kind, "name": known or kind, "listed": known is not None})
                return found
        raise ArithmeticError("no disturbance shows on this plan")

    def concealed(self, name: str) -> list[Hidden]:
        """One effect that the kinematic parameters swallow so far that nobody can see it."""
        effect: Effect = CONCEALED[name](self._rng, self._scene)
        sigmas = self._limits.sigmas(self._unit(effect), self._columns(effect.carriers))
        scale = min(float(self._rng.uniform(*UNSEEN)) * TESTABLE_SIGMA / max(sigmas, 1e-9), effect.most)
        hidden = [self._hidden(effect, scale, self._columns(effect.carriers))]
        return [*hidden, *(self._hidden(c, c.carrier_amplitude, None) for c in effect.carriers)]

    def perturbed(self, hidden: Hidden, rng: np.random.Generator) -> Hidden:
        """The same effect off its law; the answer says how far, as a share of it and in standard deviations."""
        perturbation = drawn_perturbation(rng, hidden.effect.name)
        if perturbation is None:
            return hidden
        carriers = [*self._base, *hidden.effect.carried_by()]
        exact = self._session.change(hidden.mechanism, carriers)
        deviation = self._session.change(perturbation.apply(hidden.mechanism), carriers) - exact
        told = {
            "size": perturbation.size,
            "forms": list(perturbation.forms),
            "signature_share": float(np.sqrt(np.mean(deviation**2) / np.mean(exact**2))),
            "sigmas_beside_the_law": self._limits.sigmas(deviation, self._columns([hidden.effect])),
        }
        return replace(hidden, answer={**hidden.answer, "deviation": told}, perturbation=perturbation)

    def _together(self, effects: Sequence[Effect], faint: int = 0) -> list[Hidden]:
        """Effects with the sizes asked for, the first `faint` of them small; none if one hides behind the others."""
        found = []
        for place, effect in enumerate(effects):
            beside = self._columns([other for other in effects if other is not effect])
            unit = self._unit(effect)
            alone, left = self._limits.sigmas(unit), self._limits.sigmas(unit, beside)
            if place < faint:
                scale = self._faint_sigmas() / max(left, 1e-9)
            else:
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

    def _faint_sigmas(self) -> float:
        """Evenly in the square, as log Bayes factors go."""
        least, most = FAINT_SIGMAS
        return float(np.sqrt(self._rng.uniform(least**2, most**2)))

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
