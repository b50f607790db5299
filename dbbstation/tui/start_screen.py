"""The first screen: continue a session, begin one, or use a virtual machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.content import Content

from dbbstation.tui import texts
from dbbstation.tui.new_screen import NewScreen
from dbbstation.tui.panel import cut
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.row_screen import FrontScreen
from dbbstation.tui.sentences import duration

if TYPE_CHECKING:
    from textual.binding import BindingType
    from textual.widgets import OptionList

    from dbbstation.service.choice import Choice, Prepared
    from dbbstation.service.front import Front
    from dbbstation.service.session_list import SessionLine
    from dbbstation.tui.app import StationApp

_NAME = 22


class StartScreen(FrontScreen):
    """The bottom screen without a job."""

    help_name = "start"

    BINDINGS: ClassVar[list[BindingType]] = [
        ("n", "new", "New"),
        ("v", "virtual", "Try it"),
        ("i", "line", "Instrument"),
        ("e", "results", "Results"),
    ]

    def __init__(self, reception: StationApp, front: Front) -> None:
        super().__init__(reception, front)
        self._sessions: tuple[SessionLine, ...] = ()

    def on_mount(self) -> None:
        self.search()

    def search(self) -> None:
        """List the sessions again; a reported failure stays visible."""
        self.say(texts.START_LOOKS)
        self.do(self._front.sessions, self._list)

    @property
    def chosen(self) -> SessionLine | None:
        return self._sessions[self.at] if self._sessions else None

    def offers_line(self) -> bool:
        return self.chosen is not None and not self.chosen.problem

    offers_results = offers_line

    def on_option_list_option_selected(self, _chosen: OptionList.OptionSelected) -> None:
        line = self.chosen
        if line is None:
            return
        if line.problem:
            self.say(f"{line.folder.name} cannot be gone on with: {line.problem}", wrong=True)
            return
        choice = self._front.goes_on_with(line.folder)
        if choice.missing():
            self._choose(choice)
        else:
            self.prepare(choice, lambda prepared: self._prepared(choice, prepared))

    def chosen_another(self) -> None:
        self._tell()

    def action_new(self) -> None:
        self._choose(self._front.first_choice())

    def action_virtual(self) -> None:
        self._choose(self._front.virtual_choice())

    def action_line(self) -> None:
        if self.chosen is not None:
            self._choose(self._front.goes_on_with(self.chosen.folder))

    def action_results(self) -> None:
        if self.chosen is not None:
            self._reception.show_results(self.chosen.folder)

    def _list(self, sessions: tuple[SessionLine, ...]) -> None:
        self._sessions = sessions
        self.put([_row(line) for line in sessions])
        self.say(
            texts.START_SOME
            if sessions
            else "No session yet. N begins a new one, V tries everything on a virtual machine, without hardware."
        )
        self._tell()
        self.refresh_bindings()

    def _prepared(self, choice: Choice, prepared: Prepared) -> None:
        if self.is_current:
            self.say(texts.START_SOME)
            self._enter(PrepareScreen(self._reception, self._front, choice, prepared))

    def _choose(self, choice: Choice) -> None:
        self._enter(NewScreen(self._reception, self._front, choice))

    def _enter(self, screen: FrontScreen) -> None:
        def left(_: None) -> None:
            self.do(self._front.release, lambda _: None)

        self.app.push_screen(screen, left)

    def _tell(self) -> None:
        line = self.chosen
        if line is None:
            self.about(Content(""))
        elif line.problem:
            self.about(Content(f"{line.folder}\n{line.problem}"))
        else:
            by = self._front.goes_on_with(line.folder).line
            known = f"by {by.instrument} at {by.port}"
            how = known if by.instrument and by.port else "no instrument yet: I chooses one"
            self.about(Content(f"{line.folder}\nplan {line.plan}, machine {line.machine}\n{how}"))
        self.refresh_bindings()


def _row(line: SessionLine) -> Content:
    when = f"{line.changed.astimezone():%m-%d %H:%M}"
    name = f"{cut(line.folder.name, _NAME):{_NAME}}"
    if line.problem:
        return Content.assemble((f"! {name} ", "$text-error"), f"{cut(line.problem, 52)}")
    if line.complete:
        state = "complete"
    else:
        state = f"{line.accepted} of {line.planned} runs"
        state += f", {duration(line.left_s)} left" if line.left_s else ""
    state = f"virtual, {state}" if line.virtual else state
    state += f", {line.unjudged} to judge" if line.unjudged else ""
    sign = "✓" if line.complete else "◐"
    return Content.assemble(f"{sign} {name} {when}  ", (state, "bold"))
