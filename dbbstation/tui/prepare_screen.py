"""The checklist before circles: facts that the program checked, and facts that a person must check."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from textual.content import Content

from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.service.held_line import AGAIN_S
from dbbstation.service.session_notes import shop_degc
from dbbstation.station.detector import seat
from dbbstation.tui import texts
from dbbstation.tui.panel import lines
from dbbstation.tui.questions import ChooseQuestion, TemperatureQuestion
from dbbstation.tui.reading_panel import seat_words
from dbbstation.tui.row_screen import FrontScreen
from dbbstation.tui.sentences import duration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.service.choice import Choice, Prepared
    from dbbstation.service.front import Front
    from dbbstation.service.held_line import HeldLine
    from dbbstation.tui.app import StationApp

_GOOD, _OPEN, _NOTE = "✓", "!", "·"
"""Signs: checked and good; unknown; note."""


class PrepareScreen(FrontScreen):
    """Shown over the choices or the sessions; shorter for a continued session."""

    help_name = "prepare"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("b", "begin", "Begin"),
        ("y", "all", "Confirm all"),
        ("t", "temperature", "Temperature"),
        ("w", "programs", "NC programs"),
        ("escape,q", "dismiss", "Back"),
    ]

    def __init__(
        self,
        reception: StationApp,
        front: Front,
        choice: Choice,
        prepared: Prepared,
        changed: Callable[[Choice], None] = lambda _choice: None,
    ) -> None:
        super().__init__(reception, front)
        self._choice, self._prepared, self._changed = choice, prepared, changed
        self._goes_on = choice.goes_on
        self._confirmed: set[str] = set()
        self._wrote = ""
        self._line: HeldLine | None = None
        self._told: tuple[tuple[str, str], ...] = ()

    def on_mount(self) -> None:
        self._line = self._front.hold(self._prepared.protocol, self._prepared.line)
        self._show()

    def look(self) -> None:
        if self._line is not None:
            self._tell()

    def offers_programs(self) -> bool:
        return not (self._goes_on and self._prepared.job.programs)

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        self._confirmed ^= {list(self._list)[self.at]}
        self._show()

    def action_all(self) -> None:
        self._confirmed = set(self._list)
        self._show()

    def action_temperature(self) -> None:
        def answered(text: str | None) -> None:
            degc = None if text is None else shop_degc(text)
            if degc is not None:
                self._take(replace(self._choice, ambient_temp_c=degc))

        self.app.push_screen(TemperatureQuestion(), answered)

    def action_programs(self) -> None:
        models = () if self._goes_on else self._front.models()
        if not models:
            self._write(None)
            return

        def answered(at: int | None) -> None:
            if at is not None:
                self._write(None if at == 0 else models[at - 1])

        labels = ["nominal: the plain circles of the plan", *(f"compensated with {path}" for path in models)]
        self.app.push_screen(
            ChooseQuestion("Write NC programs of all circles: arrow keys, Enter; Esc goes back.", labels), answered
        )

    def action_begin(self) -> None:
        if len(self._confirmed) < len(self._list):
            self._show()
            return
        self.say(texts.START_OPENS.format(folder=self._prepared.job.folder.name))
        self._reception.open(self._choice, self._prepared, self.failed)

    @property
    def _list(self) -> Mapping[str, str]:
        return texts.CONFIRMED_AGAIN if self._goes_on else texts.CONFIRMED

    def _show(self) -> None:
        rows = []
        for name, text in self._list.items():
            done = name in self._confirmed
            rows.append(Content.assemble(("[x] " if done else "[ ] ", "bold"), (text, "" if done else "$text-warning")))
        self.banner(virtual=self._choice.line.virtual)
        self.put(rows)
        self._tell()
        left = len(self._list) - len(self._confirmed)
        self.say(
            f"Still to be confirmed: {left} of {len(self._list)}. Enter confirms one, Y all."
            if left
            else "Everything is confirmed: B begins."
        )

    def _tell(self) -> None:
        told = tuple(self._checked())
        if told != self._told:
            self._told = told
            self.about(lines(*(Content(f"{sign} {text}") for sign, text in told)))

    def _checked(self) -> Iterator[tuple[str, str]]:
        prepared = self._prepared
        if self._line is not None:
            yield self._reading(self._line)
        yield _GOOD, "Every circle and its feed-in lie within the travel of axes, angles and struts."
        runs = f"{'Left to do: ' if self._goes_on else ''}{prepared.runs} runs"
        circles = f"their circles take {duration(prepared.circles_s)} at the planned feeds"
        yield _GOOD, f"{runs}; {circles}. {prepared.mountings} times a ball is put up, which comes on top."
        if not self._goes_on:
            correlate = f"Heights and a steady drift correlate by {prepared.height_and_drift:.2f}"
            seen = "a drift can look like an effect of height" if prepared.mixes_drift else "each can be seen"
            yield _NOTE if prepared.mixes_drift else _GOOD, f"{correlate}: {seen}."
        if prepared.job.programs:
            yield _GOOD, self._programs()
        else:
            yield _NOTE, self._wrote or "The control runs plain circles; W writes NC programs of them."
        if prepared.line.virtual:
            yield _NOTE, "Machine, bar and instrument are virtual."
        yield from self._shop()

    def _reading(self, line: HeldLine) -> tuple[str, str]:
        latest, first = line.latest, self._prepared.first
        if line.failure is not None:
            return _OPEN, f"{line.failure}. It is opened again every {AGAIN_S:.0f} s."
        if latest is None:
            return _NOTE, "The instrument is opened …"
        rate = "" if line.rate.per_s is None else f", {line.rate.per_s:.0f} times a second"
        if latest.length_mm is None:
            return _GOOD, f"The instrument answers{rate}: no bar, {latest.said or latest.status}."
        reads = f"The instrument reads {latest.length_mm:.4f} mm{rate}"
        if latest.status == DOUBTFUL:
            return _OPEN, f"{reads}, doubtful: {latest.said}."
        if first is None:
            return _GOOD, f"{reads}."
        return _GOOD, f"{reads}; for the first circle the bar is {seat_words(seat(latest.length_mm, first))}."

    def _programs(self) -> str:
        programs = self._prepared.job.programs.values()
        models = sorted({program.model_sha256[:12] for program in programs if program.model_sha256})
        by = f"compensated with the model {', '.join(models)} (SHA-256)" if models else "nominal"
        where = "" if self._choice.programs is None else str(self._choice.programs)
        return f"{len(programs)} NC programs run the circles that they are named after, {by}. {where}".rstrip()

    def _shop(self) -> Iterator[tuple[str, str]]:
        choice, details = self._choice, self._prepared.job.details
        bar = details.bar
        if not self._goes_on and bar is not None and bar.calibrated is not None:
            when = f"{bar.calibrated.astimezone():%Y-%m-%d %H:%M}"
            yield _GOOD, f"The bar {bar.serial_number} was on its calibrator, at {when}."
        elif not self._goes_on and details.bar_waiver:
            yield _OPEN, f"The bar is not calibrated: {details.bar_waiver}"
        if choice.ambient_temp_c is None:
            unread = "The temperature of the shop was not read: T takes it."
            yield _OPEN, f"{unread} What the bar grows by is not known without."
        else:
            yield _GOOD, f"Temperature of the shop before: {choice.ambient_temp_c:g} °C."
        if self._goes_on:
            yield _NOTE, "The session keeps bar and shop as it has noted them."
            return
        names = (text or texts.UNNAMED for text in (choice.serial_number, choice.operator, choice.job))
        yield _NOTE, "Machine {}, operator {}, job {}.".format(*names)

    def _write(self, model: Path | None) -> None:
        self.say("Writing NC programs …")
        choice = self._choice

        def written(found: tuple[int, Path]) -> None:
            count, folder = found
            if model is None:
                self._wrote = f"{count} NC programs written to {folder}."
                self._show()
            else:
                # The session has to know what commands its runs: its circles are no longer the plan's.
                self._take(replace(choice, programs=folder))

        self.do(lambda: self._front.write_programs(choice, model), written)

    def _take(self, choice: Choice) -> None:
        def prepared(found: Prepared) -> None:
            self._choice, self._prepared = choice, found
            self._changed(choice)
            self._show()

        self.prepare(choice, prepared)
