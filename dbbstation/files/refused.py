"""Refusals of the operating system in words, with remedies."""

from __future__ import annotations

import errno

_REMEDIES = {
    errno.ENOSPC: "free room on the disk, then try again",
    errno.EDQUOT: "free room in your share of the disk, then try again",
    errno.EROFS: "name a place that can be written: this one can only be read",
    errno.EIO: "check the disk and its cable, and copy what is on it before you go on",
    errno.EACCES: "check the permissions of file and folder",
    errno.EPERM: "check the permissions of file and folder",
    errno.EMFILE: "close other programs: too many files are open",
    errno.ENAMETOOLONG: "shorten the name",
    errno.ENFILE: "close other programs: too many files are open",
}

_OTHERWISE = "check that the folder exists, its permissions and the disk"


LONGEST_ON_WINDOWS = 259
"""Longest path that Windows allows by default, in characters (Microsoft, "Maximum Path Length Limitation")."""


def refusal(error: OSError) -> tuple[str, str]:
    """Return a reason, such as `no space left on device`, and a remedy."""
    if hasattr(error, "winerror") and len(str(error.filename or "")) > LONGEST_ON_WINDOWS:
        return "the path is too long for Windows", "shorten it, or set LongPathsEnabled in the registry of Windows"
    return (error.strerror or str(error)).lower(), _REMEDIES.get(error.errno or 0, _OTHERWISE)


def in_a_sentence(error: OSError) -> str:
    """Return reason and remedy as one sentence."""
    why, remedy = refusal(error)
    return f"{error.filename or 'the output, or a file'}: {why}; {remedy}"
