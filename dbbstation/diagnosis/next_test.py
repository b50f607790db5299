"""Propose the fewest tests that change an open verdict or halve an uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.findings import NextTest
from dbbstation.diagnosis.foreseen import ForeseenTests
from dbbstation.diagnosis.parts import amplitudes
from dbbstation.inference.alternatives import would_show
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.square_root import solve
from dbbstation.inference.verdict import Verdict
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Need

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.explained import Explained
    from dbbstation.diagnosis.findings import SourceFinding
    from dbbstation.diagnosis.foreseen import Proposal
    from dbbstation.diagnosis.workspace import WorkspaceError
    from dbbstation.inference.model_comparison import Variant
    from dbbstation.sources.contract import ErrorSource

PROPOSED = frozenset({Need.POSE, Need.PATH, Need.TIME})
"""Inputs known before a test is measured."""

HALVED = 0.5
"""If tests cannot change a verdict, they must reduce an uncertainty to this share; repeating every test once gives 0.7."""


@with_one_thread
def next_tests(
    explained: Explained, findings: Sequence[SourceFinding], elsewhere: WorkspaceError | None
) -> tuple[NextTest, ...]:
    """Return the best tests for the first open cause and its rivals.

    An identified cause is open if the workspace remains more uncertain than corrected.
    """
    channel, settled = explained.channel, explained.settled
    could_be = ForeseenTests(channel)
    known = elsewhere is None or (
        elsewhere.uncertainty_rms_um is not None and elsewhere.uncertainty_rms_um < elsewhere.error_rms_um
    )
    causes = {cause.name: cause for cause in settled.causes if cause.named}
    found = {m.name: channel.whole(m.name, m.variant) for m in settled.members}
    for finding in findings:
        one_number = finding.name in found and len(found[finding.name].columns) == 1
        if finding.verdict is Verdict.RULED_OUT or (finding.verdict is Verdict.IDENTIFIED and (known or one_number)):
            continue
        asked = [finding.name, *(name for name in (*finding.ambiguous_with, *found) if name in causes)]
        others = [causes[name] for name in dict.fromkeys(asked) if name not in found]
        scan = settled.comparison.scan(settled.best.members, others)
        forms = found | {m.name: channel.whole(m.name, m.variant) for m in scan.best}
        # Future temperatures are unknown, so effects by thermometers are assumed known.
        beside = [(channel.source_of(name, forms[name]), forms[name]) for name in dict.fromkeys(asked)]
        foreseen = [(source, variant) for source, variant in beside if Need.TEMPERATURE not in source.needs]
        if not foreseen or foreseen[0][0].name != finding.name:
            continue
        proposed = propose(could_be, foreseen, settled.noise_mm)
        if proposed:
            return proposed
    return ()


def propose(
    could_be: ForeseenTests, asked: Sequence[tuple[ErrorSource, Variant]], noise_mm: float, most: int = BOUNDS.proposed
) -> tuple[NextTest, ...]:
    """Return the fewest tests that change a source's verdict or halve its uncertainty.

    Tests are added greedily by rms amplitude uncertainty. A verdict changes if half of the plausible combinations reach
    five standard deviations. The halved uncertainty is of the best combination. The result is empty if the permitted
    number of tests does not suffice, no circle is reachable, or inputs are unpredictable.

    Args:
        asked: the source with its columns, then rivals.
    """
    if not all(source.needs <= PROPOSED for source, _ in asked):
        return ()
    channel = could_be.channel
    source, variant = asked[0]
    first = len(channel.base.prior)
    variants = [variant for _, variant in asked]
    known = channel.known_with(variants)
    blocks = channel.blocks(all_columns(variants), np.zeros(channel.runs[-1].stop))
    noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
    covariance = solve(blocks, known, noise_mm, channel.held).covariance
    own = slice(first, first + len(variant.columns))

    def seen(proposal: Proposal, runs: slice) -> _Rows:
        return _stacked([could_be.rows(proposal, direction, asked) for direction in tuple(Direction)[runs]])

    def left(rows: _Rows) -> float:
        return _size(_told(covariance, rows, noise_mm, own), variant)

    proposals = could_be.that_show(frozenset[Need]().union(*(s.needs for s, _ in asked)))
    # One direction suffices to select the tests for closer evaluation.
    one_way = {k: seen(proposal, slice(1)) for k, proposal in enumerate(proposals)}
    both_ways: dict[int, _Rows] = {}
    chosen: list[Proposal] = []
    sigmas = [_sigmas(covariance[own, own], variant)]
    for _ in range(min(most, len(one_way))):
        closer = sorted(one_way, key=lambda k: left(one_way[k]))[: BOUNDS.closer_look]
        for k in closer:
            both_ways.setdefault(k, seen(proposals[k], slice(None)))
        _, k = min((left(both_ways[k]), k) for k in closer)
        del one_way[k]
        covariance = _told(covariance, both_ways[k], noise_mm, slice(None))
        chosen.append(proposals[k])
        sigmas.append(_sigmas(covariance[own, own], variant))
        if _worth_it(sigmas[0], sigmas[-1]):
            most_gained = int(np.argmin(sigmas[-1] / sigmas[0]))
            of = [float(each[most_gained]) for each in sigmas]
            return tuple(
                _in_words(channel, source, variant, proposal, before, after)
                for proposal, before, after in zip(chosen, of[:-1], of[1:], strict=True)
            )
    return ()


_Rows: TypeAlias = tuple["Integers", "Floats"]
"""Columns of base and sources, shape (q,), and rows over them, (r, q)."""


def _stacked(several: Sequence[_Rows]) -> _Rows:
    columns = np.unique(np.concatenate([own for own, _ in several]))
    stacked = []
    for own, rows in several:
        wide = np.zeros((len(rows), len(columns)))
        wide[:, np.searchsorted(columns, own)] = rows
        stacked.append(wide)
    return columns, np.vstack(stacked)


def _told(covariance: Floats, shown: _Rows, noise_mm: float, own: slice) -> Floats:
    columns, rows = shown
    seen = np.flatnonzero(rows.any(axis=0))
    columns, rows = columns[seen], rows[:, seen]
    gain = rows @ covariance[columns, own]
    answer = rows @ covariance[np.ix_(columns, columns)] @ rows.T + noise_mm**2 * np.eye(len(rows))
    return covariance[own, own] - gain.T @ np.linalg.solve(answer, gain)


def _size(covariance: Floats, variant: Variant) -> float:
    return float(np.sqrt(np.mean(np.maximum(np.diag(covariance), 0.0) / variant.plausible**2)))


def _sigmas(covariance: Floats, variant: Variant) -> Floats:
    variances = np.linalg.eigvalsh(covariance / np.outer(variant.plausible, variant.plausible))
    return np.sqrt(np.maximum(variances, np.finfo(np.float64).tiny))


def _worth_it(now: Floats, then: Floats) -> bool:
    testable = [would_show(1.0 / sigmas) for sigmas in (now, then)]
    return testable == [False, True] or bool(np.any(then <= HALVED * now))


def _in_words(
    channel: CircleChannel, source: ErrorSource, variant: Variant, proposal: Proposal, before: float, after: float
) -> NextTest:
    unit = float(variant.plausible[0])
    circle = proposal.circle
    (x, y, z), (a, b, _) = circle.ball_mm, circle.tilt_deg
    return NextTest(
        text=proposal.text,
        x_mm=x,
        y_mm=y,
        z_mm=z,
        a_deg=a,
        b_deg=b,
        elevation_deg=circle.elevation_deg,
        feed_mm_min=circle.feed_mm_min,
        wait_s=proposal.wait_s,
        source=source.name,
        sigma_before=before * unit,
        sigma_after=after * unit,
        unit=amplitudes(source, channel.machine)[0].unit,
    )
