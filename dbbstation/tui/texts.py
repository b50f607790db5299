"""Texts of the screens for translators, with `sentences` and `help_texts`."""

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

LARGE_BACK = "go back"
"""An earlier circle is wrong."""

REASONS = (
    "the holder or the ball was touched",
    "the bar slipped or was knocked",
    "wrong ball, bore, bar or program",
    "the machine was disturbed or not warm",
)
"""Reasons for rejecting a run."""

REASON_TITLE = "Why does {run} not count?"
ALL_THE_SAME = (
    "the cause is known and does not touch what is wanted",
    "it cannot be measured again",
    "the machine is to be seen as it is",
)
"""Reasons for accepting a faulty run."""

REASON_TITLE_COUNTS = "Something is wrong with {run}. Why does it count all the same?"
REASON_ANOTHER = "type another reason"
REASON_KEYS = "Esc  leaves it as it is"
NOTE_TITLE = "A note for the session:"
REASON_TYPED = "type the reason, then Enter"

TIME_LEFT = (
    "{left} of {count} runs are left; their circles take {time} at the planned feeds, putting up balls comes on top."
)
NOTHING_LEFT = "All {count} runs of the plan are accepted."
THROUGH = "The plan is through. X takes a verdict back: what does not count any more is measured again."
NOT_NOW = "While the station is {state}, tests are looked at here; going to another and other verdicts have to wait."
NO_RUN = "{test} {direction}: no run yet."
RUN_FIGURES = "{run}: centre X {x:+.1f} Y {y:+.1f}, mean {mean:+.1f}, circularity {circularity:.1f} µm."
NO_CIRCLE = "{run}: no circle; {problem}"
JOB_SAYS = "{job}: Enter begins; a row that may be changed is changed by Enter too."
JOB_BEGINS = "Begin: session {session}"
JOB_ANEW = "Begin anew: leave that session as it is"
JOB_REQUIRED = "Still required: {names}. Choose the row, Enter changes it."
JOB_OLD = (
    "The session was left before this shift. Ball and holder must stand untouched since.\n\n"
    "Y  they do, go on      N or Esc  back: begin anew"
)
JOB_TROUBLE = "In trouble: {text}"
JOB_GOES_ON = "Go on with session {session}"
JOB_ROWS: Mapping[str, str] = {
    "operator": "operator",
    "order": "order number",
    "port": "port",
    "temperature": "temperature [°C]",
}
"""Choices of an operator."""
JOB_LIMIT = "at most {largest:g} {unit} of {figure}, {tests}"
JOB_ALL_TESTS = "all tests"
JOB_BEFORE = "Before you begin:"
ANSWER_TITLE = "Answer"
ANSWER_WAITS = "The circles are held against the limits …"
ANSWER_REPORT = "The report: {path}"
ANSWERS = ("WITHIN", "EXCEEDED", "CANNOT TELL")
"""The three answers, which share one size of letters."""

MESSAGES_TITLE = "Messages, the newest first. Esc or J closes."
MESSAGES_NONE = "There are none."
VIRTUAL_WORD = "virtual"
VIRTUAL_BANNER = " VIRTUAL MACHINE "
NO_VERDICT = "waits for its verdict"
NO_BORE = "in no bore"
BORE = "bore {number}"
CHOOSE = "Arrow keys choose test and direction."
CHOOSE_ONLY = "No earlier run of this test and direction. Arrow keys choose another."
CHOOSE_RUN = "Run {place} of {count} of this test and direction: H shows an earlier one. Arrow keys choose another."

START_LOOKS = "Looking for sessions …"
START_NONE = "No session yet. N begins a new one, V tries everything on a virtual machine, without hardware."
START_SOME = "Enter goes on with the chosen session, N begins a new one, V tries everything without hardware."
START_OPENS = "Opening {folder} …"
START_BROKEN = "{folder} cannot be gone on with: {problem}"
START_COMPLETE = "complete"
START_RUNS = "{accepted} of {planned} runs"
START_LEFT = ", {time} left"
START_UNJUDGED = ", {count} to judge"
START_WHAT = "{folder}\nplan {plan}, machine {machine}"
START_BY = "by {instrument} at {port}"
START_NO_LINE = "no instrument yet: I chooses one"

