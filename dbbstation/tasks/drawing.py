"""Figures of results, which are loaded when one is drawn."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


def drawing(figure: str, *given: object) -> Callable[[object], Any]:
    """Return what draws a figure.

    Args:
        figure: name of the figure's module and function.
        given: the figure's arguments before the wanted output.
    """
    return partial(_drawn, figure, given)


def _drawn(figure: str, given: tuple[object, ...], wanted: object) -> Any:  # noqa: ANN401 - as asked for
    from dbbstation.report.figure_format import figure_format

    return getattr(import_module(f"dbbstation.report.{figure}"), figure)(*given, figure_format(wanted))
