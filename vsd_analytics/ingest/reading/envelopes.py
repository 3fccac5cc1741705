"""What recorders put around a message: its topic beside it, a document of a search engine, or text before the JSON.

`mosquitto_sub -v` and logs write text before each message (`site/cam-1 {"ts": ...}`). `mosquitto_sub -F %j`, Kafka
clients and dumps of Elasticsearch write an object around it. All of them become an object with the message inside, so
that a mapping can name both (`camera_id=topic`, `persons=payload.people`). Readers of one engine's messages take the
message alone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Final

_ENVELOPES: Final = (
    ("topic", "payload"),
    ("topic", "value"),
    ("_index", "_source"),
    ("stream", "log"),  # Docker
    ("__REALTIME_TIMESTAMP", "MESSAGE"),  # journald
)
"""Key of what names the stream, and key of the message."""
_BODY: Final = re.compile(b"|".join(b'"%s"' % body.encode() for _, body in _ENVELOPES))
_TEXT: Final = rb'[^{}\[\]"\x00-\x08\x0e-\x1f]*'
_BEFORE: Final = re.compile(_TEXT + rb"(?:\[" + _TEXT + rb"\]" + _TEXT + rb')*(?<=[\s:=|>,-])(?=\{\s*")')
"""Text before an object; brackets, such as those of a process number, are closed again."""
_BEFORE_MAX: Final = 1000


def as_object(line: bytes) -> dict[str, Any] | None:
    """Return the JSON object of a line, also one with text before it; None where it is none.

    A message that an envelope has as a text becomes an object, and text before an object becomes its `topic`.
    """
    before = text_before(line)
    try:
        message = json.loads(line[len(before) :])
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict):
        return None
    if before.strip():
        return {"topic": before.strip().decode("utf-8", "replace"), "payload": message}
    return with_body(message)


def text_before(line: bytes) -> bytes:
    """Return the text before the JSON object of a line; b"" where it begins with one, or has none."""
    if line[:1] == b"{":
        return b""
    match = _BEFORE.match(line, 0, _BEFORE_MAX)
    return b"" if match is None else match[0]


def unwrapped(message: Mapping[str, Any]) -> tuple[str | None, Mapping[str, Any]]:
    """Return the topic of a message and the message itself, without its envelope.

    The topic is None where there is no envelope, and where a log's line is before the message: that differs each time.
    """
    body = body_of(message)
    if body is None:
        return None, message
    topic = str(message.get("topic", " "))
    return (None if " " in topic else topic), message[body]


def body_of(message: Mapping[str, Any]) -> str | None:
    """Return the key under which an envelope has the message; None where there is no envelope."""
    return next((b for name, b in _ENVELOPES if name in message and isinstance(message.get(b), dict)), None)


def bare(line: bytes) -> bytes:
    """Return the JSON of a message without what is around it; a line that has nothing around it as it is."""
    if line[:1] == b"{" and _BODY.search(line) is None:
        return line
    envelope = as_object(line)
    message = envelope if envelope is None else unwrapped(envelope)[1]
    return line if message is None or message is envelope else json.dumps(message).encode()


def with_body(message: dict[str, Any]) -> dict[str, Any]:
    """Return an envelope with its message as an object where it is a text; other messages as they are."""
    for name, body in _ENVELOPES:
        text = message.get(body)
        if name in message and isinstance(text, str) and text.lstrip().startswith("{"):
            try:
                return {**message, body: json.loads(text)}
            except (ValueError, RecursionError):
                return message
    return message
