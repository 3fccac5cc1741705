"""The parts of `vsd.toml` that the live branch reads: `[mqtt]`, `[[alarm]]` and `[alarms]`."""

from __future__ import annotations

from collections.abc import Collection
from typing import TypeVar, get_args
from urllib.parse import urlsplit

from vsd_analytics.config.reader import TableReader
from vsd_analytics.errors import nearest
from vsd_analytics.site.model import AlarmDelivery, AlarmKind, AlarmRule, Area, Broker, Camera

_KINDS: tuple[AlarmKind, ...] = get_args(AlarmKind)

_TOPICS = ("vsd/+/frames",)
_CLIENT_ID = "vsd-listen"

T = TypeVar("T")


def read_broker(root: TableReader) -> Broker | None:
    """Return the broker of `[mqtt]`, or None when there is none."""
    if root.raw("mqtt") is None:
        return None
    table = root.inner("mqtt")
    is_tls = table.flag("tls") or False
    ca_file, cert_file, key_file = (table.file(f"{n}_file", example=f'"tls/{n}.pem"') for n in ("ca", "cert", "key"))
    host = table.text("host", example='"localhost"', required=True)
    port = table.number("port", minimum=1, maximum=65535, unit="", example="1883", whole=True)
    topics = read_topics(table, example='["vsd/+/frames"]') or _TOPICS
    status_topic = _topic(table, "status_topic", example='"vsd/shop/status"')
    figures_topic = _topic(table, "figures_topic", example='"vsd/shop/today"')
    is_home_assistant = table.flag("home_assistant") or False
    if is_home_assistant and "figures_topic" not in table.values:
        table.missing("figures_topic", '"vsd/shop/today"', why="home_assistant announces the figures published there")
    if (cert_file is None) != (key_file is None):
        one, other = ("cert_file", "key_file") if key_file is None else ("key_file", "cert_file")
        table.missing(other, f'"tls/{other.removesuffix("_file")}.pem"', why=f"{one} is of no use alone")
    broker = Broker(
        host=host or "localhost",
        port=int(port) if port is not None else (8883 if is_tls else 1883),
        topics=topics,
        client_id=table.text("client_id", example='"vsd-listen"') or _CLIENT_ID,
        username=table.text("username", example='"vsd"'),
        password_file=table.file("password_file", example='"secrets/mqtt-password"'),
        is_tls=is_tls,
        ca_file=ca_file,
        cert_file=cert_file,
        key_file=key_file,
        status_topic=status_topic,
        figures_topic=figures_topic,
        is_home_assistant=is_home_assistant,
    )
    table.close()
    return broker


def _topic(table: TableReader, key: str, *, example: str) -> str | None:
    """Return a topic to publish to, or None."""
    topic = table.text(key, example=example)
    if topic is not None and any(c in topic for c in "+#"):
        table.fault(key, f"{topic!r} is no topic: + and # are for filters", fix=f"{key} = {example}")
    return topic


def read_topics(table: TableReader, *, example: str) -> tuple[str, ...]:
    """Return the topic filters of `topics`; none is an empty tuple."""
    topics = table.texts("topics", example=example)
    for topic in topics:
        if not is_topic_filter(topic):
            table.fault(
                "topics",
                f"{topic!r} is no topic filter",
                why="+ stands for one whole level, # for all that follow at the end",
                fix=f"topics = {example}",
            )
    return topics


def is_topic_filter(text: str) -> bool:
    """Tell whether a text is an MQTT topic filter: `+` only as a whole level, `#` only as the last one."""
    levels = text.split("/")
    return (
        0 < len(text.encode()) <= 65_535
        and "\0" not in text
        and all(level == "+" or "+" not in level for level in levels)
        and all("#" not in level for level in levels[:-1])
        and (levels[-1] == "#" or "#" not in levels[-1])
    )


def read_alarms(root: TableReader, *, areas: Collection[Area], cameras: Collection[Camera]) -> tuple[AlarmRule, ...]:
    """Return the rules of `[[alarm]]`."""
    rules: dict[str, AlarmRule] = {}
    for table in root.each("alarm"):
        alarm_id = table.id("id", example='"queue-too-full"')
        kind = table.word("kind", _KINDS, example="gathering", required=True)
        if alarm_id in rules:
            table.fault("id", f"two alarms have the id {alarm_id!r}", code="E125", fix="give one of them another id")
        for_s = table.number("for_s", minimum=0, maximum=86400, unit="seconds", example="60")
        if "for_s" not in table.values:
            table.missing("for_s", "60", why="an alarm tells of what lasts, not of single frames")
        for key, is_used, why in (
            ("area", kind != "silence", "a camera is silent as a whole: name it in cameras"),
            ("people", kind == "gathering", "only a gathering has a number of people"),
            ("between_groups", kind == "contact", "only contacts can be those between groups"),
        ):
            if kind is not None and not is_used and key in table.values:
                table.fault(key, f"{table.label} is a {kind} and has no {key}", why=why, fix=f"take the line {key} out")
        rule = AlarmRule(
            alarm_id=alarm_id or "",
            kind=kind or "gathering",
            for_s=for_s or 0.0,
            area_id=_known(table, "area", {a.area_id for a in areas}),
            camera_ids=tuple(
                c
                for c in table.texts("cameras", example='["cam-1"]')
                if _is_known(table, "cameras", c, {c.camera_id for c in cameras})
            ),
            n_people=int(
                table.number("people", minimum=2, maximum=10_000, unit="people", example="4", whole=True) or 3
            ),
            cooldown_s=_or(table.number("cooldown_s", minimum=0, maximum=86400, unit="seconds", example="300"), 300.0),
            is_open_only=_or(table.flag("open_only"), True),
            is_between_groups=_or(table.flag("between_groups"), True),
        )
        table.close()
        if alarm_id is not None:
            rules[alarm_id] = rule
    return tuple(rules.values())


def read_delivery(table: TableReader, *, has_broker: bool) -> AlarmDelivery:
    """Return where `[alarms]` sends them; its other keys are settings."""
    webhook = table.text("webhook", example='"https://example.org/hook"')
    if webhook is not None and not _is_web_address(webhook):
        table.fault("webhook", f"{webhook!r} is no http or https address", fix='webhook = "https://example.org/hook"')
    topic = table.text("topic", example='"vsd/shop/alarms"')
    if topic is not None and any(c in topic for c in "+#"):
        table.fault("topic", f"{topic!r} has a wildcard: events go to one topic", fix='topic = "vsd/shop/alarms"')
    if topic is not None and not has_broker:
        table.fault("topic", "[alarms] topic needs a broker", fix='add [mqtt] with host = "localhost"')
    return AlarmDelivery(webhook=webhook, topic=topic)


def _is_web_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0 and " " not in text
    except ValueError:
        return False


def _or(value: T | None, default: T) -> T:
    return default if value is None else value


def _known(table: TableReader, key: str, known: Collection[str]) -> str | None:
    value = table.text(key, example='"checkout-queue"')
    return value if value is not None and _is_known(table, key, value, known) else None


def _is_known(table: TableReader, key: str, value: str, known: Collection[str]) -> bool:
    if value in known:
        return True
    near = nearest(value, known)
    table.fault(
        key,
        f"{table.label} {key}: {value!r} is not described in vsd.toml",
        code="E125",
        fix=f"did you mean {near!r}?" if near else f"known: {', '.join(sorted(known)) or 'none'}",
    )
    return False
