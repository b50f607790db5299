"""Draw figures of a session and of its folder for the station."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.files.atomic import write_bytes
from dbbstation.report.circles_figure import PlotKind, Plotted, circles_figure
from dbbstation.report.figure_format import FigureFormat, Stamped
from dbbstation.report.history_page import history_html
from dbbstation.results.circles import circles_result
from dbbstation.results.tolerances import TOLERATED
from dbbstation.tasks.circle_runs import load_circles
from dbbstation.tasks.history import history

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.results.circles import CirclesResult
    from dbbstation.results.history import HistoryResult
    from dbbstation.tasks.telling import Telling


def draw_circles(
    session: Path, out: Path, provenance: Callable[[], Provenance], telling: Telling, *, force: bool
) -> CirclesResult:
    """Write a session's circles as PDF.

    Raises:
        StationError: as of `load_circles` and `write_bytes`; no run shows a circle.
    """
    found = load_circles([session], TOLERATED, progress=telling.counted("circles"))
    plotted = Plotted(PlotKind.POLAR, found, TOLERATED)
    write_bytes(out, circles_figure(plotted, Stamped(FigureFormat.PDF, provenance())), force=force)
    return circles_result(found, TOLERATED)


def draw_history(
    folder: Path, out: Path, settings: Settings, provenance: Callable[[], Provenance], telling: Telling, *, force: bool
) -> HistoryResult:
    """Write the history of a folder's sessions as a page; raises as `history` and `write_bytes`."""
    found = history(folder, tolerances=settings.tolerances, progress=telling.stage, say=telling.note)
    write_bytes(out, history_html(found, provenance(), settings.tolerances_from), force=force)
    return found
