"""Build a release, lock what it is tested with, make a wheelhouse, and try every way of installing.

    python releasing.py build               wheel and sdist in dist/, checked; prints what to publish
    python releasing.py lock                requirements.lock: what CI tests, with hashes
    python releasing.py licences            THIRD-PARTY.md: licences of all that is installed along
    python releasing.py wheelhouse FOLDER   the program and all it needs, for a computer without a network
    python releasing.py try                 each way of installing into a clean environment: seconds and megabytes

A wheelhouse installs with `pip install --no-index --find-links FOLDER dbbstation`. `try` takes interpreters such as `python3.12`,
and `--lowest` for the lowest versions that pyproject.toml declares.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from pathlib import Path

from packaging.requirements import Requirement

HERE = Path(__file__).resolve().parent
PROJECT = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
VERSION = re.search(r'__version__ = "(.+)"', (HERE / "dbbstation/__init__.py").read_text(encoding="utf-8"))[1]  # type: ignore[index]
LARGEST_MB = {".whl": 2.5, ".gz": 8.0}
"""Largest wheel and sdist: a recording that slipped in takes more."""
LOCK, LICENCES = HERE / "requirements.lock", HERE / "THIRD-PARTY.md"
UV = ("uv", "pip", "compile", "pyproject.toml", "--universal", "--no-header", "--no-annotate", "--generate-hashes")


class UnfitError(Exception):
    """The release must not be published."""


def run(*words: object, cwd: Path = HERE, **more: object) -> str:
    done = subprocess.run([*map(str, words)], cwd=cwd, text=True, capture_output=True, check=False, **more)  # type: ignore[call-overload]
    if done.returncode:
        raise UnfitError(f"{' '.join(map(str, words))}\n{done.stdout}{done.stderr}")
    return str(done.stdout)


def built(folder: Path) -> list[Path]:
    """Build an sdist, and the wheel from it."""
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder)
    (sdist,) = folder.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as unpacked:
        with tarfile.open(sdist) as archive:
            archive.extractall(unpacked, filter="data")
        source = Path(unpacked) / sdist.name.removesuffix(".tar.gz")
        run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=source)
    return sorted(folder.iterdir())


def faults_of(files: list[Path]) -> list[str]:
    """What must not be published so."""
    found = [
        f"{path.name} has {path.stat().st_size / 1e6:.1f} MB"
        for path in files
        if path.stat().st_size > LARGEST_MB[path.suffix] * 1e6
    ]
    (wheel,) = (path for path in files if path.suffix == ".whl")
    names = zipfile.ZipFile(wheel).namelist()
    info = f"dbbstation-{VERSION}.dist-info/licenses/"
    wanted = (
        "dbbstation/py.typed",
        "dbbstation/protocols/plans/table2.yaml",
        f"{info}LICENSE",
        f"{info}THIRD-PARTY.md",
    )
    found += [f"{name} is not in the wheel" for name in wanted if name not in names]
    found += [
        f"{name} is in the wheel"
        for name in names
        if not name.startswith("dbbstation") or name.endswith((".pyc", ".nbi"))
    ]
    changes = (HERE / "CHANGELOG.md").read_text(encoding="utf-8")
    if (first := re.search(r"(?m)^## (\S+?),? ", changes)) is None or first[1] != VERSION:
        found.append(f"CHANGELOG.md does not begin with {VERSION}")
    if f"version: {VERSION}\n" not in (HERE / "CITATION.cff").read_text(encoding="utf-8"):
        found.append(f"CITATION.cff is not of {VERSION}")
    if third_party() != LICENCES.read_text(encoding="utf-8"):
        found.append("THIRD-PARTY.md is out of date: python releasing.py licences")
    return found


def build(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    files = built(folder)
    with tempfile.TemporaryDirectory() as again:
        for one, other in zip(files, built(Path(again)), strict=True):
            if one.read_bytes() != other.read_bytes():
                raise UnfitError(f"{one.name} is built otherwise a second time")
    if faults := faults_of(files):
        raise UnfitError("\n".join(faults))
    print(run(sys.executable, "-m", "twine", "check", "--strict", *files), end="")
    for path in files:
        print(
            f"{path.name}  {path.stat().st_size / 1e6:.2f} MB  sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}"
        )
    if "urls" not in PROJECT:
        print("note: pyproject.toml states no addresses; add [project.urls] when the project has them")
    print(
        f"twice the same bytes. Publish:\n  git tag -s v{VERSION} -m 'dbbstation {VERSION}' && git push origin v{VERSION}"
    )
    print(f"  python -m twine upload {' '.join(os.path.relpath(path, HERE) for path in files)}")


def needed() -> list[importlib.metadata.Distribution]:
    """All that an installation without extras brings along."""
    found: dict[str, importlib.metadata.Distribution] = {}
    done: set[tuple[str, str]] = set()
    waiting = [(Requirement(text), "") for text in PROJECT["dependencies"]]
    while waiting:
        one, extra = waiting.pop()
        if one.marker is not None and not one.marker.evaluate({"extra": extra}):
            continue
        name = re.sub(r"[-_.]+", "-", one.name).lower()
        found[name] = importlib.metadata.distribution(one.name)
        for inner in {"", *one.extras} - {of for which, of in done if which == name}:
            done.add((name, inner))
            waiting += [(Requirement(text), inner) for text in found[name].requires or ()]
    return [found[name] for name in sorted(found)]


def third_party() -> str:
    rows = []
    for one in needed():
        licence = one.metadata.get("License-Expression") or ""
        if not licence:
            classes = [
                text.rpartition(" :: ")[2] for text in one.metadata.get_all("Classifier") or () if "License ::" in text
            ]
            licence = ", ".join(classes) or (one.metadata.get("License") or "").splitlines()[0]
        rows.append(f"| {one.metadata['Name']} | {licence} |")
    head = "# Licences of other packages\n\nThe wheel contains none of their code. An installation without extras brings them along, each with its licence.\n"
    return "\n".join([head, "| package | licence |", "| --- | --- |", *rows, ""])


def lock() -> None:
    run(*UV, "--extra", "dev", "--no-emit-index-url", "--no-emit-find-links", "-o", LOCK)
    text = LOCK.read_text(encoding="utf-8")
    head = "# What CI tests, with hashes; written by `python releasing.py lock`. Install: pip install --require-hashes -r requirements.lock\n"
    LOCK.write_text(head + text, encoding="utf-8")
    print(f"{len(re.findall('(?m)^[a-z].*==', text))} packages, {text.count('--hash')} hashes")


def wheelhouse(folder: Path) -> None:
    """Fetch with the hashes of the lock, so that a shop gets what was tested."""
    with tempfile.TemporaryDirectory() as name:
        files = built(Path(name))
        names = {re.sub(r"[-_.]+", "-", one.metadata["Name"]).lower() for one in needed()}
        parts = re.split(r"(?m)^(?=[a-z0-9])", LOCK.read_text(encoding="utf-8"))
        only = Path(name) / "only.txt"
        only.write_text("".join(part for part in parts if part.partition("==")[0] in names), encoding="utf-8")
        folder.mkdir(parents=True, exist_ok=True)
        run(
            sys.executable,
            "-m",
            "pip",
            "download",
            "-q",
            "--require-hashes",
            "--only-binary",
            ":all:",
            "-r",
            only,
            "-d",
            folder,
        )
        shutil.copy(next(path for path in files if path.suffix == ".whl"), folder)
    size = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    print(
        f"{len(list(folder.iterdir()))} wheels, {size:.0f} MB; there: pip install --no-index --find-links {folder} dbbstation"
    )


def try_all(interpreters: list[str], *, lowest: bool, house: Path | None) -> None:
    print(
        "| interpreter | from | install [s] | MB | first check [s] | demo --quick [s] |\n| --- | --- | --- | --- | --- | --- |",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as name:
        files = built(Path(name) / "dist")
        for interpreter in interpreters:
            for what in files:
                print(tried(interpreter, what, Path(name), lowest=lowest, house=house), flush=True)


def tried(interpreter: str, what: Path, folder: Path, *, lowest: bool, house: Path | None) -> str:
    """Install into a new environment, without pip in it, and use the program from an empty folder."""
    place = Path(tempfile.mkdtemp(dir=folder))
    run(interpreter, "-m", "venv", "--without-pip", place / "env")
    scripts = place / "env" / ("Scripts" if os.name == "nt" else "bin")
    more = ["--no-index", "--find-links", house] if house else []
    installer = [sys.executable, "-m", "pip", "--python", scripts / "python", "install", "-q"]
    if lowest:
        installer = ["uv", "pip", "install", "-q", "--python", scripts / "python", "--resolution", "lowest-direct"]
    began_s = time.monotonic()
    run(*installer, *more, what)
    install_s = time.monotonic() - began_s
    size_mb = sum(path.stat().st_size for path in (place / "env").rglob("*") if path.is_file()) / 1e6
    used = place / "used"
    used.mkdir()
    kept = ("HOME", "TMPDIR", "LANG", "SYSTEMROOT", "USERPROFILE", "LOCALAPPDATA", "APPDATA")
    environment = {key: os.environ[key] for key in kept if key in os.environ} | {
        "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"
    }
    run(scripts / "python", "-c", "import dbbstation", cwd=used, env=environment)
    plan = "import dbbstation.files.places as s; print(s.shipped_folder('protocols') / 'plans' / 'table2.yaml')"
    plan = run(scripts / "python", "-c", plan, cwd=used, env=environment).strip()
    seconds = []
    for words in (["check", plan], ["demo", "--quick"]):
        began_s = time.monotonic()
        run(scripts / "dbbstation", *words, cwd=used, env=environment)
        seconds.append(f"{time.monotonic() - began_s:.0f}")
    version = run(scripts / "python", "-V").strip()
    which = f"{what.suffix.replace('.gz', 'sdist').replace('.whl', 'wheel')}{', lowest versions' if lowest else ''}{', wheelhouse' if house else ''}"
    shutil.rmtree(place)
    return f"| {version} | {which} | {install_s:.0f} | {size_mb:.0f} | {' | '.join(seconds)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=["build", "lock", "licences", "wheelhouse", "try"])
    parser.add_argument("rest", nargs="*", help="FOLDER of wheelhouse; interpreters of try")
    parser.add_argument("--lowest", action="store_true")
    parser.add_argument("--from-wheelhouse", type=Path)
    asked = parser.parse_args()
    try:
        match asked.do:
            case "build":
                build(HERE / "dist")
            case "lock":
                lock()
            case "licences":
                LICENCES.write_text(third_party(), encoding="utf-8")
            case "wheelhouse":
                wheelhouse(Path(asked.rest[0]))
            case _:
                try_all(asked.rest or [sys.executable], lowest=asked.lowest, house=asked.from_wheelhouse)
    except UnfitError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
