"""Loads: a constant, a spring, a wave along the travel, forces in limited stretches of time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats


class ConstantLoad(ScaledSource):
    """A constant force: part of a weight, or a zero offset of the channel."""

    name = "constant-load"
    needs = ("speed_mm_s",)
    form_uncertainty = 0.0  # a constant is exact
    texts = Texts(
        what="A constant force adds to the drive's: the share of the platform's weight along a strut, a spring that is "
        "long against the travel, or a wrong zero of the force or current channel.",
        shows="Both directions of travel need a force that is shifted by the same amount, at every speed.",
        confirm="Release the drive from its load, or tilt it, and record again; with the motor off the channel must "
        "read zero.",
        cure="Balance the weight, or enter it as a gravity feed-forward; zero the channel.",
        equation="F = F_0",
        origin="statics; offset of the drive in Janot, Vandanjon and Gautier, IEEE TCST 22 (2014)",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter("load_n", "N", 0.3 * scale.force_n, "force that the drive must add at every position")
        return (SourceForm((size,), lambda v, _: np.ones((len(v["speed_mm_s"]), 1))),)


class Stiffness(ScaledSource):
    """A spring: F = k (x - x_m), x_m the mean position."""

    name = "stiffness"
    needs = ("position_mm",)
    form_uncertainty = 0.05  # springs, hoses and cable chains are straight to some 5 %
    texts = Texts(
        what="A spring acts along the drive: a bellows, a cable chain, a hose, a weight balance, or a weight whose "
        "share along the strut changes with its length.",
        shows="The force rises or falls along the travel by the same amount forwards and backwards.",
        confirm="Stop at five places, reverse briefly at each and take the mean of the forces of both directions.",
        cure="Take the spring off or lead the cable another way; otherwise enter it as a feed-forward over position.",
        equation="F = k (x - x_m)",
        origin="Hooke; stiffness of inverse dynamic models in Gautier and Khalil, IEEE TRA 6 (1990) 368",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter(
            "stiffness_n_mm",
            "N/mm",
            1e-3 * 0.6 * scale.force_n / scale.travel_m,
            "force per travel, positive: a spring",
        )
        middle = 1e3 * scale.mean_m
        return (SourceForm((size,), lambda v, _: (v["position_mm"] - middle)[:, None]),)


class Cogging(ScaledSource):
    """Force periodic in position: F = c cos(2 pi x / p) + s sin(2 pi x / p)."""

    name = "cogging"
    varies_with = "position wave"
    needs = ("position_mm",)
    form_uncertainty = 0.05  # magnets and slots differ from pole to pole
    texts = Texts(
        what="The motor's torque ripples with the angle (magnets, commutation), or the screw does once per turn or per "
        "ball that passes.",
        shows="A wave of the force over position that is the same forwards and backwards, at every speed.",
        confirm="Travel slowly at constant speed both ways: the waves stand at the same positions. Compare the period "
        "with the screw's lead, and with the lead divided by the motor's poles or slots.",
        cure="Ripple compensation of the drive; a concentric coupling; otherwise enter the wave as a feed-forward over "
        "position.",
        equation="F = c cos(2 pi x / p) + s sin(2 pi x / p)",
        origin="Holtz and Springob, Identification and compensation of torque ripple in high-precision permanent "
        "magnet motor drives, IEEE Trans. Ind. Electron. 43 (1996) 309",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = 0.1 * scale.force_n
        cosine = Parameter("cosine_n", "N", size, "amplitude of the cosine, position zero is where it is greatest")
        sine = Parameter("sine_n", "N", size, "amplitude of the sine")
        found = []
        for wave in scale.waves_per_m:
            # A wave wrong by a quarter period over the travel does not fit; three points enclose the best one.
            grid = tuple(1e3 / (wave + step / scale.travel_m) for step in (0.15, 0.0, -0.15))
            period = Parameter("period_mm", "mm", 1e3 / wave, "travel of one wave", grid)
            label = f"{1e3 / wave:.3g} mm"
            found.append(SourceForm((cosine, sine, period), _wave, label, scale.waves_tried))
        return tuple(found)


def _wave(variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
    angle = 2.0 * np.pi * variables["position_mm"] / shapes["period_mm"]
    return np.column_stack([np.cos(angle), np.sin(angle)])


class TransientForce(ScaledSource):
    """Pulses and steps: F = sum of a_k over t_k to t_k + d_k.

    The source has no form, because the comparison searches for stretches (`dbbstation/inference/stretches.py`).
    """

    name = "transient-force"
    needs = ("t_s",)
    form_uncertainty = 0.02  # the low-pass rounds edges of pulses
    texts = Texts(
        what="A force that the recorded one does not contain acts for some time: a push, a clamp, a cutting force, a "
        "second drive, or a channel whose zero jumps.",
        shows="What is left jumps at one time and jumps back later, or does not, wherever the drive is and however fast.",
        confirm="Repeat the same motion with nothing else switched on; log what else is running beside the drive.",
        cure="Keep that force away, record it, or enter it as a disturbance at its times.",
        equation="F = sum_k a_k [t_k <= t <= t_k + d_k]",
        origin="change points by the best of all stretches: Jackson et al., IEEE Signal Process. Lett. 12 (2005) 105; "
        "look-elsewhere odds: Gross and Vitells, Eur. Phys. J. C 70 (2010) 525",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:  # noqa: ARG002
        return ()