MISSING_PARTS: Mapping[SetUpPart, str] = {
    SetUpPart.MACHINE: "the machine's file",
    SetUpPart.PLAN: "the plan",
    SetUpPart.INSTRUMENT: "the instrument",
    SetUpPart.PORT: "the port it is connected to",
    SetUpPart.BAR: "the calibration of the bar, or why it is measured without",
    SetUpPart.FOLDER: "a folder for the session",
}
NEW_MISSING = "Still missing: {parts}. Enter changes a row."
NEW_COMPLETE = "Nothing is missing: B begins. L listens at the port."
NEW_CHECKS = "Reading and checking …"
NEW_ASKS = "Asking {port} for a reading of {instrument} …"
NEW_ANSWERS = "{port} answers: {text}."
NEW_SILENT = "{port}: {text}"
NEW_KEPT = "of the session"
NEW_EMPTY: Mapping[SetUpPart, str] = {
    SetUpPart.BAR: "not measured: Enter chooses, measures or says why not",
    SetUpPart.PROGRAMS: "none: plain circles, started at the control",
    SetUpPart.OPERATOR: "not noted",
    SetUpPart.SERIAL_NUMBER: "not noted",
    SetUpPart.JOB: "not noted",
    SetUpPart.TEMPERATURE: "not read",
}
NOT_CHOSEN = "not chosen"
WITHOUT_BAR = "without: {reason}"
VIRTUAL_BAR = "not needed: a virtual bar has the length of the plan"
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
TYPED = "type it, then Enter; Esc goes back"
TYPE_ANOTHER = "type another …"
TYPE_REASON = "without a calibration: type why …"
MEASURE_BAR = "measure it now, on its calibrator …"
CHOOSE_TITLE = "Choose {part}: arrow keys, Enter; Esc goes back."
TEMPERATURE_NOW = "Temperature of the shop now [°C]? Enter notes it, or goes on without; Esc goes back."
NO_NUMBER = "{text} is no temperature between -30 and 80 °C."
NO_PROFILE = "usual"

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

CHECK_READS = "The instrument reads {length:.4f} mm{rate}; for the first circle the bar is {seat}."
CHECK_READS_ALL = "The instrument reads {length:.4f} mm{rate}."
CHECK_NO_BAR = "The instrument answers{rate}: no bar, {said}."
CHECK_DOUBTFUL = "The instrument reads {length:.4f} mm{rate}, doubtful: {said}."
CHECK_LISTENS = "The instrument is opened …"
CHECK_SILENT = "{why}. It is opened again every {again_s:.0f} s."
CHECK_TRAVEL = "Every circle and its feed-in lie within the travel of axes, angles and struts."
CHECK_TIME = "{runs} runs; their circles take {time} at the planned feeds. {mountings} times a ball is put up, which comes on top."
CHECK_LEFT = "Left to do: {runs} runs; their circles take {time} at the planned feeds. {mountings} times a ball is put up, which comes on top."
CHECK_ORDER = "Heights and a steady drift correlate by {r:.2f}: each can be seen."
CHECK_MIXED = "Heights and a steady drift correlate by {r:.2f}: a drift can look like an effect of height."
CHECK_PROGRAMS = "{count} NC programs run the circles that they are named after, {by}. {folder}"
CHECK_NOMINAL = "nominal"
CHECK_COMPENSATED = "compensated with the model {models} (SHA-256)"
PROGRAMS_TITLE = "Write NC programs of all circles: arrow keys, Enter; Esc goes back."
PROGRAMS_NOMINAL = "nominal: the plain circles of the plan"
PROGRAMS_BY = "compensated with {model}"
CHECK_NO_PROGRAMS = "The control runs plain circles; W writes NC programs of them."
CHECK_BAR = "The bar {serial} was on its calibrator, at {when}."
CHECK_WAIVED = "The bar is not calibrated: {reason}"
CHECK_VIRTUAL = "Machine, bar and instrument are virtual."
CHECK_OLD = "The session keeps bar and shop as it has noted them."
CHECK_TEMPERATURE = "Temperature of the shop before: {temp:g} °C."
CHECK_NO_TEMPERATURE = (
    "The temperature of the shop was not read: T takes it. What the bar grows by is not known without."
)
CHECK_WHO = "Machine {serial}, operator {operator}, job {job}."
CHECK_WROTE = "{count} NC programs written to {folder}."
CHECK_OPEN = "Still to be confirmed: {count} of {all}. Enter confirms one, Y all."
CHECK_READY = "Everything is confirmed: B begins."
CHECK_WRITES = "Writing NC programs …"
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
BAR_MISSING = "Still missing: {rows}. Enter changes a row."
BAR_READY = "Put the bar on the calibrator, wait until it is as warm as the shop; then B reads it."
BAR_NO_NUMBER = "{row}: `{text}` is no number."
BAR_LIVE = "now {length:.4f} mm, {off:+.1f} µm against the calibrator"
BAR_NO_BAR = "no length yet: {said}"
BAR_DOUBTFUL = "now {length:.4f} mm, doubtful: {said}"
BAR_READS = "Reading: {done} of {of}. Leave the bar alone."
BAR_DONE = "The bar reads {long:+.2f} µm long, standard uncertainty {u:.2f} µm. Written to {path}. Esc takes it."
BAR_DRIFTED = " It drifted by {drift:+.2f} µm meanwhile: let the bar cool down, then B reads it again."

