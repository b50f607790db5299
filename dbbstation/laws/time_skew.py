"""Time shift between force and position."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping


MOST_SAMPLES = 5.0
"""Largest shift between filtered channels of one logger, in samples."""


class ForceTimeSkew(ScaledSource):
    """The force is late by d: F(t) = F_true(t - d), to first order F_true - d dF/dt."""

    name = "time-skew"
    varies_with = "rate of force"
    needs = ("force_rate_n_s",)
    form_uncertainty = 0.1  # a filter's delay depends slightly on frequency
    texts = Texts(
        what="The force channel is late or early against the position: filters, bus cycles, the current loop.",
        shows="Peaks where the force changes quickly, at every start, stop and reversal, of one sign where it rises and "
        "of the other where it falls.",
        confirm="Read delay and filter of both channels out of the drive's manual, or shake the drive and look at both "
        "on an oscilloscope.",
        cure="Use channels of one clock, switch filters off, or shift one channel by the delay.",
        equation="F = -d dF/dt",
        origin="Taylor's series to first order; delays in identification: Ljung, System Identification (1999), sec. 14",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter("delay_ms", "ms", 1e3 * scale.sample_s, "of the force; negative: it is early")
        # The low-pass bounds the noise of the difference.
        return (SourceForm((size,), lambda v, _: -1e-3 * v["force_rate_n_s"][:, None]),)

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:
        return abs(values.get("delay_ms", 0.0)) <= MOST_SAMPLES * 1e3 * scale.sample_s
