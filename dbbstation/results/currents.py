"""What the motor currents of a calibration say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dbbstation.results.serialise import Quantified


@dataclass(frozen=True)
class MotorResult:
    """One motor; None where the recordings leave a number open.

    Attributes:
        motor: 1 to 6.
        gain_a_kn: current per force of the strut.
        coulomb_n: friction at any speed.
        viscous_ns_mm: friction per speed.
        load_share_n_kn: friction per load.
        asymmetry_n: what differs by direction.
        force_per_current: of the strut [N/A].
        torque_per_current: at the screw [Nm/A]; None where the machine file does not say its lead.
        residual_a: root mean square that the model leaves [A].
        noise_a: of a reading [A].
        noise_correlation_samples: samples after which noise is new.
        samples: readings that went in.
    """

    motor: int
    gain_a_kn: Quantified | None
    coulomb_n: Quantified | None
    viscous_ns_mm: Quantified | None
    load_share_n_kn: Quantified | None
    asymmetry_n: Quantified | None
    force_per_current: Quantified | None
    torque_per_current: Quantified | None
    residual_a: float | None
    noise_a: float | None
    noise_correlation_samples: float | None
    samples: int


@dataclass(frozen=True)
class CurrentsResult:
    """Motor currents.

    Attributes:
        weight_taken_as_known_n: of the platform, on which forces rest [N].
        motors: one after the other.
        centre_of_gravity: by coordinate and channel, `circles`, `currents` and `both` [mm]; None where a channel leaves it open.
        notes: what was left out and what cannot be told, in words.
    """

    weight_taken_as_known_n: float
    motors: tuple[MotorResult, ...]
    centre_of_gravity: Mapping[str, Mapping[str, Quantified | None]]
    notes: tuple[str, ...]
