"""Whose a file is: words for files that belong to another user than the one who runs the command."""

from __future__ import annotations

import os
import shlex
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


def denied(path: str | Path) -> tuple[str | None, str]:
    """Return why the system refuses a file, as far as its owner tells, and what to do.

    Args:
        path: The file that may not be read or written.
    """
    owner = other_owner(Path(path))
    if owner is None or not Path(path).is_file():
        return None, _LOOK
    me = user_name(os.geteuid())
    fix = f"as root: chown {me}: {shlex.quote(str(path))}"
    if owner != "root":
        fix += f"; or run the command as {owner}"
    return f"the file belongs to {owner}, and this runs as {me}", fix
