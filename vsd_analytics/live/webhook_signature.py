"""Signatures of webhooks by the Standard Webhooks specification 1.0 (github.com/standard-webhooks/standard-webhooks).

A receiver that knows the secret can see that an event is ours, whole and new; libraries for it exist in most languages.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac

from vsd_analytics.errors import UsageError

VARIABLE = "VSD_WEBHOOK_SECRET"
PREFIX = "whsec_"
BYTES_MIN, BYTES_MAX = 24, 64


def secret_of(text: str) -> bytes:
    """Return the key of a secret such as `whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw`.

    Raises:
        UsageError: E101, it is no such secret.
    """
    try:
        key = base64.b64decode(text.strip().removeprefix(PREFIX), validate=True)
    except (binascii.Error, ValueError):
        key = b""
    if not BYTES_MIN <= len(key) <= BYTES_MAX:
        raise UsageError(
            f"{VARIABLE} is no secret for signing",
            why=f"it needs {BYTES_MIN} to {BYTES_MAX} bytes in base64, with {PREFIX} before them or not",
            fix=f'{VARIABLE}="{PREFIX}$(openssl rand -base64 32)"',
        )
    return key


def signature_headers(body: bytes, *, key: bytes, at_s: int) -> dict[str, str]:
    """Return the three headers of a signed event.

    Args:
        body: The event as it is sent.
        key: The key that the receiver has, too.
        at_s: Seconds since 1970 of this try: receivers refuse what is some minutes old.

    Returns:
        `webhook-id`, the same in each try of an event; `webhook-timestamp`; `webhook-signature` (`signature`).
    """
    event_id = f"evt_{hashlib.blake2b(body, digest_size=16).hexdigest()}"
    signed = signature(event_id, at_s=at_s, body=body, key=key)
    return {"webhook-id": event_id, "webhook-timestamp": str(at_s), "webhook-signature": signed}


def signature(event_id: str, *, at_s: int, body: bytes, key: bytes) -> str:
    """Return "v1," and the base64 of HMAC-SHA256 over id, timestamp and body with dots between."""
    signed = f"{event_id}.{at_s}.".encode() + body
    return f"v1,{base64.b64encode(hmac.digest(key, signed, 'sha256')).decode()}"
