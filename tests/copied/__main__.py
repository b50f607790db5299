"""Makes a copy of the loaded process `python -m MODULE WORDS`, with the environment and the terminal of the test."""

import json
import os
import runpy
import signal
import sys

if __name__ == "__main__":
    environment, alone, module, *sys.argv[1:] = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(json.loads(environment))
    if alone:
        os.setsid()
    # As Python opens them: by lines to a terminal.
    sys.stdin = sys.__stdin__ = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = sys.__stdout__ = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = sys.__stderr__ = open(  # noqa: SIM115
        2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False
    )
    runpy.run_module(module, run_name="__main__", alter_sys=True)
