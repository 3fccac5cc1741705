"""Passwords of a broker and of cameras: from the environment, or the first line of a file, never from vsd.toml."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from vsd_analytics.config.camera_source import PLACEHOLDER, password_variable
from vsd_analytics.errors import LiveError, Where
from vsd_analytics.site.model import Camera


def password_in(path: Path | None, *, variable: str, environ: Mapping[str, str], whose: str) -> str | None:
    """Return a password: the environment's variable, else the first line of a file, else None.

    Args:
        path: The file; None = none is named.
        variable: Name in the environment.
        environ: The environment.
        whose: What the password is of, for the error.

    Raises:
        LiveError: E704, the file cannot be read or is empty.
    """
    if variable in environ:
        return environ[variable]
    if path is None:
        return None
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        why = error.strerror or type(error).__name__
    except UnicodeDecodeError:
        why = "it is no text"
    else:
        if lines and lines[0]:
            return lines[0]
        why = "its first line is empty"
    raise LiveError(
        f"the password of {whose} cannot be read",
        code="E704",
        where=Where(str(path)),
        why=why,
        fix=f"put it on the first line, readable by this user only (chmod 600), or set {variable}",
    )


def source_password(camera: Camera, *, environ: Mapping[str, str]) -> str | None:
    """Return the password of a camera's source; None where its source needs none.

    Raises:
        LiveError: E704, it needs one and there is none, or it cannot be read.
    """
    source = camera.source
    if source is None or (source.username is None and PLACEHOLDER not in source.address):
        return None
    variable = password_variable(camera.camera_id)
    whose = f"the source of camera {camera.camera_id!r}"
    password = password_in(source.password_file, variable=variable, environ=environ, whose=whose)
    if password is None:
        raise LiveError(
            f"{whose} has a login and no password",
            code="E704",
            fix=f'source_password_file = "secrets/{camera.camera_id}-password" (chmod 600), or set {variable}',
        )
    return password
