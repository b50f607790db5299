"""What the screens say about themselves, in one place for whoever translates it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.service.after import Step
from dbbstation.service.choice import Part
from dbbstation.service.order import Gate, Order
from dbbstation.service.work import Progress
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
                "Counter-clockwise is drawn thick, clockwise thin. A mark shows where the machine is. Dim beneath lies the last accepted "
                "circle of the session before, of the same machine and test, where there is one."
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
            "t": "Ask the port what answers there.",
            "delete": "Empty the row.",
            "up": "The row above.",
            "down": "The row below.",
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
            "up": "The row above.",
            "down": "The row below.",
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
                "Five steps on the accepted runs. Each is a command of the program in a process of its own, so that it can be ended; "
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
            "a": "The first four steps, one behind the other.",
            "c": "Calibrate.",
            "d": "Diagnose.",
            "p": "Write compensated NC programs.",
            "r": "Write the report: the verdict against the shop's tolerances.",
            "b": "Acceptance: circles as measured before and now, against the shop's tolerances.",
            "x": "End the step that is being done.",
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
            "b": "Choose another session before.",
            "x": "End the comparison that is being made.",
            "up": "The row above.",
            "down": "The row below.",
            "escape": "Back to the results.",
        },
    ),
    "everywhere": Help(
        "On every screen",
        keys={
            "o": "All tests of the plan on a map of the plate.",
            "f": "Large figures for two metres, and back.",
            "c": "After a fault: open instrument and session again.",
            "e": "Results of the session: calibrate, diagnose, programs, report.",
            "t": "Note the temperature of the shop. After circles it is asked for before the session is left.",
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
    "delete": "Delete",
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
QUIT_OPENS = "The virtual machine is being switched on; a moment."

PARTS: Mapping[Part, str] = {
    Part.MACHINE: "machine",
    Part.PLAN: "plan",
    Part.INSTRUMENT: "instrument",
    Part.PORT: "port",
    Part.BAR: "bar",
    Part.FOLDER: "folder",
    Part.PROGRAMS: "NC programs",
    Part.OPERATOR: "operator",
    Part.SERIAL_NUMBER: "serial number",
    Part.JOB: "job",
    Part.TEMPERATURE: "temperature",
    Part.ORDER: "order of tests",
    Part.GATE: "drift gate",
}
"""Names of the rows of a new session."""

MISSING_PARTS: Mapping[Part, str] = {
    Part.MACHINE: "the machine's file",
    Part.PLAN: "the plan",
    Part.INSTRUMENT: "the instrument",
    Part.PORT: "the port it is connected to",
    Part.BAR: "the calibration of the bar, or why it is measured without",
    Part.FOLDER: "a folder for the session",
}
NEW_MISSING = "Still missing: {parts}. Enter changes a row."
NEW_COMPLETE = "Nothing is missing: B begins. T asks the port what answers."
NEW_CHECKS = "Reading and checking …"
NEW_ASKS = "Asking {port} for a reading of {instrument} …"
NEW_ANSWERS = "{port} answers: {text}."
NEW_SILENT = "{port}: {text}"
NEW_KEPT = "of the session"
NEW_EMPTY: Mapping[Part, str] = {
    Part.BAR: "not measured: Enter chooses, measures or says why not",
    Part.PROGRAMS: "none: plain circles, started at the control",
    Part.OPERATOR: "not noted",
    Part.SERIAL_NUMBER: "not noted",
    Part.JOB: "not noted",
    Part.TEMPERATURE: "not read",
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
TEMPERATURE_NOW = "Temperature of the shop now [°C]? Enter notes it, Esc goes on without."
NO_NUMBER = "{text} is no temperature between -30 and 80 °C."
NO_PROFILE = "usual"

CONFIRMED: Mapping[str, str] = {
    "bar": "The bar, its cable and both balls are clean; the magnets hold.",
    "holder": "The holder of every test is at hand, and sits in its bore without play.",
    "jig": "The plate sits flat in its seat and is clamped.",
    "clearance": "Every tilt was run once without the bar: bar and tool stay clear.",
    "spindle": "The spindle is locked and oriented; nobody starts it.",
}
"""What only a person can see before a session, by a name that is not shown."""

CONFIRMED_AGAIN: Mapping[str, str] = {
    "bar": "The bar is in, its cable is free, both balls are clean.",
    "holder": "The holder stands untouched; if not, M begins the first circle, not Enter.",
    "jig": "The plate was not moved in its seat, and is clamped.",
    "spindle": "The spindle is locked, oriented as before; nobody starts it.",
}
"""The same of a session that goes on: what can have changed since."""

CHECK_TRAVEL = "Every circle and its feed-in lie within the travel of axes, angles and struts."
CHECK_TIME = "{runs} runs; their circles take {time} at the planned feeds. {mountings} times a ball is put up, which comes on top."
CHECK_LEFT = "Left to do: {runs} runs; their circles take {time} at the planned feeds. {mountings} times a ball is put up, which comes on top."
CHECK_ORDER = "Heights and a steady drift correlate by {r:.2f}: they are told apart."
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
    "temp_c": "temperature of the bar [°C]",
}
BAR_MISSING = "Still missing: {rows}. Enter changes a row."
BAR_READY = "Put the bar on the calibrator, wait until it is as warm as the shop; then B reads it."
BAR_NO_NUMBER = "{row}: `{text}` is no number."
BAR_LIVE = "now {length:.4f} mm, {off:+.1f} µm against the calibrator"
BAR_NO_BAR = "no length yet: {said}"
BAR_READS = "Reading: {done} of {of}. Leave the bar alone."
BAR_DONE = "The bar reads {long:+.2f} µm long, standard uncertainty {u:.2f} µm. Written to {path}. Esc takes it."
BAR_DRIFTED = " It drifted by {drift:+.2f} µm meanwhile: give it time to cool down, then B reads it again."

STEPS: Mapping[Step, tuple[str, str]] = {
    Step.CALIBRATE: ("C", "Calibrate: fit the kinematic parameters"),
    Step.DIAGNOSE: ("D", "Diagnose: what the calibration leaves out"),
    Step.PROGRAMS: ("P", "Programs: compensated NC programs of the circles"),
    Step.REPORT: ("R", "Report: verdict against the shop's tolerances"),
    Step.ACCEPTANCE: ("B", "Acceptance: before and now, as measured"),
}
STEP_WORDS: Mapping[Progress | None, str] = {
    None: "not yet",
    Progress.RUNNING: "{stage} ({passed})",
    Progress.DONE: "done in {passed}",
    Progress.FAILED: "failed",
    Progress.CANCELLED: "ended",
}
STEP_SIGNS: Mapping[Progress | None, str] = {
    None: "·",
    Progress.RUNNING: "▶",
    Progress.DONE: "✓",
    Progress.FAILED: "✗",
    Progress.CANCELLED: "-",
}
STEP_BEGINS = "beginning"
RESULTS_IDLE = "A does the first four, X ends one; results go to {folder}."
RESULTS_BUSY = "Working; X ends the step, Esc goes back."
RESULTS_NO_MODEL = "Programs need a model: C calibrates, D diagnoses."
RESULTS_EMPTY = "Nothing yet."
RESULTS_CANCELLED = "Ended before it was done; nothing of it was written."
RESULTS_LEAVE = (
    "A step is being done. End it and go back?\n\nWhat is done already stays.\n\nY  end it      N or Esc  go on"
)

FITTED = (
    "{count} parameters are identified. The nominal machine leaves {nominal:.1f} µm rms of the readings, the model {left:.2f} µm, "
    "within each mounting {within:.2f} µm; one reading has {noise:.2f} µm of noise."
)
PHYSICS_MISSING = "What is left exceeds noise and mountings by {rms:.2f} µm rms: physics is missing, D looks for it."
OUTLIER = "Outlier, kept out of the fit: {text}"
UNSEEN = "The plan could not see: {text}"
GAP = "What helps: {text}"
ALL_SEEN = "The plan sees every parameter."
TOO_FEW = "{tests} tests are too few to check themselves: {left} degrees of freedom are left. A small residual proves nothing."
MISMATCH = "The recordings differ from the kinematic model by {rms:.2f} µm rms beyond a noise of {noise:.2f} µm."
NO_MISMATCH = "The recordings agree with the kinematic model; noise {noise:.2f} µm."
VERDICT_WORDS: Mapping[str, str] = {
    "identified": "Identified causes",
    "ambiguous": "Ambiguous",
    "not-testable": "These tests cannot tell",
}
CAUSES = "{verdict}: {names}"
MEASURE_NEXT = "Measure next: {text}"
PROGRAMMED = "{count} programs for {dialect}, all within the machine's travel."
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
CONFORMITY_WORDS: Mapping[str, str] = {"within": "PASS", "exceeded": "FAIL", "cannot tell": "CANNOT TELL"}
FIGURE_NAMES: Mapping[str, str] = {
    "circular-deviation": "circular deviation",
    "centre-deviation": "centre deviation",
    "mean-radial-error": "mean radial error",
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
WORST_CIRCLE = "{um:.1f} µm, U {expanded_um:.1f} µm ({test} {direction} {repeat})"
RUN_BY_NOW = "The circles of this session ran by {by}."
RUN_BY_PLAIN = "the control's own circles"
RUN_BY_NOMINAL = "nominal programs"
RUN_BY_SOME = "compensated programs for {count} of {all} only"
RUN_BY_COMPENSATED = "compensated programs"
WAY_BACK_NOMINAL = "Way back: before, nothing was compensated; machine and plan lie in {folder}."
WAY_BACK_MODEL = "Way back: the model in force before is kept in {path}."
WAY_BACK_LOST = "Way back: the model with SHA-256 {sha256}… was in force before and lies nowhere beside the sessions."
WAY_BACK_PROGRAMS = "Way back: the programs that ran before lie in {path}."

SEATED = "seated"
NOT_SEATED_SHORT = "{mm:.1f} mm short of feed-in"
NOT_SEATED_LONG = "{mm:.1f} mm beyond feed-in"
