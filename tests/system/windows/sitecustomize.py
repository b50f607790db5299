"""Makes a Python process meet what it would meet on Windows; Python imports a module of this name when it starts.

`DBBSTATION_AS_ON_WINDOWS` names the folder in which files behave so. Two parts:

- *Names*: the program sees `os`, `signal`, `select`, `subprocess` and others without the names that typeshed declares for other systems
  alone, and cannot import modules that Windows lacks. The standard library and packages keep theirs: they have Windows code of their own.
- *Files*: a file that is open, or may only be read, is neither replaced nor deleted; a folder cannot be opened; names that Windows
  forbids cannot be made (Microsoft, "Naming Files, Paths, and Namespaces"; "System Error Codes").
"""

from __future__ import annotations

import ast
import builtins
import errno
import fcntl
import importlib
import importlib.util
import io
import os
import re
import shutil
import stat
import struct
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

VARIABLE = "DBBSTATION_AS_ON_WINDOWS"
PROGRAM = "dbbstation"
PARTLY = ("os", "select", "signal", "socket", "subprocess", "sys", "time")
LACKING = frozenset({"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"})
BINARY = 0x8000
"""O_BINARY on Windows; on Linux this bit (O_LARGEFILE) changes nothing."""

_HELD, _DENIED, _EXISTS, _FORBIDDEN_NAME = 32, 5, 183, 123


# Names.


@cache
def declared(module: str, platform: str) -> frozenset[str]:
    spec = importlib.util.find_spec("mypy")
    stubs = Path(spec.origin).parent / "typeshed" / "stdlib"
    path = next(one for one in (stubs / f"{module}.pyi", stubs / module / "__init__.pyi") if one.exists())
    return frozenset(_names(ast.parse(path.read_text(encoding="utf-8")).body, platform))


def _names(body: list[ast.stmt], platform: str):
    for node in body:
        if isinstance(node, ast.If):
            branch = node.body if _holds(node.test, platform) else node.orelse
            yield from _names(branch, platform)
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (target.id for target in targets if isinstance(target, ast.Name))


def _holds(test: ast.expr, platform: str) -> bool:
    found = type("sys", (), {"platform": platform, "version_info": sys.version_info})
    return bool(eval(compile(ast.Expression(test), "stub", "eval"), {"sys": found, "TYPE_CHECKING": False}))  # noqa: S307 - tests of typeshed


class Seen(ModuleType):
    """A module as the program sees it."""

    def __init__(self, real: ModuleType, more: dict[str, object]) -> None:
        super().__init__(real.__name__)
        self.__dict__.update(_real=real, _more=more, _before={})
        self.__dict__["_gone"] = declared(real.__name__, "linux") - declared(real.__name__, "win32")

    def __getattr__(self, name: str) -> object:
        if name in self._more:
            return self._more[name]
        if name in self._gone:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r} on Windows")
        return getattr(self._real, name)

    def __setattr__(self, name: str, value: object) -> None:
        self._before.setdefault(name, getattr(self._real, name))
        setattr(self._real, name, value)

    def __delattr__(self, name: str) -> None:
        setattr(self._real, name, self._before.pop(name))


def _locking(handle: int, mode: int, count: int) -> None:
    """`msvcrt.locking` by open file description locks (fcntl(2), F_OFD_SETLK), which conflict within a process too."""
    assert mode == _Msvcrt.LK_NBLCK
    place = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, os.lseek(handle, 0, os.SEEK_CUR), count, 0)
    try:
        fcntl.fcntl(handle, 37, place)
    except OSError:
        raise PermissionError(errno.EACCES, "Permission denied") from None


class _Msvcrt(ModuleType):
    LK_NBLCK = 2
    locking = staticmethod(_locking)


def _open_in_binary(path, flags, *more, **named):
    assert flags & BINARY or path == os.devnull or os.path.isdir(path), f"{path} would be opened as text"
    return os.open(path, flags, *more, **named)


def take_names_away() -> None:
    more = {"os": {"O_BINARY": BINARY, "open": _open_in_binary}}
    seen = {name: Seen(importlib.import_module(name), more.get(name, {})) for name in PARTLY}
    seen["msvcrt"] = _Msvcrt("msvcrt")
    real = builtins.__import__

    def import_(name, globals=None, locals=None, fromlist=(), level=0):  # noqa: A002 - as Python calls it
        if level == 0 and str((globals or {}).get("__name__", "")).partition(".")[0] == PROGRAM:
            if name in LACKING:
                raise ModuleNotFoundError(f"No module named {name!r} on Windows")
            if name in seen:
                return seen[name]
        return real(name, globals, locals, fromlist, level)

    builtins.__import__ = import_


