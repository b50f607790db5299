"""The commands `python -m studies NAME`: one module per experiment."""

STUDIES = {
    "blind": "Effects hidden by an independent simulation: found, named, or rightly not.",
    "concealed-gravity": "Gravity hidden in a kinematic calibration: found, named, modelled.",
    "coverage": "Do the stated 95 % intervals hold the truth?",
    "gravity": "Gravity identified after the kinematics, as in the paper, and with them.",
    "history": "False alarms and delays of what watches a machine over its sessions.",
    "platform-joints": "The hard case: joint errors hidden to 99 %, from cannot tell to a name.",
    "sensitivities": "Answers with the constants that decide them halved and doubled.",
    "table-iii": "The paper's three ways to calibrate, on many random machines.",
}
"""Name and one line of help of every study; each is a module of this folder with a command of its name."""
