"""Former names of commands and flags; a message gives the new names."""

RENAMED = {
    "drive": "`identify`",
    "emulate": "`instrument emulate`",
    "instruments": "`instrument list`",
    "monitor": "`instrument monitor`",
    "plot": "`circles --figure`",
    "ports": "`instrument ports`",
    "replay": "`instrument replay`",
    "station": "`measure`",
    "study": "`python -m studies` in a checkout",
}

RENAMED_FLAGS = {
    "bar --calibrator": "--calibrator-serial",
    "bar --certificate": "--calibrator-certificate",
    "bar --serial-number": "--bar-serial-number",
    "circles --csv": "--table",
    "compensate --angles": "--angles-deg",
    "compensate --from": "--written-in",
    "compensate --offset": "--offsets",
    "compensate --tool-length": "--tool-lengths-mm",
    "diagnose --keep-unexplained": "--out, which keeps it",
    "export --state": "--states",
    "fleet --do": "--task",
    "history --csv": "--table",
    "history --html": "--page",
    "history --rebuild": "--anew",
    "holders --column": "--columns",
    "holders --before": "--jig",
    "identify --out": "--table",
    "mismatch --corrected": "--table",
    "predict --out": "--table",
    "predict --poses": "POSES without a flag",
    "report --out": "--page",
    "sheet --column": "--columns",
    "sheet --before": "--jig",
    "sheet --k": "--coverage",
    "sheet --name": "--names",
    "simulate --plan": "PLAN without a flag",
}
"""New names by command and flag; names that only gained an `s` are suggested anyway."""
