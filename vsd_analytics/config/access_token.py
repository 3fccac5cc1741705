"""Tokens that keep others out of what listens on the network: from the environment, or a file made at first start."""

from __future__ import annotations

import ipaddress
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from vsd_analytics.store import durable

MIN_CHARS: Final = 16


class UnsafeTokenError(Exception):
    """The token cannot be used; the argument says why, in words."""


def access_token(path: Path, *, variable: str, environ: Mapping[str, str]) -> str:
    """Return a token; the file is made when it is missing, and only its owner may read it, from its first moment on.

    Args:
        path: The file.
        variable: Name of the environment's variable, which goes first.
        environ: The environment.

    Raises:
        UnsafeTokenError: It cannot be read, has fewer than 16 characters, or others than printable ASCII.
    """
    try:
        if variable in environ:
            token = environ[variable]
        else:
            if not path.exists():
                durable.make_dirs(path.parent)
                durable.publish(path, f"{secrets.token_urlsafe(32)}\n".encode(), is_private=True)
            token = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UnsafeTokenError(str(error)) from None
    if len(token) < MIN_CHARS or not (token.isascii() and token.isprintable()) or " " in token:
        raise UnsafeTokenError(f"it must have {MIN_CHARS} or more printable ASCII characters, without blanks")
    return token


def is_loopback(host: str) -> bool:
    """Return whether a host name or address is this machine only."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
