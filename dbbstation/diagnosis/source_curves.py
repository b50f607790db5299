"""Curves of found sources over their variable, with readings; gain of each test by named causes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.calibration.reporting.residual_map import names_of_tests
from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.drawn import Branch, GainOfTest, SourceCurves, Trace
from dbbstation.diagnosis.parts import BY_DIRECTION
from dbbstation.diagnosis.shapes import SIGNED, TEMPERATURES, Follows, variables
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.geometry import STRUTS
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.laws.temperature import FollowsTemperature
from dbbstation.trace.analysis import figures
from dbbstation.trace.recording import by_angle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.model.machine_model import Actual
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import Motion


SEEN = 2.5
"""Fine bins with more than this multiple of the usual uncertainty are omitted, because they would dominate the figure."""

UNITS = {
    "strut-length": "mm",
    "strut-force": "N",
    "time": "s",
    "temperature": "K",
    **dict.fromkeys(TEMPERATURES, "°C"),
    "angle": "°",
}
"""Units of variables in figures."""

SENSES = {1.0: "lengthening", -1.0: "shortening"}
"""Names of branches of direction-dependent curves."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples of all runs by strut or reading, shape (n, c) each."""

    variable: Floats
    sense: Floats
    model_mm: Floats
    gain: Floats


@with_one_thread
def source_curves(diagnosis: Diagnosis) -> tuple[SourceCurves, ...]:
    """Return curves of found sources and of the residual over its variable."""
    left = ("",) if diagnosis.unexplained.follows is not None else ()
    return tuple(_curves(diagnosis, name) for name in (*found_sources(diagnosis), *left))


