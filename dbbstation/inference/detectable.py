"""Compute the smallest detectable effects over variables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.followed import followed_by
from dbbstation.inference.levels import Detectable
from dbbstation.inference.model_comparison import LOG_SCALE_WEIGHTS, SCALES
from dbbstation.inference.patterns import CURVES, Family
from dbbstation.inference.triangle import norms, squares
from dbbstation.inference.verdict import SURELY

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.model_comparison import Cause, Variant
    from dbbstation.inference.settled import Settled

POWER = 0.9
"""Share of effects of the detectable size that must be found."""

MARGIN = 1.25
"""Safety factor of the detectable size, for the uncertainty of noise and search odds. The complete analysis found 17 of
20 effects injected at the size with margin. Their probability alone was sure for 9, 10 and 10 of ten at factors 1, 1.25
and 1.5."""

ENTIRELY = 1e-9
"""Least share of squares outside the base; effects with less are concealed completely."""


def detectable(settled: Settled) -> tuple[Detectable, ...]:
    """Return detectable sizes of effects over variables and of the user's causes, before absorption by the base; the least detectable first."""
    asked: dict[str, Cause] = {}
    for cause in settled.causes:
        of = settled.bank.of(cause.name)
        bends = len(cause.variants[0].columns)
        if (of is not None and of.family not in FORMS) or bends > CURVES:
            continue
        key = ", ".join(sorted(followed_by(settled.bank, cause.name)))
        if key not in asked or bends > len(asked[key].variants[0].columns):
            asked[key] = cause
    found = [_over_variables(settled, key, cause) for key, cause in asked.items()]
    return tuple(sorted(found, key=lambda one: -np.inf if one.size is None else -one.size))


def detectable_causes(settled: Settled) -> tuple[Detectable, ...]:
    """Return detectable sizes of laws that have a confirming measurement and, at plausible size, an effect here."""
    laws, found = settled.bank.laws, list[Detectable]()
    for cause in (c for c in settled.causes if c.name in laws and laws[c.name].confirm):
        variant = cause.widest
        samples, white = settled.bank.samples(variant.columns), settled.bank.fitted(variant.columns)
        whole = squares(white * variant.plausible)
        if whole < (NOTHING * settled.noise.innovation) ** 2 * len(white):
            continue
        shown = np.diag(settled.comparison.beside((), variant.columns)) * settled.noise.innovation**2
        seen = float(variant.plausible**2 @ shown) / whole
        found.append(_detectable(settled, cause, variant, samples, seen, cause.name, laws[cause.name].confirm))
    return tuple(sorted(found, key=lambda one: -np.inf if one.size is None else -one.size))


NOTHING = 1e-3
"""Least whitened rms of an effect, relative to the noise: with less, a million rows show it by one standard deviation."""


FORMS = (Family.CURVE, Family.LINEAR, Family.DRIFT, None)
"""Families of effects with a detectable size; laws of the user have none."""


def _over_variables(settled: Settled, follows: str, cause: Cause) -> Detectable:
    kept, variant = settled.channel.kept, cause.variants[0]
    samples = settled.bank.samples(variant.columns)[kept]
    samples = samples - samples.mean(axis=0)
    base = settled.channel.base.samples[kept]
    axes = np.linalg.qr(base / norms(base))[0]
    rest = samples - axes @ (axes.T @ samples)
    return _detectable(
        settled, cause, variant, samples, float(np.sum(rest**2) / max(np.sum(samples**2), 1e-300)), follows
    )


def _detectable(
    settled: Settled,
    cause: Cause,
    variant: Variant,
    samples: Floats,
    shown: float,
    follows: str,
    confirm: str | None = None,
) -> Detectable:
    size = None
    if shown >= ENTIRELY:
        products = settled.comparison.beside(settled.best.without(cause.name), variant.columns)
        size = least_seen(products, samples, variant.plausible, cause.log_prior_odds + variant.log_weight)
    return Detectable(follows, None if size is None else MARGIN * size, float(np.clip(1.0 - shown, 0.0, 1.0)), confirm)


def least_seen(products: Floats, samples: Floats, plausible: Floats, log_odds: float) -> float | None:
    """Return the least rms at which the share `POWER` of random effects is surely found, or None.

    Args:
        products: information given base and others, shape (p, p).
    """
    # Amplitudes a and noise e, both N(0, 1), give z = L a + L^(1/2) e for the information L. The evidence is averaged
    # over `SCALES`, as for any cause.
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((BOUNDS.detectable_draws, len(plausible)))
    size = np.sqrt(np.mean(np.square(directions @ samples.T), axis=1))
    information, axes = np.linalg.eigh(plausible[:, None] * products * plausible)
    information = np.maximum(information, 0.0)
    along = (directions / size[:, None] / plausible) @ axes
    noise = rng.standard_normal(along.shape)
    down = 1.0 + np.square(SCALES)[:, None] * information

    def power(level: float) -> float:
        towards = information * along * level + np.sqrt(information) * noise
        factors = 0.5 * (np.square(towards)[:, None, :] * np.square(SCALES)[:, None] / down - np.log(down)).sum(axis=2)
        sure = logsumexp(factors + LOG_SCALE_WEIGHTS, axis=1) + log_odds >= SURELY
        return float(np.mean(sure))

    low, high = 0.0, float(np.median(1.0 / np.maximum(np.sqrt(np.square(along) @ information), 1e-300)))
    for _ in range(MOST_DOUBLED):
        if power(high) >= POWER:
            break
        low, high = high, 2.0 * high
    else:
        return None
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if power(middle) >= POWER else (middle, high)
    return high


MOST_DOUBLED, HALVED = 30, 12
"""Steps of the search for a size: doublings over a factor of a billion, then halvings to a few thousandths."""
