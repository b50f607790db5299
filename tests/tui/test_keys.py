"""One letter means one thing on every screen."""

from __future__ import annotations

from textual.binding import Binding

from dbbstation.tui.acceptance_screen import AcceptanceScreen
from dbbstation.tui.app import StationApp
from dbbstation.tui.bar_screen import BarScreen
from dbbstation.tui.board_screen import RunScreen
from dbbstation.tui.help_screen import HELP
from dbbstation.tui.large_screen import LargeScreen
from dbbstation.tui.measure_screen import MeasureScreen
from dbbstation.tui.messages_screen import MessagesScreen
from dbbstation.tui.new_screen import NewScreen
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.questions import ReasonQuestion
from dbbstation.tui.results_screen import ResultsScreen
from dbbstation.tui.start_screen import StartScreen

PLACES = (
    StationApp,
    RunScreen,
    MeasureScreen,
    LargeScreen,
    OverviewScreen,
    StartScreen,
    NewScreen,
    PrepareScreen,
    BarScreen,
    ResultsScreen,
    AcceptanceScreen,
    MessagesScreen,
    ReasonQuestion,
)

SAME = (
    {"Accept", "Counts again"},
    {"Reject", "Does not count"},
    {"Earlier run", "Session before"},
    {"Begin", "Read the bar"},
    {"Pause", "Go on"},
    {"Quit", "Back", "Close"},
    {"Tests", "Back"},
    {"Messages", "Close"},
)
"""Words for one thing on different screens."""


def test_one_letter_has_one_meaning() -> None:
    meanings: dict[str, set[str]] = {}
    for place in PLACES:
        for binding in place.__dict__.get("BINDINGS", ()):
            keys, words = (
                (binding.key, binding.description) if isinstance(binding, Binding) else (binding[0], binding[2])
            )
            for key in keys.split(","):
                if len(key) == 1 and key.isalpha():
                    meanings.setdefault(key, set()).add(words)
    several = {key: words for key, words in meanings.items() if len(words) > 1}
    assert {key: words for key, words in several.items() if not any(words <= same for same in SAME)} == {}
    assert {"t", "d", "r", "p"} <= set(meanings)


def test_help_has_a_sentence_for_every_key_of_its_screen() -> None:
    for place in (
        MeasureScreen,
        OverviewScreen,
        StartScreen,
        NewScreen,
        PrepareScreen,
        ResultsScreen,
        AcceptanceScreen,
    ):
        told = HELP[place.help_name].keys
        for binding in (*RunScreen.BINDINGS, *place.BINDINGS) if issubclass(place, RunScreen) else place.BINDINGS:
            keys = binding.key if isinstance(binding, Binding) else binding[0]
            assert any(key in told for key in keys.split(",")), (place.__name__, keys)