def found_sources(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the joint fit's sources that the base lacks."""
    base = {term.source.name for term in diagnosis.before.layout.terms}
    return tuple(dict.fromkeys(t.source.name for t in diagnosis.after.layout.terms if t.source.name not in base))


def _curves(diagnosis: Diagnosis, name: str) -> SourceCurves:
    after = diagnosis.after
    wanted = _wanted(diagnosis, name)
    if name:
        moves_struts = any(_strut_mm(after.model.actual(o.motion()), name) is not None for o in after.observations)
    else:
        moves_struts = wanted.moves_struts
    signed = wanted.moves == SIGNED or wanted.variable in BY_DIRECTION
    fine = (wanted.variable, wanted.kind) == ("strut-length", "wave")
    variable = _drawn_over(wanted, after.observations, moves_struts=moves_struts)
    samples = [_samples(after, name, o, variable, moves_struts=moves_struts) for o in after.observations]
    whole = _Samples(
        *(np.vstack([getattr(s, field) for s in samples]) for field in ("variable", "sense", "model_mm", "gain"))
    )
    before, left = np.concatenate(diagnosis.before.residual_mm), np.concatenate(after.residual_mm)
    panels = tuple(
        tuple(
            _branch(whole, column, rows, label, before, left, diagnosis.left.noise, fine=fine)
            for label, rows in _branches(whole.sense[:, column], signed=signed)
        )
        for column in range(whole.gain.shape[1])
    )
    return SourceCurves(
        source=name,
        variable=variable,
        unit=UNITS[variable],
        fine=fine,
        struts=panels if moves_struts else (),
        reading=() if moves_struts else panels[0],
    )


def _wanted(diagnosis: Diagnosis, name: str) -> Follows:
    if not name:
        return diagnosis.unexplained.follows or Follows("")
    source = next(t.source for t in diagnosis.after.layout.terms if t.source.name == name)
    own = source.varies_with == "temperature" and not isinstance(source, FollowsTemperature)
    return Follows("time" if own else source.varies_with)  # only sources of this package state their thermometer


def _drawn_over(wanted: Follows, observations: Sequence[Observation], *, moves_struts: bool) -> str:
    variable = wanted.variable
    if variable in {"temperature", *TEMPERATURES}:
        return variable
    if variable == "time" and all(o.started_s is not None for o in observations):
        return variable
    if not moves_struts or variable == "angle":
        return "angle"
    return "strut-force" if variable == "strut-force" else "strut-length"


def _strut_mm(there: Actual, name: str) -> Floats | None:
    """Return one source's strut errors over a motion, shape (6,) or (n, 6) [mm]."""
    effects = [there.by(f).strut_mm for f in there.model.acting(there.motion) if f.source.name == name]
    return next((effect for effect in effects if effect is not None), None)


def _samples(
    calibration: Calibration, name: str, observation: Observation, variable: str, *, moves_struts: bool
) -> _Samples:
    motion, model = observation.motion(), calibration.model
    bar = model.bar(motion)
    known = variables(motion, model.machine)
    if variable == "angle":
        over = observation.raw.theta_deg[:, None]
    elif variable == "temperature":
        over = _warmer_k(calibration, name, motion)[motion.kept]
    else:
        over = known[variable][motion.kept].reshape(len(observation.raw), -1)
    over = np.broadcast_to(over, (len(over), STRUTS))
    if not moves_struts:
        without = MachineModel(model.machine, tuple(f for f in model.sources if f.source.name != name))
        added = bar.length_mm - without.bar(motion).length_mm
        ones = np.ones((len(added), 1))
        return _Samples(over[:, :1], ones, added[:, None], ones)
    strut = _strut_mm(bar.actual, name)
    whole = np.broadcast_to(0.0 if strut is None else strut, (len(motion), STRUTS))
    return _Samples(
        over,
        known["strut-speed-sign"][motion.kept],
        whole[motion.kept],
        bar.sensitivity.response.per_strut[motion.kept],
    )


def _warmer_k(calibration: Calibration, name: str, motion: Motion) -> Floats:
    """Return temperature rises at a source's thermometers, shape (n, 1) or (n, 6) [K]."""
    own = (t.source for t in calibration.layout.terms if t.source.name == name)
    return next(source.warmer_k(motion) for source in own if isinstance(source, FollowsTemperature))


def _branches(sense: Floats, *, signed: bool) -> list[tuple[str, Flags]]:
    if not signed:
        return [("", np.ones(len(sense), dtype=bool))]
    return [(label, sense == sign) for sign, label in SENSES.items()]


def _branch(
    samples: _Samples,
    column: int,
    rows: Flags,
    sense: str,
    before_mm: Floats,
    left_mm: Floats,
    noise_mm: float,
    *,
    fine: bool,
) -> Branch:
    over, gain = samples.variable[:, column], samples.gain[:, column]
    pieces = int(np.ceil(np.ptp(over) / (BOUNDS.wave_mm / 4.0))) if fine else BOUNDS.curve_pieces
    edges = np.linspace(over.min(), over.max(), pieces + 1)
    piece = np.clip(np.searchsorted(edges, over[rows], side="right") - 1, 0, pieces - 1)
    _, piece, count = np.unique(piece, return_inverse=True, return_counts=True)

    def mean(values: Floats) -> Floats:
        return np.bincount(piece, values[rows]) / count

    power = mean(gain * gain)
    sigma = 1e3 * noise_mm / np.sqrt(power * count)
    seen = np.where((sigma <= SEEN * np.median(sigma)) | (not fine), 1.0, np.nan)
    model = 1e3 * mean(samples.model_mm[:, column])
    return Branch(
        sense=sense,
        variable=mean(over),
        model_um=model,
        before_um=seen * 1e3 * mean(gain * before_mm) / power,
        after_um=seen * (model + 1e3 * mean(gain * left_mm) / power),
        sigma_um=sigma,
    )


def gains_by_test(diagnosis: Diagnosis) -> tuple[GainOfTest, ...]:
    """Return every test's gain, in recording order."""
    before, after = diagnosis.before, diagnosis.after
    rounds = [_circularity_um(before), _circularity_um(after)]
    names = names_of_tests(before.observations)
    rows = grouped((name, k) for k, name in enumerate(names))
    return tuple(
        GainOfTest(
            name=name,
            residual_um=(
                rms_um([before.residual_mm[k] for k in own]),
                rms_um([after.residual_mm[k] for k in own]),
            ),
            circularity_um=(max(rounds[0][k] for k in own), max(rounds[1][k] for k in own)),
            traces=tuple(_trace(diagnosis, k) for k in own),
        )
        for name, own in rows.items()
    )


def _circularity_um(calibration: Calibration) -> list[float]:
    return [
        figures(o.raw, o.raw.circle.bar_mm + left).circularity_um
        for o, left in zip(calibration.observations, calibration.residual_mm, strict=True)
    ]


def _trace(diagnosis: Diagnosis, k: int) -> Trace:
    raw = diagnosis.before.observations[k].raw
    measured = 1e3 * (raw.length_mm - raw.circle.bar_mm)
    predicted = [measured - 1e3 * fit.residual_mm[k] for fit in (diagnosis.before, diagnosis.after)]
    theta, curves = by_angle(raw, [*predicted, measured], BOUNDS.trace_points)
    return Trace(raw.circle.direction, theta, *curves)
