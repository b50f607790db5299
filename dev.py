"""Set up and run dbbstation from a checkout, with nothing installed but Python 3.11 to 3.13 and git.

    python3 dev.py demo --quick  the whole job on a simulated machine, with three tests; without --quick with fifteen
    python3 dev.py test          lint, types, import walls, docs and all tests that need no special recordings
    python3 dev.py run ...       any dbbstation command, such as: python3 dev.py run calibrate SESSION
    python3 dev.py shell-line    the line that puts `dbbstation` on the PATH of your shell

Makes a virtual environment in .venv beside this file at the first call and brings it up to date when
pyproject.toml changes. A system Python that refuses global installs is fine: nothing is installed outside .venv.
"""

from __future__ import annotations

import hashlib
import io
import os
import platform
import signal
import subprocess
import sys
import venv
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from pathlib import Path

HERE = Path(__file__).resolve().parent
ENVIRONMENT = HERE / ".venv"
SCRIPTS = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
STAMP = ENVIRONMENT / "dbbstation-stamp"
VERSIONS = ((3, 11), (3, 13))

CHECKS = (
    ("docs", ["sphinx-build", "-q", "-W", "-b", "html", "docs", "docs/_build"]),
    ("format", ["ruff", "format", "--check", "."]),
    ("lint", ["ruff", "check", "."]),
    ("encodings", ["ruff", "check", "--preview", "--select", "PLW1514", "."]),
    ("types", ["mypy"]),
    ("tests found", ["pytest", "-q", "--collect-only"]),
    ("walls", ["lint-imports"]),
)
"""What `test` runs before the tests, two at a time, the longest first: none of them needs the other, and each has one core.

Finding the tests compiles them once, beside the types; workers that begin together each compile all of them.
"""

TESTS = ["pytest", "-q", "-n", "auto", "--dist", "worksteal"]


def main(arguments: list[str]) -> int:
    """Carry out the command line and return its exit code."""
    command = arguments[0] if arguments else ""
    if command not in {"demo", "test", "run", "shell-line"}:
        print(__doc__)
        return 2
    if not VERSIONS[0] <= sys.version_info[:2] <= VERSIONS[1]:
        print(f"dbbstation needs Python 3.11, 3.12 or 3.13; this is {sys.version.split()[0]}", file=sys.stderr)
        return 1
    # Ctrl-C is for the program that runs: it ends by itself in its own way, and this script waits for it.
    signal.signal(signal.SIGINT, lambda *_: None)
    if not set_up():
        return 1
    if command == "test":
        return test(arguments[1:])
    if command == "shell-line":
        print(f'export PATH="{SCRIPTS}:$PATH"')
        return 0
    rest = arguments[1:] if command == "run" else arguments
    return subprocess.call([PYTHON, "-m", "dbbstation", *rest])


def set_up() -> bool:
    """Make the virtual environment and install the checkout into it, where that is not done yet."""
    wanted = hashlib.sha256((HERE / "pyproject.toml").read_bytes() + sys.version.encode()).hexdigest()
    if STAMP.exists() and STAMP.read_text(encoding="utf-8") == wanted:
        return True
    print("setting up .venv, this takes a minute or two ...", file=sys.stderr, flush=True)
    install = [*installer(), "install", "--quiet", "--disable-pip-version-check", "--editable", f"{HERE}[dev]"]
    if subprocess.call(install) != 0:
        print(
            "the installation failed; pip's message above says why\n"
            "pip fetches packages from the network; behind a proxy, set HTTPS_PROXY\n"
            "where pip itself is missing: sudo apt install python3-venv",
            file=sys.stderr,
        )
        return False
    print("compiling the numerical loops for this computer, about ten seconds ...", file=sys.stderr, flush=True)
    if subprocess.call([PYTHON, "-m", "dbbstation.prepare"], cwd=HERE) != 0:
        print("that failed; the first command that needs them will say why", file=sys.stderr)
    STAMP.write_text(wanted, encoding="utf-8")
    return True


def installer() -> list[str | Path]:
    """Make the environment and return the command that is its pip."""
    if Path(sys.prefix).resolve() == ENVIRONMENT:  # who has it on their PATH runs this with it: it stands
        return [PYTHON, "-m", "pip"]
    described = ENVIRONMENT / "pyvenv.cfg"
    this_python = f"version = {platform.python_version()}\n"
    other = described.exists() and this_python not in described.read_text(encoding="utf-8")
    try:
        with redirect_stdout(io.StringIO()):  # Debian's own words would tell people to do what is not needed
            venv.create(ENVIRONMENT, with_pip=True, clear=other)  # libraries of another Python are of no use
    except (subprocess.CalledProcessError, SystemExit):
        # Debian leaves out ensurepip; the system's pip, where there is one, can install into another environment.
        venv.create(ENVIRONMENT, with_pip=False)
        return [sys.executable, "-m", "pip", "--python", PYTHON]
    return [PYTHON, "-m", "pip"]


def test(rest: list[str]) -> int:
    """Run all checks, then the tests where they hold; further arguments go to pytest."""
    failed = 0
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each worker would compile all tests
    with ThreadPoolExecutor(2) as pool:
        for (name, _), done in zip(CHECKS, pool.map(check, CHECKS), strict=True):
            said = done.stdout.splitlines(keepends=True)
            print(f"== {name}\n", *(said if done.returncode else said[-1:]), sep="", end="", flush=True)
            if done.returncode != 0:
                print(f"{name} failed", file=sys.stderr)
                failed = failed or done.returncode
    if failed:
        return failed
    print("== tests", flush=True)
    return subprocess.call([SCRIPTS / TESTS[0], *TESTS[1:], *rest], cwd=HERE)


def check(named: tuple[str, list[str]]) -> subprocess.CompletedProcess[str]:
    """Run one check and return its exit code with all that it printed."""
    program, *arguments = named[1]
    return subprocess.run(
        [SCRIPTS / program, *arguments],
        cwd=HERE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