STEPS: Mapping[SessionTask, tuple[str, str]] = {
    SessionTask.CALIBRATE: ("1", "Calibrate: fit the kinematic parameters"),
    SessionTask.DIAGNOSE: ("2", "Diagnose: what the calibration leaves out"),
    SessionTask.PROGRAMS: ("3", "Programs: compensated NC programs of the circles"),
    SessionTask.REPORT: ("4", "Report: verdict against the shop's tolerances"),
    SessionTask.ACCEPTANCE: ("5", "Acceptance: before and now, as measured"),
    SessionTask.FIGURES: ("6", "Figures: the circles, drawn"),
    SessionTask.HISTORY: ("7", "History: all sessions beside this one"),
}
STEP_WORDS: Mapping[WorkProgress | None, str] = {
    None: "not yet",
    WorkProgress.RUNNING: "{stage} ({passed})",
    WorkProgress.DONE: "done in {passed}",
    WorkProgress.FAILED: "failed",
    WorkProgress.CANCELLED: "ended",
}
STEP_SIGNS: Mapping[WorkProgress | None, str] = {
    None: "·",
    WorkProgress.RUNNING: "▶",
    WorkProgress.DONE: "✓",
    WorkProgress.FAILED: "✗",
    WorkProgress.CANCELLED: "-",
}
STEP_BEGINS = "beginning"
RESULTS_IDLE = "Enter does the chosen step, 0 the first four; results go to {folder}."
RESULTS_BUSY = "Working; K ends the step, Esc goes back."
RESULTS_NO_MODEL = "Programs need a model: 1 calibrates, 2 diagnoses."
RESULTS_EMPTY = "Nothing yet."
RESULTS_CANCELLED = "Ended before it was done; nothing of it was written."
RESULTS_LEAVE = (
    "A step is being done. End it and go back?\n\nWhat is done already stays.\n\nY  end it      N or Esc  go on"
)

VERDICT_WORDS: Mapping[str, str] = {
    "identified": "Identified causes",
    "happened": "Happened in this session",
    "does-not-predict": "Found here, not confirmed by tests that were held back",
    "ambiguous": "Ambiguous",
    "not-testable": "These tests cannot tell",
}
CAUSES = "{verdict}: {names}"
PROGRAMMED = "{count} programs for {dialect}, all within the machine's travel."
DRAWN = "{count} circles are drawn."
CORRECTED = "The greatest correction is {most:.1f} µm."
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
ACCEPTANCE_BUSY = "Comparing: {stage} ({passed}). X ends it."
ACCEPTANCE_CANCELLED = "Ended before it was done; nothing of it was written. B chooses a session before."
ACCEPTANCE_WAITS = "Another step is being done; the acceptance can begin when that has ended."
ACCEPTANCE_HEADING: Mapping[str, str] = {
    "test": "test",
    "figure": "worst figure, µm",
    "before": "before",
    "now": "now",
    "limit": "limit",
    "expanded": "U k=2",
    "verdict": "verdict",
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
FORMER_TITLE = "Hold this session against which one before? Arrow keys, Enter; Esc goes back."
FORMER = "{name:20} {when}  {by}"
FORMER_LOOKS = "Looking for sessions measured before …"
FORMER_SOME = "Choose the session measured before: Enter. Then both are held against the shop's tolerances."
FORMER_NONE = (
    "No session of the same machine, plan and jig beside this one ended before it began: there is nothing to compare."
)
NOT_BEFORE = "-"
WORST = "{figure}: before {before}; now {now}; at most {limit:g} µm: {word}."
WORST_CIRCLE = "{um:.1f} µm, U {expanded} µm ({test} {direction} {repeat})"
RUN_BY_NOW = "The circles of this session ran by {by}."
RUN_BY_PLAIN = "the control's own circles"
RUN_BY_NOMINAL = "nominal programs"
RUN_BY_SOME = "compensated programs for {count} of {all} only"
RUN_BY_COMPENSATED = "compensated programs"
WAY_BACK_NOMINAL = "Way back: before, nothing was compensated; machine and plan lie in {folder}."
WAY_BACK_MODEL = "Way back: the model in force before is kept in {path}."
WAY_BACK_LOST = "Way back: the model with SHA-256 {sha256}… was in force before and lies nowhere beside the sessions."
WAY_BACK_PROGRAMS = "Way back: the programs that ran before lie in {path}."

RATE = ", {rate:.0f} times a second"
SEATED = "seated"
SEATED_BACKWARDS = "short: counts the wrong way?"
NOT_SEATED_SHORT = "{mm:.1f} mm short of feed-in"
NOT_SEATED_LONG = "{mm:.1f} mm beyond feed-in"
