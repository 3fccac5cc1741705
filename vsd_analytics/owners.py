"""Whose a file is: files that may not be read are no missing files, and words for those of another user."""

from __future__ import annotations

import os
import shlex
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final

_LOOK: Final = "check the path, its permissions and the free space"


def user_name(uid: int) -> str:
    """Return the name of a user, or the number where the machine knows no name."""
    with suppress(ImportError, KeyError):
        import pwd  # Windows has none

        return pwd.getpwuid(uid).pw_name
    return str(uid)


def other_owner(path: Path) -> str | None:
    """Return whose a file or folder is; None = of the user who runs this, or not to be known."""
    try:
        uid = path.stat().st_uid
    except OSError:
        return None
    return None if not hasattr(os, "geteuid") or uid == os.geteuid() else user_name(uid)


def is_there(path: Path) -> bool:
    """Return whether something is at a path.

    Where the system refuses to look, nothing is known about the path. From Python 3.14 on, `Path.exists` says False
    then, and `glob` finds nothing in a folder that may not be read.

    Args:
        path: A file or folder.

    Raises:
        PermissionError: A folder on the way to it may not be entered, or it is a folder that may not be read.
    """
    try:
        about = path.stat()
    except PermissionError:
        raise
    except (OSError, ValueError):
        return False
    if stat.S_ISDIR(about.st_mode):
        os.scandir(path).close()
    return True


def denied(error: OSError, path: str | Path | None = None) -> tuple[str | None, str]:
    """Return why the system refuses a file or folder, as far as its owner tells, and what to do.

    Args:
        error: What the system said.
        path: The file that may not be read or written; None = what the error names.
    """
    refused = Path(os.fsdecode(path or error.filename or ""))
    there = next((p for p in (refused, *refused.parents) if os.path.lexists(p)), refused)
    owner = other_owner(there)
    if owner is None or not isinstance(error, PermissionError):
        return None, _LOOK
    me = user_name(os.geteuid())
    if there.is_dir():
        why = f"the folder {there} belongs to {owner}, and this runs as {me}"
        return why, f"use a folder of {me}, or run the command as {owner}"
    fix = f"as root: chown {me}: {shlex.quote(str(there))}"
    if owner != "root":
        fix += f"; or run the command as {owner}"
    return f"the file belongs to {owner}, and this runs as {me}", fix
