"""`source` of a camera: where its pictures come from, never with a password."""

from __future__ import annotations

import re
from typing import Final
from urllib.parse import SplitResult, parse_qsl, urlsplit

from vsd_analytics.config.reader import TableReader
from vsd_analytics.site.routes import CameraSource

SCHEMES: Final = ("rtsp", "rtsps", "http", "https")
PLACEHOLDER: Final = "{password}"
_SECRET_NAME: Final = re.compile(r"pass|pwd|secret|token|auth|key|credential", re.IGNORECASE)
_EXAMPLE: Final = '"rtsp://192.168.1.20/stream1"'


def read_camera_source(table: TableReader, camera_id: str | None) -> CameraSource | None:
    """Return the source of a `[[camera]]`, or None where it has none.

    Args:
        table: Reader of the camera.
        camera_id: Its id, for the fixes.
    """
    address = table.text("source", example=_EXAMPLE)
    username = table.text("source_username", example='"viewer"')
    password_file = table.file("source_password_file", example=f'"secrets/{camera_id or "cam-1"}-password"')
    if address is None:
        for key in ("source_username", "source_password_file"):
            if key in table.values:
                table.fault(key, f"{table.label} has {key} and no source", fix=f"source = {_EXAMPLE}")
        return None
    parts = _parts(address)
    is_network = "://" in address
    if is_network and (parts is None or parts.scheme not in SCHEMES or not parts.hostname):
        _refuse(table, "is no address of pictures", why=f"it begins with {', '.join(f'{s}://' for s in SCHEMES)}")
        return None
    if is_network and parts is not None and (why := _secret_in(parts)):
        _refuse_password(table, camera_id, parts, why=why)
        return None
    if is_network and "\n" in address:
        _refuse(table, "has a line break", why="it is one address")
        return None
    needs_password = PLACEHOLDER in address or username is not None
    for key in ("source_username", "source_password_file"):
        if key in table.values and not is_network:
            table.fault(key, f"{table.label} has {key}, and its source needs no login", fix=f"take the line {key} out")
    if is_network and password_file is not None and not needs_password:
        table.missing("source_username", '"viewer"', why="a password of nobody is of no use")
    return CameraSource(address, username, password_file)


def password_variable(camera_id: str) -> str:
    """Return the name of the environment's variable with the password of a camera's source."""
    return "VSD_SOURCE_PASSWORD_" + re.sub(r"[^A-Z0-9]", "_", camera_id.upper())


def _parts(address: str) -> SplitResult | None:
    try:
        parts = urlsplit(address)
        _ = parts.port
    except ValueError:
        return None
    return parts


def _secret_in(parts: SplitResult) -> str | None:
    """Return what of an address looks like a password; None = nothing."""
    if "@" in parts.netloc:
        return "it has a login before the @"
    for name, value in parse_qsl(f"{parts.query}&{parts.fragment}", keep_blank_values=False):
        if _SECRET_NAME.search(name) and value != PLACEHOLDER:
            return f"it has a value for {name}"
    return None


def _refuse(table: TableReader, what: str, *, why: str) -> None:
    table.mistakes.add(
        table.path,  # not the line itself: it may hold a password, and messages end in logs
        f"source of {table.label} {what}",
        code="E124",
        why=why,
        fix=f"source = {_EXAMPLE}",
    )


def _refuse_password(table: TableReader, camera_id: str | None, parts: SplitResult, *, why: str) -> None:
    name = camera_id or "cam-1"
    login = 'source_username = "USER" and ' if "@" in parts.netloc else "{password} in its place and "
    table.mistakes.add(
        table.path,
        f"source of {table.label}: a password does not belong in vsd.toml",
        code="E124",
        why=f"{why}, and the file is copied, mailed and kept in version control",
        fix=(
            f'{login}source_password_file = "secrets/{name}-password" (one line, chmod 600), '
            f"or the environment variable {password_variable(name)}"
        ),
    )
