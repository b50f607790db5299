"""What the station draws of a session and of its folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.files.atomic import write_bytes
from dbbstation.report.figure_format import FigureFormat, Stamped
from dbbstation.report.history_page import history_html
from dbbstation.report.plot import PlotKind, Plotted, plot_figure
from dbbstation.results.tolerances import TOLERATED
from dbbstation.tasks.circle_runs import load_circles
from dbbstation.tasks.history import history

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.results.history import HistoryResult
    from dbbstation.results.plotted import PlotResult
    from dbbstation.tasks.telling import Telling


def draw_circles(
    session: Path, out: Path, provenance: Callable[[], Provenance], telling: Telling, *, force: bool
) -> PlotResult:
    """Write a session's circles as PDF.

    Raises:
        StationError: as of `load_circles` and `write_bytes`; no run shows a circle.
    """
    found = load_circles([session], TOLERATED, progress=telling.counted("circles"))
    made_by = provenance()
    plotted = Plotted(PlotKind.POLAR, found, TOLERATED, made_by.program)
    write_bytes(out, plot_figure(plotted, Stamped(FigureFormat.PDF, made_by)), force=force)
    return plotted.result(str(out))


def draw_history(
    folder: Path, out: Path, settings: Settings, provenance: Callable[[], Provenance], telling: Telling, *, force: bool
) -> HistoryResult:
    """Write the history of a folder's sessions as a page; raises as `history` and `write_bytes`."""
    found = history(folder, tolerances=settings.tolerances, progress=telling.stage, say=telling.note)
    write_bytes(out, history_html(found, provenance(), settings.tolerances_from), force=force)
    return found
