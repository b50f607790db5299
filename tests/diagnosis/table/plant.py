"""An axis with a load, its simulation, and what it does that the simulation does not say; shares no code with the package."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Truth:
    """What the real axis does beside the simulation; micrometres, zero for nothing.

    Attributes:
        play_um: lost motion, half of it either way.
        twice_um: amplitude of an error that closes twice per turn of the screw.
        load_by_place_um: error at one end of the travel under full load; it is bent by load times place.
        step_um: height of a step at half time.
        pulse_um: height of a pulse of four seconds.
        lag_ms: delay of the reading.
        expansion_um_k: by kelvin of the oil.
        screw_um_m_k: expansion of the screw, held where the place is -100 mm, by metre and kelvin of the oil beyond 22 degC.
        drift_um_min: by minute.
        stiffness_um: error of the simulation's parameter `stiffness`, which the derivative column offers.
        noise_um: standard deviation of one row.
        correlation: of the noise from one row to the next.
    """

    play_um: float = 0.0
    twice_um: float = 0.0
    load_by_place_um: float = 0.0
    step_um: float = 0.0
    pulse_um: float = 0.0
    lag_ms: float = 0.0
    expansion_um_k: float = 0.0
    screw_um_m_k: float = 0.0
    drift_um_min: float = 0.0
    stiffness_um: float = 0.0
    noise_um: float = 2.0
    correlation: float = 0.0


@dataclass(frozen=True)
class Recording:
    """Columns of one run."""

    columns: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    def csv(self) -> str:
        names = ",".join(self.columns)
        rows = zip(*self.columns.values(), strict=True)
        return "\n".join([names, *(",".join(f"{value:.7g}" for value in row) for row in rows)]) + "\n"

    def write(self, path: Path) -> Path:
        path.write_text(self.csv(), encoding="utf-8")
        return path


RATE_HZ = 20.0
TRAVEL_MM = 200.0
SCREW_MM = 20.0
PULSE_S = (31.0, 35.0)


def record(truth: Truth, seed: int = 1, *, seconds: float = 75.0, derivative: bool = False) -> Recording:
    """Record a to-and-fro over the travel with a changing load, while the oil warms up."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    speed = 2.0 * np.pi * np.array([0.061, 0.023])
    place = 70.0 * np.sin(speed[0] * t + 0.4) + 30.0 * np.sin(speed[1] * t)
    velocity = 70.0 * speed[0] * np.cos(speed[0] * t + 0.4) + 30.0 * speed[1] * np.cos(speed[1] * t)
    load = 400.0 * np.sin(2.0 * np.pi * 0.017 * t + 1.1)
    turned = np.mod(360.0 * place / SCREW_MM, 360.0)
    oil = 22.0 + 6.0 * (1.0 - np.exp(-t / 40.0)) + rng.normal(0.0, 0.05, len(t))
    simulated = place + 0.002 * load / 400.0
    error_um = (
        0.5 * truth.play_um * np.sign(velocity)
        + truth.twice_um * np.cos(np.radians(2.0 * turned) - 0.7)
        + truth.load_by_place_um * (load / 400.0) * (place / 100.0)
        + truth.step_um * (t >= 0.5 * seconds)
        + truth.pulse_um * ((t >= PULSE_S[0]) & (t < PULSE_S[1]))
        - truth.lag_ms * velocity
        + truth.expansion_um_k * (oil - 22.0)
        + truth.screw_um_m_k * 1e-3 * (place + 100.0) * (oil - 22.0)
        + truth.drift_um_min * t / 60.0
        + truth.stiffness_um * load / 400.0
    )
    noise = rng.normal(0.0, 1.0, len(t))
    for k in range(1, len(t)):
        noise[k] = truth.correlation * noise[k - 1] + np.sqrt(1.0 - truth.correlation**2) * noise[k]
    columns = {
        "t_s": t,
        "measured_mm": simulated + 1e-3 * (error_um + truth.noise_um * noise),
        "simulated_mm": simulated,
        "place_mm": place,
        "screw_deg": turned,
        "load_n": load,
        "oil_temp_c": oil,
    }
    if derivative:
        columns["d_stiffness_um"] = 1e-3 * load / 400.0
    return Recording(columns)
