"""Set up and run dbbstation from a checkout, with nothing installed but Python 3.11 to 3.13 and git.

    python3 dev.py demo          the whole job on a simulated machine
    python3 dev.py test          lint, types, import walls, docs and all tests that need no special recordings
    python3 dev.py run ...       any dbbstation command, such as: python3 dev.py run calibrate SESSION
    python3 dev.py shell-line    the line that puts `dbbstation` on the PATH of your shell

Makes a virtual environment in .venv beside this file at the first call and brings it up to date when
pyproject.toml changes. A system Python that refuses global installs is fine: nothing is installed outside .venv.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ENVIRONMENT = HERE / ".venv"
SCRIPTS = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
STAMP = ENVIRONMENT / "dbbstation-stamp"
VERSIONS = ((3, 11), (3, 13))

CHECKS = (
    ("format", ["ruff", "format", "--check", "."]),
    ("lint", ["ruff", "check", "."]),
    ("types", ["mypy"]),
    ("walls", ["lint-imports"]),
    ("docs", ["sphinx-build", "-q", "-W", "-b", "html", "docs", "docs/_build"]),
    ("tests", ["pytest", "-q", "-n", "auto"]),
)
"""What `test` runs, in this order; the first failure stops it."""


def main(arguments: list[str]) -> int:
    """Carry out the command line and return its exit code."""
    command = arguments[0] if arguments else ""
    if command not in {"demo", "test", "run", "shell-line"}:
        print(__doc__)
        return 2
    if not VERSIONS[0] <= sys.version_info[:2] <= VERSIONS[1]:
        print(f"dbbstation needs Python 3.11, 3.12 or 3.13; this is {sys.version.split()[0]}", file=sys.stderr)
        return 1
    set_up()
    if command == "test":
        return test(arguments[1:])
    if command == "shell-line":
        print(f'export PATH="{SCRIPTS}:$PATH"')
        return 0
    rest = arguments[1:] if command == "run" else arguments
    return subprocess.call([PYTHON, "-m", "dbbstation", *rest])


def set_up() -> None:
    """Make the virtual environment and install the checkout into it, where that is not done yet."""
    wanted = hashlib.sha256((HERE / "pyproject.toml").read_bytes() + sys.version.encode()).hexdigest()
    if STAMP.exists() and STAMP.read_text(encoding="utf-8") == wanted:
        return
    print("setting up .venv, this takes a minute ...", file=sys.stderr)
    if importlib.util.find_spec("ensurepip"):
        venv.create(ENVIRONMENT, with_pip=True)
        installer = [PYTHON, "-m", "pip"]
    else:
        # Debian ships Python without ensurepip; its pip, where there is one, can install into another environment.
        venv.create(ENVIRONMENT, with_pip=False)
        installer = [sys.executable, "-m", "pip", "--python", PYTHON]
    install = [*installer, "install", "--quiet", "--disable-pip-version-check", "--editable", f"{HERE}[dev]"]
    if subprocess.call(install) != 0:
        print(
            "the installation failed; pip's message above says why\n"
            "without pip on the system: sudo apt install python3-venv",
            file=sys.stderr,
        )
        raise SystemExit(1)
    STAMP.write_text(wanted, encoding="utf-8")


def test(rest: list[str]) -> int:
    """Run all checks; further arguments go to pytest."""
    for name, command in CHECKS:
        print(f"== {name}", flush=True)
        extra = rest if name == "tests" else []
        code = subprocess.call([SCRIPTS / command[0], *command[1:], *extra], cwd=HERE)
        if code != 0:
            print(f"{name} failed", file=sys.stderr)
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
