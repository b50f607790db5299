"""What the screens say about themselves, in one place for whoever translates it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.station.states import State

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Help:
    """Help on one screen.

    Attributes:
        title: name of the screen.
        shows: what stands on it, a paragraph each.
        keys: a sentence for each key, by Textual's name of the key.
    """

    title: str
    shows: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)


_RUN_KEYS = {
    "enter": "The ball stands and the bar is in: the station waits for the machine.",
    "m": "The same, and the holder was touched although nobody asked for it: a new mounting begins.",
    "a": "The complete run counts; the next one is announced.",
    "r": "The run does not count and is measured again. While the circle runs, the station asks first.",
    "x": "The run does not count and the next one is announced. While the circle runs, the station asks first.",
    "s": "The announced run is left out for now.",
    "p": "A pause: nothing is waited for. P again goes on.",
}

HELP = {
    "measure": Help(
        "Measure",
        (
            "The top line names plan, run and state. The sentence below it says what to do now.",
            (
                "The circle shows the deviation of the bar from its nominal length, magnified. The dotted circle is the nominal one. "
                "Counter-clockwise is drawn thick, clockwise thin. A mark shows where the machine is."
            ),
            (
                "On the right: the live reading, the set-up with a map of the plate, the figures of the last two runs, all runs of "
                "the plan with a sign and a word each. At the bottom: progress, messages, keys."
            ),
            (
                "While a run waits for its verdict, its findings stand on the right: number, limit, and good, cannot tell or wrong. "
                "What is wrong comes first."
            ),
        ),
        {
            **_RUN_KEYS,
            "v": (
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
                "reason, findings that are wrong with number and limit. E shows the runs before it, rejected ones too."
            ),
            "The time left is that of the circles at their planned feeds. Putting up balls comes on top.",
        ),
        {
            "up": "The test above.",
            "down": "The test below.",
            "left": "The first direction of the test.",
            "right": "The second direction of the test.",
            "enter": "The chosen test and direction is measured next; the plan goes on from there.",
            "e": "An earlier run of the test and direction; behind the first comes the last again.",
            "x": "The accepted run does not count any more; the station asks for the reason.",
            "a": "The rejected run counts again.",
            "o": "Back.",
            "escape": "Back.",
        },
    ),
    "everywhere": Help(
        "On every screen",
        keys={
            "o": "All tests of the plan on a map of the plate.",
            "f": "Large figures for two metres, and back.",
            "c": "After a fault: open instrument and session again.",
            "d": "Dark or light.",
            "f1": "This help.",
            "question_mark": "This help.",
            "ctrl+p": "Search the commands of the screen by their names.",
            "q": "Quit. While a circle is recorded, the station asks first.",
        },
    ),
}
"""By the name that a screen has for its help."""

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
}
"""How keys are called that are no letter."""

HELP_CLOSES = "Esc, F1 or ? closes this help; arrow keys scroll."

LARGE_WORDS: Mapping[State | None, tuple[str, str]] = {
    None: ("opening", "wait"),
    State.BETWEEN: ("between", "wait"),
    State.ANNOUNCED: ("set up", "Enter"),
    State.ARMED: ("ready", "machine"),
    State.DWELLING: ("feed in", "hands off"),
    State.TURNING: ("circle", "hands off"),
    State.LEAVING: ("feed out", "hands off"),
    State.COMPLETE: ("done", "A R X ?"),
    State.FLAWED: ("no circle", "R or X ?"),
    State.PAUSED: ("paused", "P"),
    State.FINISHED: ("finished", "Q"),
    State.STOPPED: ("stopped", "Q"),
    State.FAULTED: ("fault", "C or Q"),
}
"""State and next action in large letters, nine of them at most."""

REASONS = {
    "1": "the holder or the ball was touched",
    "2": "the bar slipped or was knocked",
    "3": "wrong ball, bore, bar or program",
    "4": "the machine was disturbed or not warm",
}
"""Why a run does not count after all, by key."""

REASON_TITLE = "Why does {run} not count?"
REASON_KEYS = "T  type another reason      Esc  it counts as before"
REASON_TYPED = "type the reason, then Enter"

TIME_LEFT = (
    "{left} of {count} runs are left; their circles take {time} at the planned feeds, putting up balls comes on top."
)
NOTHING_LEFT = "All {count} runs of the plan are accepted."
NOT_NOW = "While the station is {state}, tests are looked at here; going to another and other verdicts have to wait."
NO_RUN = "{test} {direction}: no run yet."
RUN_FIGURES = "{run}: centre X {x:+.1f} Y {y:+.1f}, mean {mean:+.1f}, circularity {circularity:.1f} µm."
NO_CIRCLE = "{run}: no circle; {problem}"
NO_VERDICT = "waits for its verdict"
NO_BORE = "in no bore"
BORE = "bore {number}"
CHOOSE = "Arrow keys choose test and direction."
CHOOSE_RUN = "Run {place} of {count} of this test and direction: E shows an earlier one. Arrow keys choose another."
