"""Texts of the screens that have more than one place, and words by state, step or row."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.quality.conformity import Conformity
from dbbstation.service.choice import Gate, Order, SetUpPart
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.station.states import State

if TYPE_CHECKING:
    from collections.abc import Mapping

LARGE_WORDS: Mapping[State | None, tuple[str, str]] = {
    None: ("opening", "wait"),
    State.BETWEEN: ("between", "wait"),
    State.ANNOUNCED: ("set up", "Enter"),
    State.ARMED: ("ready", "machine"),
    State.DWELLING: ("feed in", "hands off"),
    State.TURNING: ("circle", "hands off"),
    State.LEAVING: ("feed out", "hands off"),
    State.COMPLETE: ("done", "Enter"),
    State.FLAWED: ("repeat", "Enter"),
    State.PAUSED: ("paused", "P"),
    State.FINISHED: ("finished", "Q"),
    State.STOPPED: ("stopped", "Q"),
    State.FAULTED: ("fault", "C or Q"),
}
"""State and next action in at most nine large letters."""

REASONS = (
    "the holder or the ball was touched",
    "the bar slipped or was knocked",
    "wrong ball, bore, bar or program",
    "the machine was disturbed or not warm",
)
"""Reasons for rejecting a run."""

ALL_THE_SAME = (
    "the cause is known and does not touch what is wanted",
    "it cannot be measured again",
    "the machine is to be seen as it is",
)
"""Reasons for accepting a faulty run."""

JOB_ROWS: Mapping[str, str] = {
    "operator": "operator",
    "order": "order number",
    "port": "port",
    "temperature": "temperature [°C]",
}
"""Choices of an operator."""
ANSWERS = ("WITHIN", "EXCEEDED", "CANNOT TELL")
"""The three answers, which share one size of letters."""

VIRTUAL_BANNER = " VIRTUAL MACHINE "

START_LOOKS = "Looking for sessions …"
START_SOME = "Enter goes on with the chosen session, N begins a new one, V tries everything without hardware."
START_OPENS = "Opening {folder} …"

MISSING_PARTS: Mapping[SetUpPart, str] = {
    SetUpPart.MACHINE: "the machine's file",
    SetUpPart.PLAN: "the plan",
    SetUpPart.INSTRUMENT: "the instrument",
    SetUpPart.PORT: "the port it is connected to",
    SetUpPart.BAR: "the calibration of the bar, or why it is measured without",
    SetUpPart.FOLDER: "a folder for the session",
}
NEW_CHECKS = "Reading and checking …"
NEW_EMPTY: Mapping[SetUpPart, str] = {
    SetUpPart.BAR: "not measured: Enter chooses, measures or says why not",
    SetUpPart.PROGRAMS: "none: plain circles, started at the control",
    SetUpPart.OPERATOR: "not noted",
    SetUpPart.SERIAL_NUMBER: "not noted",
    SetUpPart.JOB: "not noted",
    SetUpPart.TEMPERATURE: "not read",
}
NOT_CHOSEN = "not chosen"
ORDER_WORDS: Mapping[Order, str] = {
    Order.PLAN: "as the plan has them",
    Order.HOLDER: "by holder, then by ball: each is put up once",
    Order.DRIFT: "heights in turn, so that none looks like a drift",
}
GATE_WORDS: Mapping[Gate, str] = {
    Gate.PLAN: "as the plan has it",
    Gate.FIRST: "the first test is repeated at the end",
    Gate.HOLDERS: "the first test of each holder is repeated at the end",
}
TYPE_ANOTHER = "type another …"
TEMPERATURE_NOW = "Temperature of the shop now [°C]? Enter notes it, or goes on without; Esc goes back."
NO_NUMBER = "{text} is no temperature between -30 and 80 °C."

CONFIRMED: Mapping[str, str] = {
    "bar": "The bar, its cable and both balls are clean; the magnets hold.",
    "holder": "The holder of every test is at hand, and sits in its bore without play.",
    "jig": "The plate sits flat in its seat and is clamped.",
    "clearance": "Every tilt was run once without the bar: bar and tool stay clear.",
    "spindle": "The spindle is locked and oriented; nobody starts it.",
}
"""Facts that only a person can check before a session, by a name that is not shown."""

CONFIRMED_AGAIN: Mapping[str, str] = {
    "bar": "The bar is in, its cable is free, both balls are clean.",
    "holder": "The holder stands untouched; if not, M begins the first circle, not Enter.",
    "jig": "The plate was not moved in its seat, and is clamped.",
    "spindle": "The spindle is locked, oriented as before; nobody starts it.",
}
"""The same for a continued session: facts that may have changed since."""

UNNAMED = "not noted"

BAR_ROWS: Mapping[str, str] = {
    "serial_number": "bar, serial number",
    "calibrator": "calibrator, serial number",
    "calibrator_mm": "its length at 20 °C [mm]",
    "calibrator_u_um": "its standard uncertainty [µm]",
    "certified": "certified, YYYY-MM-DD",
    "valid_until": "valid until, may stay empty",
    "temp_c": "temperature of the bar [°C]",
}
BAR_MAY_BE_EMPTY = {"valid_until"}
BAR_NO_NUMBER = "{row}: `{text}` is no number."

STEPS: Mapping[SessionTask, tuple[str, str]] = {
    SessionTask.CALIBRATE: ("1", "Calibrate: fit the kinematic parameters"),
    SessionTask.DIAGNOSE: ("2", "Diagnose: what the calibration leaves out"),
    SessionTask.PROGRAMS: ("3", "Programs: compensated NC programs of the circles"),
    SessionTask.REPORT: ("4", "Report: verdict against the shop's tolerances"),
    SessionTask.ACCEPTANCE: ("5", "Acceptance: before and now, as measured"),
    SessionTask.FIGURES: ("6", "Figures: the circles, drawn"),
    SessionTask.HISTORY: ("7", "History: all sessions beside this one"),
}
STEP_LOOKS: Mapping[WorkProgress | None, tuple[str, str, str]] = {
    None: ("·", "not yet", "dim"),
    WorkProgress.RUNNING: ("▶", "{stage} ({passed})", ""),
    WorkProgress.DONE: ("✓", "done in {passed}", "$text-success"),
    WorkProgress.FAILED: ("✗", "failed", "$text-error"),
    WorkProgress.CANCELLED: ("-", "ended", "$text-warning"),
}
"""Sign, words and style of a step."""

STEP_BEGINS = "beginning"

VERDICT_WORDS: Mapping[str, str] = {
    "identified": "Identified causes",
    "happened": "Happened in this session",
    "does-not-predict": "Found here, not confirmed by tests that were held back",
    "ambiguous": "Ambiguous",
    "not-testable": "These tests cannot tell",
}
REPORT_VERDICT: Mapping[str, str] = {
    "within": "PASS: no calibration is due.",
    "exceeded": "FAIL: a calibration is due.",
    "cannot tell": "CANNOT TELL: a limit lies within the uncertainty.",
    "none": "NO VERDICT: the shop's settings have no tolerances.",
}

ACCEPTANCE_VERDICT: Mapping[str, str] = {
    "within": "PASS: every circle is within the shop's tolerances under the programs of this session.",
    "exceeded": "FAIL: a circle exceeds the shop's tolerances under the programs of this session.",
    "cannot tell": "CANNOT TELL: a limit lies within the uncertainty of a figure.",
    "none": "NO VERDICT: the shop's settings have no tolerances for these circles.",
}
CONFORMITY_STYLES = {
    Conformity.WITHIN: "bold $text-success",
    Conformity.EXCEEDED: "bold $text-error",
    Conformity.UNDECIDED: "bold $text-warning",
}
CONFORMITY_WORDS: Mapping[str, str] = {"within": "PASS", "exceeded": "FAIL", "cannot tell": "CANNOT TELL"}
FIGURE_NAMES: Mapping[str, str] = {
    "circular-deviation": "circular deviation",
    "centre-deviation": "centre deviation",
    "mean-radial-error": "mean radial error",
    "radial-deviation": "radial deviation F",
    "bidirectional-circular-deviation": "G(b)",
    "mean-bidirectional-radial-deviation": "D",
    "circular-hysteresis": "hysteresis H",
}
NOT_BEFORE = "-"
RUN_BY_NOW = "The circles of this session ran by {by}."

SEATED = "seated"
SEATED_BACKWARDS = "short: counts the wrong way?"
NOT_SEATED_SHORT = "{mm:.1f} mm short of feed-in"
NOT_SEATED_LONG = "{mm:.1f} mm beyond feed-in"
