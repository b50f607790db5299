"""Sentences about findings of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.levels import Acts
from dbbstation.inference.patterns import Family

if TYPE_CHECKING:
    from dbbstation.diagnosis.table.mismatch import Mismatch
    from dbbstation.inference.read_off import CauseFinding

MEANINGS: dict[Family, str] = {
    Family.LINEAR: "It grows in proportion: a scale, a stiffness, an expansion or, along another axis, a squareness that the simulation has wrong or lacks.",
    Family.ONCE: "It has one period per turn: a part is off centre, or an axis is tilted.",
    Family.TWICE: "It has two periods per turn: a part is oval, or an axis wobbles.",
    Family.HYSTERESIS: "Its sign changes with the direction of travel: play or friction. Positive is more while this variable rises.",
    Family.SPEED: "It grows with the speed: viscous friction, or a delay of this variable.",
    Family.DRAG: "It grows with the square of the speed: drag of a fluid, or turbulent flow.",
    Family.LAG: "The measured value lags behind the simulated one (negative: leads).",
    Family.MEMORY: "It follows this variable late: a body warms up, a material creeps, a sensor or a filter lags.",
    Family.DEAD_TIME: "It follows this variable after a dead time: transport, a network, or a clock that is off.",
    Family.INTEGRAL: "It accumulates in proportion to this variable: a mass, a level, or heat in a well insulated body.",
    Family.KNEE: "It has another slope beyond one value: a stop, a gap, or, at slope -1 over the simulated value, a sensor at its limit.",
    Family.SATURATION: "It grows with this variable up to a limit: a stop, or a saturated magnet.",
    Family.DEAD_ZONE: "It is flat within a width: a valve that overlaps, a gap, or a threshold.",
    Family.FRICTION: "Its sign changes with the direction of travel, within a small speed: friction in a lubricant.",
    Family.SCALED: "Its sign changes with the direction of travel, and its force grows with the other variable: friction under a load.",
    Family.DRIFT: "It grows with time: warming, wear, or a clock that runs at another rate.",
    Family.WANDER: "It wanders in time like a random walk: a zero that creeps, or a cause without a column.",
    Family.PRODUCT: "It depends on both variables together, not on one alone.",
    Family.CURVE: "It follows this variable smoothly.",
    Family.BY_DIRECTION: "It follows this variable with opposite signs in the two directions of travel.",
    Family.WAVE: "It repeats: a pitch, a tooth, a pole or a ripple.",
    Family.BUMP: "It is a bump at one place.",
    Family.STEP: "It steps at one place.",
    Family.PULSES: "It begins and ends in time: something came or went, a force or a state that the simulation does not have.",
    Family.BLOCKS: "Runs differ by a constant: something was set up or reset between them.",
}
"""Possible meanings of each form."""


def sentence_of(found: Mismatch, finding: CauseFinding) -> str:
    """Return a text on place, possible meaning and similar effects."""
    parts = [_where(found, finding)]
    if finding.form is not None:
        parts.append(MEANINGS[finding.form])
        if finding.form is Family.PRODUCT and finding.label:
            parts.append(f"Its factors are zero at {finding.label.removeprefix('about ')}.")
        if finding.acts is Acts.ONCE:
            parts.append(PERSISTS if finding.persists else RECURS if finding.recurs else HAPPENED)
    if finding.name in found.texts:
        texts = found.texts[finding.name]
        parts += [texts.what, texts.confirm]
    if finding.confounded > CONFOUNDED:
        parts.append(f"The fitted parameters conceal {100 * finding.confounded:.0f} % of it.")
    if finding.equivalent:
        parts.append(f"These rows cannot distinguish it from {', '.join(finding.equivalent[1:])}.")
    parts.append(finding.text)
    return " ".join(part for part in parts if part)


HAPPENED = "It is something that happened in these rows: no other rows can test it."
PERSISTS = "It is something that happened in these rows, and stayed: parts that were held back tell of it, too."
RECURS = "It is something that happens again in these rows: found without each part, it predicts that part, too."

CONFOUNDED = 0.1
"""Share of an effect absorbed by parameters that is reported."""


def _where(found: Mismatch, finding: CauseFinding) -> str:
    table = found.table
    if finding.rows:
        return "It is there " + "; ".join(_stretch(found, first, last) for first, last in finding.rows) + "."
    spans = [f"{span.variable} {span.low:.4g} to {span.high:.4g} {span.unit}".strip() for span in finding.spans]
    text = f"Largest at {', '.join(spans)}, in {finding.rows_there} of {len(table)} rows." if spans else ""
    if len(finding.blocks) > 1:
        worst, most = max(finding.blocks.items(), key=lambda one: one[1])
        if most > 2.0 * float(np.median([*finding.blocks.values()])):
            text += f" Most in {worst}."
    return text


def _stretch(found: Mismatch, first: int, last: int) -> str:
    table = found.table
    block = next(k for k, rows in enumerate(table.blocks) if rows.start <= first < rows.stop)
    run = f" of {table.names[block]}" if len(table.blocks) > 1 else ""
    onwards = last == len(table) - 1 or last == table.blocks[block].stop - 1
    if table.clock is None:
        first, last = first - table.blocks[block].start + 1, last - table.blocks[block].start + 1
        return f"from row {first} on{run}" if onwards else f"from row {first} to {last}{run}"
    at, until, unit = table.clock.values[first], table.clock.values[last], table.clock.unit
    text = f"from {table.clock.name} {at:.4g} {unit}".rstrip()
    return f"{text} on{run}" if onwards else f"{text} to {until:.4g} {unit}".rstrip() + run
