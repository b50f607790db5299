"""The checklist before a session: what the program checked, and what only a person can see."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.content import Content

from dbbstation.tui import texts
from dbbstation.tui.durations import duration
from dbbstation.tui.panel import lines
from dbbstation.tui.row_screen import RowScreen

if TYPE_CHECKING:
    from collections.abc import Iterator

    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.service.choice import Choice, Prepared
    from dbbstation.service.front import Front
    from dbbstation.tui.reception import Reception

_GOOD, _OPEN, _NOTE = "✓", "!", "·"
"""Signs: checked and good; not known; to be known."""


class PrepareScreen(RowScreen):
    """Pushed over what is measured.

    Args:
        reception: opens the job.
        front: writes programs.
        choice: what was chosen.
        prepared: what became of it; it was checked.
    """

    help_name = "prepare"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("b", "begin", "Begin"),
        ("y", "all", "Confirm all"),
        ("w", "programs", "Write NC programs"),
        ("escape,q", "back", "Back"),
    ]

    def __init__(self, reception: Reception, front: Front, choice: Choice, prepared: Prepared) -> None:
        super().__init__()
        self._reception, self._front = reception, front
        self._choice, self._prepared = choice, prepared
        self._confirmed: set[str] = set()
        self._wrote = ""

    def on_mount(self) -> None:
        """Show the list."""
        self._show()

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        """Confirm the chosen line, or take it back."""
        self._confirmed ^= {list(texts.CONFIRMED)[self.at]}
        self._show()

    def action_all(self) -> None:
        """Confirm every line."""
        self._confirmed = set(texts.CONFIRMED)
        self._show()

    def action_programs(self) -> None:
        """Write nominal programs beside the session."""
        self.say(texts.CHECK_WRITES)
        choice = self._choice
        self._reception.do(lambda: self._front.write_programs(choice), self._written, self._failed)

    def action_begin(self) -> None:
        """Begin to measure, once everything is confirmed."""
        if len(self._confirmed) < len(texts.CONFIRMED):
            self._show()
            return
        self.say(texts.START_OPENS.format(folder=self._prepared.job.folder.name))
        self._reception.open(self._choice, self._prepared, self._failed)

    def action_back(self) -> None:
        """Go back to what is measured."""
        self.dismiss()

    def _show(self) -> None:
        rows = []
        for name, text in texts.CONFIRMED.items():
            done = name in self._confirmed
            rows.append(Content.assemble(("[x] " if done else "[ ] ", "bold"), (text, "" if done else "$text-warning")))
        self.put(rows)
        self.about(lines(*(Content(f"{sign} {text}") for sign, text in self._checked())))
        left = len(texts.CONFIRMED) - len(self._confirmed)
        self.say(texts.CHECK_OPEN.format(count=left, all=len(texts.CONFIRMED)) if left else texts.CHECK_READY)

    def _checked(self) -> Iterator[tuple[str, str]]:
        """Yield sign and sentence of what the program knows."""
        choice, prepared = self._choice, self._prepared
        job = prepared.job
        yield _GOOD, texts.CHECK_TRAVEL
        time = duration(prepared.circles_s)
        yield _GOOD, texts.CHECK_TIME.format(runs=prepared.runs, time=time, mountings=prepared.mountings)
        r = prepared.height_and_drift
        yield (_NOTE, texts.CHECK_MIXED.format(r=r)) if prepared.mixes_drift else (_GOOD, texts.CHECK_ORDER.format(r=r))
        if self._wrote:
            yield _GOOD, self._wrote
        elif job.programs:
            yield _GOOD, texts.CHECK_PROGRAMS.format(count=len(job.programs))
        else:
            yield _NOTE, texts.CHECK_NO_PROGRAMS
        bar = job.details.bar
        if prepared.line.virtual:
            yield _NOTE, texts.CHECK_VIRTUAL
        if choice.goes_on:
            yield _NOTE, texts.CHECK_OLD
            return
        if bar is not None and bar.calibrated is not None:
            when = f"{bar.calibrated.astimezone():%Y-%m-%d %H:%M}"
            yield _GOOD, texts.CHECK_BAR.format(serial=bar.serial_number, when=when)
        elif job.details.bar_waiver:
            yield _OPEN, texts.CHECK_WAIVED.format(reason=job.details.bar_waiver)
        if choice.ambient_temp_c is None:
            yield _OPEN, texts.CHECK_NO_TEMPERATURE
        else:
            yield _GOOD, texts.CHECK_TEMPERATURE.format(temp=choice.ambient_temp_c)
        yield (
            _NOTE,
            texts.CHECK_WHO.format(
                serial=choice.serial_number or texts.UNNAMED,
                operator=choice.operator or texts.UNNAMED,
                job=choice.job or texts.UNNAMED,
            ),
        )

    def _written(self, found: tuple[int, str]) -> None:
        count, folder = found
        self._wrote = texts.CHECK_WROTE.format(count=count, folder=folder)
        self._show()

    def _failed(self, error: Exception) -> None:
        self.say(str(error), wrong=True)
