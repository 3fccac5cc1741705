"""Who may ask the service, and how often."""

from __future__ import annotations

import base64
import binascii
import hmac
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from vsd_analytics.config.access_token import UnsafeTokenError, access_token
from vsd_analytics.errors import UsageError

VARIABLE: Final = "VSD_SERVE_TOKEN"
DESK_VARIABLE: Final = "VSD_DESK_TOKEN"
CLIENTS_MAX: Final = 4096


def token_of(root: Path, *, environ: Mapping[str, str], is_desk: bool = False) -> tuple[str, str]:
    """Return a token and where it comes from: the environment, or a file that is made at the first start.

    Args:
        root: Folder of the project; the file is `secrets/serve.token`, which only its owner may read.
        environ: The environment.
        is_desk: The token of who may write, of `secrets/desk.token`.

    Raises:
        UsageError: E101, the token is too short to keep anybody out.
    """
    variable, name = (DESK_VARIABLE, "desk.token") if is_desk else (VARIABLE, "serve.token")
    path = root / "secrets" / name
    where = variable if variable in environ else str(path)
    try:
        return access_token(path, variable=variable, environ=environ), where
    except UnsafeTokenError as error:
        raise UsageError(
            f"the token of {where} is not safe",
            why=str(error),
            fix=f"{variable}=$(openssl rand -hex 32) vsd serve{' --desk' if is_desk else ''}",
        ) from None


def is_allowed(header: str | None, *, token: str) -> bool:
    """Return whether the header `Authorization` has the token, as `Bearer` or as the password of `Basic`.

    Browsers ask for the second: any user name, the token as the password.
    """
    scheme, _, given = (header or "").partition(" ")
    given = given.strip()
    if scheme.lower() == "basic":
        try:
            given = base64.b64decode(given, validate=True).decode().partition(":")[2]
        except (binascii.Error, UnicodeDecodeError):
            return False
    elif scheme.lower() != "bearer":
        return False
    return hmac.compare_digest(given.encode(), token.encode())


class RateLimit:
    """A bucket for each client: `burst` requests at once, then `per_min` a minute.

    Args:
        per_min: Requests a minute.
        burst: Requests at once.
        clock: Seconds that pass steadily.
    """

    def __init__(self, *, per_min: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._per_s, self._burst, self._clock = per_min / 60, burst, clock
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, client: str) -> float:
        """Count a request; return 0 when it may pass, else the seconds until the next may."""
        now = self._clock()
        left, at = self._buckets.pop(client, (float(self._burst), now))
        left = min(float(self._burst), left + (now - at) * self._per_s)
        allowed = left >= 1
        self._buckets[client] = (left - 1 if allowed else left, now)
        while len(self._buckets) > CLIENTS_MAX:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1 - left) / self._per_s
