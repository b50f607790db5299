"""Rows and sentences of an acceptance, with the numbers of `report --before`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from textual.content import Content

from dbbstation.quality.conformity import Conformity
from dbbstation.tui import texts
from dbbstation.tui.panel import cut

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dbbstation.facts.held import HeldTolerance, ToleranceOfTest, WorstCircle
    from dbbstation.service.former_sessions import Former, InForce

_WIDE = 12
"""Width of the column of test names."""

_ROW = f"{{test:{_WIDE}}}  " + "{figure:18} {before:>6} {now:>6} {limit:>6} {expanded:>5}  "

HEADING = _ROW.format(**texts.ACCEPTANCE_HEADING) + texts.ACCEPTANCE_HEADING["verdict"]

_STYLES = {"within": "$text-success", "exceeded": "$text-error", "cannot tell": "$text-warning"}
_DIGEST = 8
"""Number of shown digits of a SHA-256, which people only compare."""


def test_line(one: ToleranceOfTest) -> Content:
    """Return the row of one figure of a test: its worst circle before and now, limit, U, and verdict."""
    row = _ROW.format(
        test=cut(one.test, _WIDE),
        figure=texts.FIGURE_NAMES[one.quantity],
        before=_um(one.before),
        now=_um(one),
        limit=f"{one.largest_um:g}",
        expanded=_expanded(one.worst),
    )
    conformity = one.conformity or str(Conformity.UNDECIDED)
    return Content.assemble(row, (texts.CONFORMITY_WORDS[conformity], f"bold {_STYLES[conformity]}"))


def worst_lines(answer: Any) -> Iterator[str]:  # noqa: ANN401 - a result as objects
    """Yield a sentence for each tolerance: the worst circle before and now, or what is missing."""
    told = [(one, one.worst) for one in answer.tolerances if one.worst is not None]
    for one, worst in told:
        before = None if one.before is None else one.before.worst
        yield texts.WORST.format(
            figure=texts.FIGURE_NAMES[one.quantity],
            before=texts.NOT_BEFORE if before is None else _circle(before),
            now=_circle(worst),
            limit=one.largest_um,
            word=texts.CONFORMITY_WORDS[one.conformity or str(Conformity.UNDECIDED)],
        )
    if not told:
        yield from (answer.verdict.headline, *answer.verdict.to_do)


def in_force_line(in_force: InForce) -> str:
    """Return the programs that commanded the circles of a session, in words."""
    if in_force.compensated == 0:
        return texts.RUN_BY_NOMINAL if in_force.programs else texts.RUN_BY_PLAIN
    if in_force.compensated < in_force.circles:
        return texts.RUN_BY_SOME.format(count=in_force.compensated, all=in_force.circles)
    return texts.RUN_BY_COMPENSATED


def way_back_lines(former: Former, kept: tuple[Path, ...]) -> Iterator[str]:
    """Yield lines on the files of the former models."""
    in_force = former.in_force
    if in_force.compensated == 0:
        yield texts.WAY_BACK_NOMINAL.format(folder=former.folder)
    for path in kept:
        yield texts.WAY_BACK_MODEL.format(path=path)
    for sha256 in in_force.lost:
        yield texts.WAY_BACK_LOST.format(sha256=sha256[:_DIGEST])
    if in_force.programs is not None:
        yield texts.WAY_BACK_PROGRAMS.format(path=in_force.programs)


def _circle(worst: WorstCircle) -> str:
    return texts.WORST_CIRCLE.format(**vars(worst), expanded=_expanded(worst))


def _expanded(worst: WorstCircle | None) -> str:
    u_um = None if worst is None else worst.expanded_um
    return texts.NOT_BEFORE if u_um is None else f"{u_um:.1f}"


def _um(held: HeldTolerance | None) -> str:
    return texts.NOT_BEFORE if held is None or held.worst is None else f"{held.worst.um:.1f}"
