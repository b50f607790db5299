"""Choose the measurement: a row for each part, and the missing parts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, TypeVar

from textual.content import Content

from dbbstation.service.choice import Choice, Gate, Order, SetUpPart
from dbbstation.tui import texts
from dbbstation.tui.bar_screen import BarScreen
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.questions import ChooseQuestion, TypeQuestion
from dbbstation.tui.row_screen import FrontScreen

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.service.choice import Prepared
    from dbbstation.service.front import Front
    from dbbstation.service.held_line import ProbeOutcome
    from dbbstation.tui.app import StationApp

_Kind = TypeVar("_Kind", Order, Gate)
_Value = TypeVar("_Value")

ROWS = tuple(SetUpPart)
_OF_LINE = (SetUpPart.INSTRUMENT, SetUpPart.PORT)
_NAME = 15


class NewScreen(FrontScreen):
    """Shown over the sessions."""

    help_name = "new"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("b", "begin", "Begin"),
        ("l", "probe", "Listen at the port"),
        ("delete", "empty", "Empty"),
        ("escape,q", "dismiss", "Back"),
    ]

    def __init__(self, reception: StationApp, front: Front, choice: Choice) -> None:
        super().__init__(reception, front)
        self.choice = choice

    def on_mount(self) -> None:
        self._show()

    def action_begin(self) -> None:
        if self.choice.missing():
            self._show()
        else:
            self.prepare(self.choice, self._prepared)

    def action_probe(self) -> None:
        line = self.choice.line
        if not line.instrument or not line.port:
            self._show()
            return
        self.say(f"Asking {line.port} for a reading of {line.instrument} …")
        self.do(lambda: self._front.probe(line), self._answered)

    def action_empty(self) -> None:
        part = ROWS[self.at]
        if part is SetUpPart.INSTRUMENT:
            self._line(instrument="", profile="", zero_mm=None)
        elif part is SetUpPart.PORT:
            self._line(port="", baud=None)
        elif part is SetUpPart.BAR:
            self._take(bar=None, bar_waiver="")
        elif part in _FIELDS and part not in self._kept():
            self._take(**{_FIELDS[part]: getattr(Choice(), _FIELDS[part])})

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        part = ROWS[self.at]
        if part in self._kept():
            return
        match part:
            case SetUpPart.MACHINE | SetUpPart.PLAN:
                self._choose_file(part)
            case SetUpPart.BAR:
                self._choose_bar()
            case SetUpPart.INSTRUMENT:
                self._choose_instrument()
            case SetUpPart.PORT:
                self._choose_port()
            case SetUpPart.ORDER:
                self._take(order=_next(self.choice.order))
            case SetUpPart.GATE:
                self._take(gate=_next(self.choice.gate))
            case _:
                self._type(part, str(getattr(self.choice, _FIELDS[part]) or ""), lambda text: self._typed(part, text))

    def _kept(self) -> frozenset[SetUpPart]:
        return frozenset(ROWS) - frozenset(_OF_LINE) if self.choice.goes_on else frozenset()

    def _choose_file(self, part: SetUpPart) -> None:
        now = getattr(self.choice, _FIELDS[part])
        another = {texts.TYPE_ANOTHER: lambda: self._type(part, str(now or ""), lambda text: self._typed(part, text))}
        self._choose(part, self._files(part), now, lambda path: self._take(**{_FIELDS[part]: path}), another)

    def _choose_bar(self) -> None:
        part, waiver = SetUpPart.BAR, self.choice.bar_waiver
        others = {
            "measure it now, on its calibrator …": self._measure_bar,
            "without a calibration: type why …": lambda: self._type(
                part, waiver, lambda why: self._take(bar=None, bar_waiver=why)
            ),
        }
        self._choose(part, self._files(part), None, self._take_bar, others)

    def _files(self, part: SetUpPart) -> dict[str, Path]:
        return {f"{path.name:28} {path.parent}": path for path in self._front.files(part)}

    def _take_bar(self, path: Path) -> None:
        self._take(bar=path, bar_waiver="")

    def _measure_bar(self) -> None:
        line = self.choice.line
        if not line.instrument or not line.port:
            self._show()
            return
        self.app.push_screen(BarScreen(self._front, line, self._take_bar))

    def _choose_instrument(self) -> None:
        known = {f"{name:26} {profile or 'usual'}": (name, profile) for name, profile in self._front.instruments()}
        now = (self.choice.line.instrument, self.choice.line.profile)
        another = {texts.TYPE_ANOTHER: lambda: self._type(SetUpPart.INSTRUMENT, "", lambda text: take((text, "")))}

        def take(chosen: tuple[str, str]) -> None:
            self._line(instrument=chosen[0], profile=chosen[1], zero_mm=None)

        self._choose(SetUpPart.INSTRUMENT, known, now, take, another)

    def _choose_port(self) -> None:
        line = self.choice.line
        ports = {f"{name:34} {description}": name for name, description in self._front.ports()}
        another = {texts.TYPE_ANOTHER: lambda: self._type(SetUpPart.PORT, line.port, self._take_port)}
        self._choose(SetUpPart.PORT, ports, line.port, self._take_port, another)

    def _take_port(self, port: str) -> None:
        self._line(port=port)
        self.action_probe()

    def _choose(
        self,
        part: SetUpPart,
        values: Mapping[str, _Value],
        now: _Value | None,
        take: Callable[[_Value], None],
        others: Mapping[str, Callable[[], None]],
    ) -> None:
        found = list(values.values())

        def answered(at: int | None) -> None:
            if at is None:
                return
            if at < len(found):
                take(found[at])
            else:
                list(others.values())[at - len(found)]()

        at = found.index(now) if now in found else 0
        title = f"Choose {part}: arrow keys, Enter; Esc goes back."
        self.app.push_screen(ChooseQuestion(title, [*values, *others], at), answered)

    def _type(self, part: SetUpPart, text: str, then: Callable[[str], None]) -> None:
        def answered(typed: str | None) -> None:
            if typed:
                then(typed)

        self.app.push_screen(TypeQuestion(part, text), answered)

    def _typed(self, part: SetUpPart, text: str) -> None:
        if part is SetUpPart.TEMPERATURE:
            if (temp_c := self.degc_of(text)) is not None:
                self._take(ambient_temp_c=temp_c)
        elif part in {SetUpPart.MACHINE, SetUpPart.PLAN, SetUpPart.FOLDER, SetUpPart.PROGRAMS}:
            self._take(**{_FIELDS[part]: (self._front.under / Path(text).expanduser())})
        else:
            self._take(**{_FIELDS[part]: text})

    def _take(self, **changed: object) -> None:
        self.choice = replace(self.choice, **changed)  # type: ignore[arg-type]  # the fields of a row, checked by its kind
        self._show()

    def _line(self, **changed: object) -> None:
        self._take(line=self.choice.line.model_copy(update=changed))

    def _show(self) -> None:
        missing = self.choice.missing()
        self.banner(virtual=self.choice.line.virtual)
        self.put([self._row(part, missing=part in missing) for part in ROWS])
        if missing:
            parts = ", ".join(texts.MISSING_PARTS[part] for part in missing)
            self.say(f"Still missing: {parts}. Enter changes a row.")
        else:
            self.say("Nothing is missing: B begins. L listens at the port.")

    def _row(self, part: SetUpPart, *, missing: bool) -> Content:
        sign = "!" if missing else "·"
        value = "of the session" if part in self._kept() and part is not SetUpPart.FOLDER else self._value(part)
        style = "$text-warning" if missing else ""
        return Content.assemble((f"{sign} {part:{_NAME}} ", style), (value, "bold"))

    def _value(self, part: SetUpPart) -> str:
        choice, line = self.choice, self.choice.line
        said = {
            SetUpPart.INSTRUMENT: " ".join(filter(None, (line.instrument, line.profile))) or texts.NOT_CHOSEN,
            SetUpPart.PORT: line.port or texts.NOT_CHOSEN,
            SetUpPart.ORDER: texts.ORDER_WORDS[choice.order],
            SetUpPart.GATE: texts.GATE_WORDS[choice.gate],
        }
        if line.virtual:
            said[SetUpPart.BAR] = "not needed: a virtual bar has the length of the plan"
        elif choice.bar_waiver:
            said[SetUpPart.BAR] = f"without: {choice.bar_waiver}"
        return said.get(part) or self._field(part)

    def _field(self, part: SetUpPart) -> str:
        value = getattr(self.choice, _FIELDS[part])
        if value in {None, ""}:
            return texts.NEW_EMPTY.get(part, texts.NOT_CHOSEN)
        if part is SetUpPart.TEMPERATURE:
            return f"{value:g} °C"
        return f"{value.name}  ({value.parent})" if isinstance(value, Path) else str(value)

    def _prepared(self, prepared: Prepared) -> None:
        if not self.is_current:  # somebody went back meanwhile
            return
        self._show()
        self.app.push_screen(PrepareScreen(self._reception, self._front, self.choice, prepared, self._changed))

    def _changed(self, choice: Choice) -> None:
        self.choice = choice
        self._show()

    def _answered(self, answer: ProbeOutcome) -> None:
        said = f" answers: {answer.text}." if answer.answers else f": {answer.text}"
        self.say(f"{answer.port}{said}", wrong=not answer.answers)


_FIELDS = {
    SetUpPart.MACHINE: "machine",
    SetUpPart.PLAN: "plan",
    SetUpPart.FOLDER: "folder",
    SetUpPart.BAR: "bar",
    SetUpPart.PROGRAMS: "programs",
    SetUpPart.OPERATOR: "operator",
    SetUpPart.SERIAL_NUMBER: "serial_number",
    SetUpPart.JOB: "job",
    SetUpPart.TEMPERATURE: "ambient_temp_c",
}
"""Field of the choice for each row."""


def _next(one: _Kind) -> _Kind:
    every = list(type(one))
    return every[(every.index(one) + 1) % len(every)]