# Files.


class Files:
    """Functions of `os` that treat files below a folder as Windows would.

    Args:
        root: the folder; it holds the number of every process that sees files so.
    """

    def __init__(self, root: Path) -> None:
        self._peers = root / "peers"
        self._peers.mkdir(exist_ok=True)
        (self._peers / str(os.getpid())).touch()
        self._inside = os.path.realpath(root) + os.sep
        self._real = {name: getattr(os, name) for name in ("rename", "replace", "unlink", "open", "mkdir")}
        self._open = io.open

    def install(self) -> None:
        os.rename, os.replace, os.open, os.mkdir = self.rename, self.replace, self.open, self.mkdir
        os.unlink = os.remove = self.unlink
        builtins.open = io.open = self.open_file
        shutil._use_fd_functions = False  # Windows has none of them

    def rename(self, source, target, **named):
        """No open file is renamed, and no other one takes its name."""
        self._not_held(self._whole(source))
        self._allowed(self._whole(target))
        if self._whole(target).startswith(self._inside) and os.path.lexists(target):
            _refuse(errno.EEXIST, _EXISTS, target)
        self._real["rename"](source, target, **named)

    def replace(self, source, target, **named):
        """No file that is open, or may only be read, is replaced."""
        self._not_held(self._whole(source))
        self._not_held(self._whole(target), for_good=True)
        self._allowed(self._whole(target))
        self._real["replace"](source, target, **named)

    def unlink(self, path, *, dir_fd=None):
        """No file that is open, or may only be read, is deleted."""
        self._not_held(self._whole(path, dir_fd), for_good=True)
        self._real["unlink"](path, dir_fd=dir_fd)

    def open(self, path, flags, mode=0o777, *, dir_fd=None):
        whole = self._whole(path, dir_fd)
        if flags & os.O_CREAT:
            self._allowed(whole)
        if whole.startswith(self._inside) and os.path.isdir(whole):
            _refuse(errno.EACCES, _DENIED, path)
        return self._real["open"](path, flags, mode, dir_fd=dir_fd)

    def open_file(self, file, mode="r", *more, **named):
        """As `open`, for Python's files."""
        if not isinstance(file, int) and set(mode) & set("wxa"):
            self._allowed(self._whole(file))
        return self._open(file, mode, *more, **named)

    def mkdir(self, path, mode=0o777, *, dir_fd=None):
        self._allowed(self._whole(path, dir_fd))
        self._real["mkdir"](path, mode, dir_fd=dir_fd)

    def _whole(self, path, dir_fd=None):
        base = "" if dir_fd is None else os.readlink(f"/proc/self/fd/{dir_fd}")
        folder, name = os.path.split(os.path.join(base, os.fsdecode(path)))
        return os.path.join(os.path.realpath(folder or "."), name)

    def _not_held(self, path, *, for_good=False):
        if not path.startswith(self._inside) or not os.path.lexists(path):
            return
        if any(target == path or target.startswith(path + os.sep) for target in self._opened()):
            _refuse(errno.EACCES, _HELD, path)
        if for_good and os.path.isfile(path) and not os.stat(path).st_mode & stat.S_IWUSR:
            _refuse(errno.EACCES, _DENIED, path)

    def _opened(self):
        for process in os.listdir(self._peers):
            with _quiet():
                for number in os.listdir(f"/proc/{process}/fd"):
                    with _quiet():
                        yield os.readlink(f"/proc/{process}/fd/{number}")

    def _allowed(self, path):
        name = os.path.basename(path)
        if path.startswith(self._inside) and (_SIGNS.search(name) or _DEVICES.fullmatch(name)):
            _refuse(errno.EINVAL, _FORBIDDEN_NAME, path)


_SIGNS = re.compile(r'[<>:"|?*\x00-\x1f]|[. ]$')
_DEVICES = re.compile(r"(?i)(con|prn|aux|nul|com[1-9]|lpt[1-9])(\..*)?")


def _refuse(code, number, path):
    error = OSError(code, os.strerror(code), os.fspath(path))
    error.winerror = number
    raise error


class _quiet:  # noqa: N801 - as `contextlib.suppress`, which would be imported for this alone
    def __enter__(self) -> None: ...

    def __exit__(self, kind, *_) -> bool:
        return kind is not None and issubclass(kind, OSError)


if os.environ.get(VARIABLE):
    take_names_away()
    Files(Path(os.environ[VARIABLE])).install()
