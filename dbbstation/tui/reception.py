"""What the screens need of the app, and the app of the screens."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

from textual.screen import Screen

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.service.choice import Choice, Prepared

_Outcome = TypeVar("_Outcome")


class StationDesk(Protocol):
    """Interface that works in the background, opens jobs and shows results, such as `StationApp`."""

    def do(
        self,
        work: Callable[[], _Outcome],
        then: Callable[[_Outcome], None],
        failed: Callable[[Exception], None],
    ) -> None:
        """Do work of some seconds; `then` receives its outcome, `failed` a StationError."""

    def open(self, choice: Choice, prepared: Prepared, failed: Callable[[Exception], None]) -> None:
        """Open a job and show its screen."""

    def show_results(self, folder: Path) -> None:
        """Show the possible tasks on a measured session."""


class ExplainedScreen(Screen[None]):
    """A screen that F1 explains."""

    help_name: ClassVar[str] = ""
    """Name of its text in the help."""

    def look(self) -> None:
        """Show changes from other parts of the program."""
