"""The bar on its calibrator."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.content import Content
from textual.widgets import OptionList

from dbbstation.errors import StationError
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.service.bar_calibration import doubt_of
from dbbstation.service.front import NoNumberError
from dbbstation.tui import texts
from dbbstation.tui.questions import TypeQuestion
from dbbstation.tui.row_screen import RowScreen

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from textual.binding import BindingType

    from dbbstation.service.bar_calibration import BarCalibration
    from dbbstation.service.front import Front
    from dbbstation.service.memory import Line

_NAME = 30


class BarScreen(RowScreen):
    """Screen that uses the instrument until it is closed."""

    help_name = "bar"

    BINDINGS: ClassVar[list[BindingType]] = [("b", "begin", "Read the bar"), ("escape,q", "back", "Back")]

    def __init__(self, front: Front, line: Line, then: Callable[[Path], None]) -> None:
        super().__init__()
        self._front, self._line, self._then = front, line, then
        self._values = dict.fromkeys(texts.BAR_ROWS, "")
        self._calibration: BarCalibration | None = None
        self._problem = ""

    def on_mount(self) -> None:
        self._show()
        self._reopen()

    def on_unmount(self) -> None:
        if self._calibration is not None:
            self._calibration.close()

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        name = list(texts.BAR_ROWS)[self.at]

        def answered(text: str | None) -> None:
            if text is not None:
                fault = self._front.fault_of_stated(name, text, self._line, self._reads_mm())
                if fault:
                    self._problem = f"{texts.BAR_ROWS[name]}: {fault}"
                    self.look()
                    return
                had_length = self._values["calibrator_mm"]
                self._values[name], self._problem = text, doubt_of(name, text)
                if self._values["calibrator_mm"] != had_length:
                    self._reopen()
                self._show()
                rows = self.query_one("#rows", OptionList)
                if self.at + 1 < rows.option_count:
                    rows.action_cursor_down()

        self.app.push_screen(TypeQuestion(texts.BAR_ROWS[name], self._values[name]), answered)

    def action_begin(self) -> None:
        if self._calibration is None or self._missing():
            return
        try:
            stated = self._front.stated_bar(self._values)
        except NoNumberError as error:
            self._problem = texts.BAR_NO_NUMBER.format(row=texts.BAR_ROWS[error.name], text=error.text)
            self.look()
            return
        self._problem = ""
        self._calibration.begin(*stated, self._front.new_bar_file())

    def action_back(self) -> None:
        found = None if self._calibration is None else self._calibration.found
        self.dismiss()
        if found is not None:
            self._then(found.path)

    def look(self) -> None:
        calibration = self._calibration
        if not self.stands:
            return
        if calibration is None:
            self.say(self._problem, wrong=True)
            return
        failure = calibration.failure
        if self._problem or failure is not None:
            self.say(self._problem or str(failure), wrong=True)
        elif calibration.busy:
            self.say(f"Reading: {calibration.done} of {calibration.count}. Leave the bar alone.")
        elif calibration.found is not None:
            found = calibration.found
            text = f"The bar reads {found.long_um:+.2f} µm long, standard uncertainty {found.u_um:.2f} µm. Written to {found.path.name}. Esc takes it."
            if found.drifted:
                text += (
                    f" It drifted by {found.drift_um:+.2f} µm meanwhile: let the bar cool down, then B reads it again."
                )
            self.say(text)
        elif self._missing():
            rows = ", ".join(texts.BAR_ROWS[name] for name in self._missing())
            self.say(f"Still missing: {rows}. Enter changes a row.")
        else:
            self.say("Put the bar on the calibrator, wait until it is as warm as the shop; then B reads it.")
        self.about(Content.styled(self._live(), "bold"))

    def _reopen(self) -> None:
        if self._calibration is not None:
            self._calibration.close()
        self._calibration = None
        try:
            self._calibration = self._front.bar_calibration(self._line, self._values)
        except NoNumberError as error:
            self._problem = texts.BAR_NO_NUMBER.format(row=texts.BAR_ROWS[error.name], text=error.text)
        except StationError as error:
            self._problem = str(error)

    def _live(self) -> str:
        reading = None if self._calibration is None else self._calibration.latest
        if reading is None:
            return ""
        if reading.length_mm is None:
            return f"no length yet: {reading.said or reading.status}"
        if reading.status == DOUBTFUL:
            return f"now {reading.length_mm:.4f} mm, doubtful: {reading.said}"
        off_um = self._front.off_calibrator_um(reading.length_mm, self._values)
        return (
            f"now {reading.length_mm:.4f} mm, {off_um:+.1f} µm against the calibrator"
            if off_um is not None
            else f"{reading.length_mm:.4f} mm"
        )

    def _reads_mm(self) -> float | None:
        reading = None if self._calibration is None else self._calibration.latest
        return None if reading is None or reading.status == DOUBTFUL else reading.length_mm

    def _missing(self) -> list[str]:
        return [name for name, value in self._values.items() if not value and name not in texts.BAR_MAY_BE_EMPTY]

    def _show(self) -> None:
        self.put(
            [
                Content.assemble(
                    f"{'!' if name in self._missing() else '·'} {title:{_NAME}} ", (self._values[name], "bold")
                )
                for name, title in texts.BAR_ROWS.items()
            ]
        )
