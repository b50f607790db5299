"""Help on screens and keys, drawn over the screen; other texts of the screens are in `texts`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from textual.containers import VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from dbbstation.tui.panel import lines

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from textual.app import ComposeResult
    from textual.binding import BindingType


@dataclass(frozen=True)
class Help:
    """Help on one screen."""

    title: str
    shows: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)


_RUN_KEYS = {
    "enter": (
        "The ball stands and the bar is in: the station waits for the machine. Behind a circle: what the word says. GOOD is accepted, "
        "REPEAT is measured again. If an earlier circle is wrong, the station goes back to its test."
    ),
    "m": "The same, and the holder was touched although nobody asked for it: a new mounting begins.",
    "u": "CANNOT TELL: the run counts although a fault that is named would not show.",
    "z": "The run counts in place of an earlier one of the same test and direction; else both count.",
    "a": "The complete run counts; the next one is announced. Where something is wrong with it the station asks why.",
    "r": "The run does not count and is measured again. While the circle runs, the station asks first.",
    "x": "The run does not count and the next one is announced. While the circle runs, the station asks first.",
    "s": "The announced run is left out for now.",
    "p": "A pause: nothing is waited for. P again goes on.",
}

_ROW_KEYS = {"up": "The row above.", "down": "The row below."}

HELP = {
    "measure": Help(
        "Measure",
        (
            "The top line names plan, run and state. The sentence below it says what to do now.",
            (
                "The circle shows the deviation of the bar from its nominal length, magnified. The dotted circle is the nominal one. "
                "Counter-clockwise is drawn thick, clockwise thin. A mark shows where the machine is. Dim beneath lies the last accepted "
                "circle of the session before, of the same machine and test, where there is one."
            ),
            (
                "On the right: the live reading, the set-up with a map of the plate, the figures of the last two runs, all runs of "
                "the plan with a sign and a word each. At the bottom: progress, messages, keys."
            ),
            (
                "While a run waits for its verdict, one word says what to do with it. REPEAT: something is wrong, and what explains most "
                "comes first, with what to do. CANNOT TELL: nothing is wrong, and a fault that is named would not show, neither now nor "
                "by a later circle. GOOD: every fault shows now or by a later circle, which leads back here. On the right stand the findings: number, limit, and good, cannot tell or wrong."
            ),
        ),
        {
            **_RUN_KEYS,
            "e": "Results of the session, when the plan is through: calibrate, diagnose, programs, report.",
            "g": (
                "As measured; complete circles about their own centre on a scale of their own; the form counter-clockwise less that clockwise."
            ),
        },
    ),
    "large": Help(
        "Large figures",
        (
            "To be read from two metres: the length of the bar [mm], the state of the sequence, what to do next.",
            (
                "Dashes stand instead of the length where no bar is in or no reading has come for a while. The bell rings when a "
                "run waits for its verdict."
            ),
        ),
        {**_RUN_KEYS, "escape": "Back to the screen with the circle."},
    ),
    "overview": Help(
        "Overview",
        (
            (
                "The map shows the plate from above, X to the right and Y up. Under each bore stand its tests: where there is room, a "
                "row for each direction with sign, word and circularity; else a sign for each direction and the greater circularity. "
                "The list has signs and words always."
            ),
            (
                "Below the list stands the last run of the chosen test and direction: centre, mean, circularity, verdict with its "
                "reason, findings that are wrong with number and limit. H shows the runs before it, rejected ones too."
            ),
            "The time left is that of the circles at their planned feeds. Putting up balls comes on top.",
        ),
        {
            "up": "The test above.",
            "down": "The test below.",
            "left": "The first direction of the test.",
            "right": "The second direction of the test.",
            "enter": "The chosen test and direction is measured next; the plan goes on from there.",
            "h": "An earlier run of the test and direction; behind the first comes the last again.",
            "x": "The accepted run does not count any more; the station asks for the reason.",
            "a": "The rejected run counts again.",
            "o": "Back.",
            "escape": "Back.",
        },
    ),
    "job": Help(
        "Job",
        (
            "One job, decided beforehand by its file. The first row begins it, or goes on with a session of it that is not complete.",
            "The rows below it are what may be changed. Below the list stand the limits and what a person looks after before the first circle.",
        ),
        {"enter": "Begin, or change the row.", **_ROW_KEYS},
    ),
    "operate": Help(
        "Set-up and circle",
        (
            "Before a circle: which ball goes into which bore, tilt and bar. Enter when it stands.",
            (
                "During and behind the circle: the length, what happens, and what to do. GOOD goes on by Enter, CANNOT TELL by U. REPEAT is "
                "measured again by Enter. If an earlier circle is wrong, Enter goes back to it."
            ),
        ),
        {key: sentence for key, sentence in _RUN_KEYS.items() if key in {"enter", "m", "u", "z", "r", "p"}},
    ),
    "answer": Help(
        "Answer",
        (
            (
                "WITHIN: every circle keeps its limit, U (k = 2) included. EXCEEDED: a circle passes its limit by more than U. CANNOT TELL: a "
                "limit lies within U, or a circle is missing."
            ),
        ),
        {"enter": "Back to the job.", "escape": "Back to the job."},
    ),
    "start": Help(
        "Start",
        (
            (
                "The list has the sessions under the working folder and those that were open lately, the last first: how many runs "
                "are accepted, and how long the circles take that are left. Plan and machine of a session lie in its folder; the "
                "instrument is that of last time."
            ),
            "A session with faults is listed with what is wrong with it; `dbbstation check` tells all of it.",
        ),
        {
            "enter": "Go on with the session where it was left.",
            "n": "A new session: machine, plan, instrument, port.",
            "i": "Go on with the session by another instrument or port.",
            "e": "Results of the session: calibrate, diagnose, programs, report. No instrument is needed.",
            "v": "Try everything on a virtual machine, without hardware.",
            "up": "The session above.",
            "down": "The session below.",
        },
    ),
    "new": Help(
        "What is measured",
        (
            "A row for each thing that a session needs. The sentence at the top says what is still missing.",
            (
                "Machines, plans and calibrations of bars are looked for in the working folder; examples come with the program. "
                "The port list has the ports of this computer, and virtual machines to try everything on."
            ),
        ),
        {
            "enter": "Change the row: choose from a list, or type.",
            "b": "Begin: read and check everything, then the checklist.",
            "l": "Listen at the port: what answers there.",
            "delete": "Empty the row.",
            **_ROW_KEYS,
            "escape": "Back to the sessions.",
        },
    ),
    "bar": Help(
        "The bar on its calibrator",
        (
            "Put the bar on its calibrator, a block of known length, and wait until both have the temperature of the shop.",
            (
                "The readings are averaged, and a file of the calibration is written. What the bar reads too long is noted and "
                "never taken off a recording."
            ),
        ),
        {
            "enter": "Change the row.",
            "b": "Read the bar.",
            **_ROW_KEYS,
            "escape": "Back; readings that are being taken are given up.",
        },
    ),
    "prepare": Help(
        "Checklist",
        (
            (
                "Below the rows stands what the program checked: every circle within the travel, the time that the circles take, "
                "whether a drift can look like an effect of height, the bar, the temperature."
            ),
            "The rows have what only a person can see at the machine. Each is confirmed once before the session begins.",
            "A session that goes on has a shorter list: what can have changed since.",
        ),
        {
            "enter": "Confirm, or take it back.",
            "y": "Confirm all.",
            "t": "Take the temperature of the shop before the circles.",
            "w": (
                "Write NC programs of all circles into a folder beside the session: nominal, or compensated with a model. "
                "Compensated ones then command the session."
            ),
            "b": "Begin to measure.",
            "up": "The line above.",
            "down": "The line below.",
            "escape": "Back to what is measured.",
        },
    ),
    "results": Help(
        "Results",
        (
            (
                "Seven steps on the accepted runs. Each is a command of the program in a process of its own, so that it can be ended; "
                "what it wrote before stays. Files go into a new folder beside the session."
            ),
            (
                "Calibrate fits the kinematic parameters and says what the plan could not see. Diagnose looks for causes that the "
                "calibration leaves out. Programs are compensated with the best model there is. The report holds the circles "
                "against the shop's tolerances, with their uncertainty: whether a calibration is due. Acceptance puts the circles "
                "beside those of a session before."
            ),
        ),
        {
            "enter": "The chosen step.",
            "0": "The first four steps, one behind the other.",
            "1": "Calibrate.",
            "2": "Diagnose.",
            "3": "Write compensated NC programs.",
            "4": "Write the report: the verdict against the shop's tolerances.",
            "5": "Acceptance: circles as measured before and now, against the shop's tolerances.",
            "6": "Draw the circles.",
            "7": "The history of all sessions in the same folder, machine by machine.",
            "k": "End the step that is being done.",
            "up": "The step above; its result stands below the list.",
            "down": "The step below.",
            "escape": "Back. A step that is being done is ended, after a question.",
        },
    ),
    "acceptance": Help(
        "Acceptance",
        (
            (
                "Circles as measured before and now; nothing here is predicted. The sessions before are those of the same machine, "
                "plan and jig beside this one, that ended before it began."
            ),
            (
                "A row for each test and tolerance of the shop's settings: its worst circle before and now [µm], the limit [µm], "
                "U (k = 2) now [µm]. PASS: the figure and U keep within the limit. FAIL: the figure less U exceeds it. CANNOT TELL: "
                "the limit lies within U."
            ),
            (
                "Below the list stand the worst circles of all tests, what the circles ran by, and the way back: the model that was "
                "in force before is copied beside the report, and nothing is overwritten."
            ),
        ),
        {
            "enter": "Hold the session against the chosen one.",
            "h": "Choose another session before.",
            "k": "End the comparison that is being made.",
            **_ROW_KEYS,
            "escape": "Back to the results.",
        },
    ),
    "everywhere": Help(
        "On every screen",
        keys={
            "o": "All tests of the plan on a map of the plate.",
            "f": "Large figures for two metres, and back.",
            "j": "All messages with all their words.",
            "c": "After a fault: open instrument and session again.",
            "e": "Results of the session: calibrate, diagnose, programs, report.",
            "t": "Note the temperature of the shop. After circles it is asked for before the session is left.",
            "plus": "A note for the session.",
            "d": "Dark or light.",
            "f1": "This help.",
            "question_mark": "This help.",
            "ctrl+p": "Search the commands of the screen by their names.",
            "q": "Quit. While a circle is recorded, the station asks first.",
        },
    ),
}
"""Help texts, by the help name of a screen."""

KEY_NAMES = {
    "enter": "Enter",
    "escape": "Esc",
    "up": "Up",
    "down": "Down",
    "left": "Left",
    "right": "Right",
    "question_mark": "?",
    "f1": "F1",
    "ctrl+p": "Ctrl-P",
    "delete": "Delete",
    "plus": "+",
}
"""Names of the keys that are not letters."""

HELP_CLOSES = "Esc, F1 or ? closes this help; arrow keys scroll."


_KEY = 8


class HelpScreen(ModalScreen[None]):
    """Help, drawn over the screen that it explains."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,f1,question_mark,q", "dismiss", "Close")]

    def __init__(self, name: str, without: Collection[str] = ()) -> None:
        super().__init__()
        self._help = name
        self._without = frozenset(without)

    def compose(self) -> ComposeResult:
        here, everywhere = HELP[self._help], HELP["everywhere"]
        with VerticalScroll():
            yield Static(Content.styled(here.title, "bold"))
            yield Static(Content(HELP_CLOSES))
            yield Static(_keys(here.keys))
            yield Static(Content.styled(everywhere.title, "bold"))
            yield Static(
                _keys({key: text for key, text in everywhere.keys.items() if key not in {*here.keys, *self._without}})
            )
            for paragraph in here.shows:
                yield Static(Content(paragraph))


def _keys(keys: Mapping[str, str]) -> Content:
    return lines(
        *(
            Content.assemble((f"{KEY_NAMES.get(key, key.upper()):{_KEY}}", "bold"), sentence)
            for key, sentence in keys.items()
        )
    )
