"""The checks of `vsd doctor` for live operation: the listener's heartbeat, the broker and its configuration."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from vsd_analytics.doctor.finding import Finding
from vsd_analytics.errors import LiveError
from vsd_analytics.live.mqtt import CONNECT_S, SESSION_MIN_S, WINDOW, connect_properties, make_client, password_of
from vsd_analytics.live.single_instance import is_alive
from vsd_analytics.live.status import CANNOT_STORE, CLOCKS_DISAGREE, read_status
from vsd_analytics.site.model import Broker, Site

USUAL_CONFIG = Path("/etc/mosquitto/mosquitto.conf")
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")
SLOW_SHARE = 0.05
"""More pictures than this that the detector had no time for deserve a look."""
OLD_STATUS_S = 60.0
START_S = 30.0
"""A listener that is starting for less has not written its state yet."""
AUTOSAVE_MAX_S = 10
_ANSWER_S = 2.0
_UNITS = {"h": 1 / 24, "d": 1.0, "w": 7.0, "m": 30.0, "y": 365.0}
_ONCE = frozenset({"persistence_location", "persistence_file", "pid_file", "log_timestamp_format"})
"""Settings that Mosquitto 2 refuses to find twice, also when the second is in an included file."""
_PRINT = "vsd listen --broker-config"
_EXPLAINED = {CLOCKS_DISAGREE: "E708", CANNOT_STORE: "E304"}


def examine_live(
    site: Site, *, now: datetime, environ: Mapping[str, str], has_config: bool = False
) -> Iterator[Finding]:
    """Check the listener and the broker; yields nothing where nothing listens.

    Args:
        site: The site.
        now: The clock.
        environ: Environment, for the password.
        has_config: The user named the broker's configuration. Else the usual file is checked, when the broker is on
            this machine and the file is of a broker with its port.
    """
    status = read_status(site.root)
    if site.broker is None:
        if status is not None or any(camera.source is not None for camera in site.cameras):
            yield from examine_listener(site, status=status, now=now)
        return
    yield from examine_listener(site, status=status, now=now)
    yield from _examine_broker(site.broker, environ=environ)
    if not has_config and site.broker.host in LOCAL_HOSTS and USUAL_CONFIG.exists():
        ports = ports_of(USUAL_CONFIG)
        if ports is None or site.broker.port in ports:
            yield from examine_config(USUAL_CONFIG)
        else:
            shown = ", ".join(map(str, sorted(ports)))
            detail = f"{USUAL_CONFIG} is of another broker: it listens on {shown}, vsd.toml names {site.broker.port}"
            yield Finding("broker configuration", "note", detail, "vsd doctor --broker-config with the file of yours")


def _examine_sources(sources: Mapping[str, Mapping[str, Any]]) -> Iterator[Finding]:
    """Check the pictures of `vsd engine live`: is each camera there, and is the detector fast enough."""
    for camera_id, source in sources.items():
        state, n_kept, n_slow = source.get("state"), int(source.get("pictures", 0)), int(source.get("too_slow", 0))
        if state != "on":
            detail = f"{state}: {source.get('error') or 'no picture yet'}; the time is missing in vsd coverage"
            yield Finding(
                f"pictures of {camera_id}", "needs you", detail, f"look at the camera, and source of {camera_id}"
            )
        elif n_slow > SLOW_SHARE * n_kept:
            detail = f"{n_slow:,} of {n_kept:,} pictures came while the detector was busy, and are missing"
            fix = "a smaller --hz, a smaller model, or --provider cuda"
            yield Finding(f"pictures of {camera_id}", "needs you", detail, fix)


def examine_listener(site: Site, *, status: Mapping[str, Any] | None, now: datetime) -> Iterator[Finding]:
    """Check a heartbeat (`read_status`): is the listener running, connected, able to store; is a camera silent."""
    name = "listener"
    has_sources = any(camera.source is not None for camera in site.cameras)
    command = "vsd engine live --detector model.onnx" if has_sources else "vsd listen"
    if status is None:
        yield Finding(name, "note", "it never ran in this project", f"{command} (as a service: docs/live.md)")
        return
    try:
        at = datetime.fromisoformat(status["at"])
        state, error, pid = status["state"], status["error"], status["pid"]
        counts = f"{status['received']:,} messages received, {sum(status['stored'].values()):,} records stored"
        rejected, cameras, lag_s = dict(status["rejected"]), dict(status["cameras"]), status["lag_s"]
        last = {camera: datetime.fromisoformat(c["last"]) for camera, c in cameras.items()}
        n_missing = sum(c["missing"] or 0 for c in cameras.values())
        n_qos0 = int(status["qos0"])
        since = status["connected_since"] or status["started"]
        sources = dict((status.get("engine") or {}).get("cameras", {}))
    except (KeyError, TypeError, ValueError, AttributeError):
        yield Finding(name, "needs you", "status/listen.json cannot be read", "remove it; a listener writes it again")
        return
    if state == "stopped":
        yield Finding(name, "note", f"stopped since {status['at']}: {counts}", command)
        return
    if not is_alive(pid):
        yield Finding(name, "needs you", f"process {pid} is gone since about {status['at']}", command)
        return
    if (now - at).total_seconds() > OLD_STATUS_S:
        yield Finding(name, "needs you", f"process {pid} wrote no status since {status['at']}", "look at its log")
        return
    for_s = (now - datetime.fromisoformat(status["started"])).total_seconds()
    if state == "starting" and not error and for_s < START_S:
        yield Finding(name, "note", f"starting since {status['started']}", "ask again in half a minute")
    elif error or state != "listening":
        fix = f"vsd explain {_EXPLAINED.get(state, 'E701')}"
        yield Finding(name, "needs you", f"{state}: {error or 'no reason given'} ({counts})", fix)
    else:
        lag = "" if lag_s is None else f", newest message {lag_s:,.0f} s old"
        yield Finding(name, "ok", f"listening since {since}: {counts}{lag}")
    yield from _examine_sources(sources)
    silence = timedelta(seconds=site.settings.coverage_gap_s)
    today = at.astimezone(site.zone).date()
    there = [c for c in site.cameras if c.is_there(today, today)]
    silent = [c.camera_id for c in there if c.camera_id not in last or at - last[c.camera_id] > silence]
    if silent and (at - datetime.fromisoformat(status["started"])) > silence:
        detail = f"silent for more than {silence.total_seconds() / 60:g} min: {', '.join(silent)}"
        yield Finding("live cameras", "needs you", detail, "look at their engines: each processed frame is a message")
    if rejected:
        reasons = ", ".join(f"{n:,} {reason}" for reason, n in sorted(rejected.items()))
        detail = f"{reasons}, since {status['started']}"
        yield Finding("live records in quarantine", "note", detail, "vsd quarantine list")
    if n_missing:
        yield Finding("live messages", "note", f"{n_missing:,} numbers skipped; exactly: vsd coverage")
    if n_qos0:
        fix = "let the engine publish with QoS 1"
        yield Finding("live delivery", "needs you", f"{n_qos0:,} messages came with QoS 0, which may be lost", fix)


@dataclass(frozen=True, slots=True)
class BrokerReply:
    """What a broker grants to a client that connects.

    Attributes:
        error: Why there is no connection; None = there was one.
        session_s: Seconds it stores a session that asked for a day or more.
        qos_max: Highest quality of service it takes.
        keeps_retained: Whether it stores retained messages, such as the heartbeat.
        version: Its version from $SYS; None = unknown.
    """

    error: str | None = None
    session_s: int = SESSION_MIN_S
    qos_max: int = 2
    keeps_retained: bool = True
    version: str | None = None


def _examine_broker(broker: Broker, *, environ: Mapping[str, str]) -> Iterator[Finding]:
    name = f"broker {broker.host}:{broker.port}"
    try:
        answer = ask(broker, password=password_of(broker, environ=environ))
    except LiveError as error:
        yield Finding(name, "needs you", f"{error.what}: {error.why}", error.fix)
        return
    if answer.error is not None:
        fix = "is it running, are address, user and certificates right? more: vsd explain E701"
        yield Finding(name, "needs you", f"no connection: {answer.error}", fix)
        return
    shown = f"answers{f' ({answer.version})' if answer.version else ''}"
    if answer.qos_max < 1:
        yield Finding(name, "needs you", f"{shown}, but accepts only QoS 0: it may lose messages", _PRINT)
    elif answer.session_s < SESSION_MIN_S:
        detail = f"{shown}, but keeps sessions for {answer.session_s:,} s only: longer absences lose messages"
        yield Finding(name, "needs you", detail, _PRINT)
    else:
        yield Finding(name, "ok", f"{shown}, QoS {answer.qos_max}, keeps sessions for a day or more")
    if broker.status_topic is not None and not answer.keeps_retained:
        detail = "it stores no retained messages: only clients that listen already get the heartbeat"
        yield Finding(name, "note", detail)
    if broker.password_file is not None and broker.password_file.stat().st_mode & 0o077:
        fix = f"chmod 600 {broker.password_file}"
        yield Finding("password of the broker", "needs you", "others on this machine may read it", fix)


def ask(broker: Broker, *, password: str | None, timeout_s: float = _ANSWER_S) -> BrokerReply:
    """Connect for a moment with a client id of its own, read what the broker grants, and leave no session behind.

    Args:
        broker: The broker.
        password: Password of its user.
        timeout_s: Longest time to wait for answers, after the connection of at most `CONNECT_S`.

    Raises:
        LiveError: E705, the certificates cannot be used.
    """
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    client = make_client(broker, client_id=f"vsd-doctor-{os.urandom(4).hex()}", password=password)
    client.connect_timeout = min(CONNECT_S, timeout_s)
    heard: dict[str, Any] = {}

    def on_connect(_client: Any, _data: Any, _flags: Any, reason: Any, properties: Any) -> None:
        heard["reason"], heard["properties"] = reason, properties
        if not reason.is_failure:
            client.subscribe("$SYS/broker/version")

    def on_message(_client: Any, _data: Any, message: Any) -> None:
        heard["version"] = message.payload.decode("utf-8", "replace")[:100]

    client.on_connect, client.on_message = on_connect, on_message
    client.on_disconnect = lambda *_: heard.setdefault("gone", True)
    try:
        properties = connect_properties(session_s=SESSION_MIN_S, window=WINDOW)
        client.connect(broker.host, broker.port, keepalive=30, clean_start=True, properties=properties)
        until_s = time.monotonic() + timeout_s
        while "version" not in heard and "gone" not in heard and time.monotonic() < until_s:
            client.loop(0.05)
            if "properties" in heard:
                until_s = min(until_s, time.monotonic() + 0.5)
    except (OSError, ValueError) as error:
        return BrokerReply(error=str(error))
    if "reason" not in heard:
        return BrokerReply(error="it does not answer like an MQTT 5 broker")
    if heard["reason"].is_failure:
        return BrokerReply(error=str(heard["reason"]))
    leaving = Properties(PacketTypes.DISCONNECT)  # type: ignore[no-untyped-call]
    leaving.SessionExpiryInterval = 0
    client.disconnect(properties=leaving)
    client.loop(0.05)
    granted = heard["properties"]
    return BrokerReply(
        session_s=getattr(granted, "SessionExpiryInterval", SESSION_MIN_S),
        qos_max=getattr(granted, "MaximumQoS", 2),
        keeps_retained=bool(getattr(granted, "RetainAvailable", 1)),
        version=heard.get("version"),
    )


def examine_config(path: Path) -> Iterator[Finding]:
    """Check that a mosquitto.conf has the settings without which the broker may lose messages."""
    name = f"broker configuration {path}"
    try:
        values = parse_config(path)
    except (OSError, UnicodeDecodeError) as error:
        yield Finding(name, "needs you", f"it cannot be read: {error}", "name the right file: --broker-config FILE")
        return
    faults = [*repeated(path), *config_faults(values)]
    if faults:
        yield Finding(name, "needs you", "; ".join(faults), f"{_PRINT}  prints what to write and why")
    else:
        yield Finding(name, "ok", "sessions and queues survive a restart")
    if values.get("autosave_on_changes") == "true":
        detail = "autosave_on_changes writes the whole queue at every message: a long queue makes the broker slow"
        yield Finding(name, "note", f"{detail} (docs/live.md)")


def repeated(path: Path) -> list[str]:
    """Return a sentence for each setting that a broker accepts once only and that its files have more than once.

    Raises:
        OSError: A file cannot be read.
        UnicodeDecodeError: It is not text.
    """
    counts = Counter(key for key, _ in _settings(path) if key in _ONCE)
    return [f"{key} is there {n} times: the broker does not start" for key, n in sorted(counts.items()) if n > 1]


def ports_of(path: Path) -> set[int] | None:
    """Return the ports that a mosquitto.conf listens on, 1883 where it names none; None when it cannot be read."""
    try:
        named = [value.split()[0] for key, value in _settings(path) if key in ("listener", "port") and value]
    except (OSError, UnicodeDecodeError):
        return None
    return {int(port) for port in named if port.isdecimal() and int(port)} or {1883}


def parse_config(path: Path) -> dict[str, str]:
    """Return the settings of a mosquitto.conf and of its `include_dir`; of several with one name the last.

    Raises:
        OSError: A file cannot be read.
        UnicodeDecodeError: It is not text.
    """
    return dict(_settings(path))


def _settings(path: Path) -> Iterator[tuple[str, str]]:
    """Yield key and value of each line, those of included files in their place."""
    for line in path.read_text(encoding="utf-8").splitlines():
        key, _, value = line.strip().partition(" ")
        if not key or key.startswith("#"):
            continue
        yield key, value.strip()
        if key == "include_dir":
            for included in sorted(Path(value.strip()).glob("*.conf")):
                yield from _settings(included)


def config_faults(values: Mapping[str, str]) -> list[str]:
    """Return what is wrong with the settings of a mosquitto.conf, as sentences."""
    faults = []
    if values.get("persistence", "false") != "true":
        faults.append("persistence is not true: a restart forgets sessions and queues")
    else:
        if "persistence_location" not in values:
            faults.append("persistence_location is missing: the broker saves where it was started, if it may")
        interval = _whole(values.get("autosave_interval", "1800"))
        on_changes = values.get("autosave_on_changes", "false") == "true"
        if interval is None or not 1 <= interval <= (1 if on_changes else AUTOSAVE_MAX_S):
            unit = "changes" if on_changes else "s"
            faults.append(f"autosave_interval is {interval} {unit}: a crash loses what came since (1 is recommended)")
    queued = _whole(values.get("max_queued_messages", "1000"))
    flying = _whole(values.get("max_inflight_messages", "20"))
    if queued != 0:
        faults.append(f"max_queued_messages is {queued}: what comes beyond while the listener is away is lost (0)")
    if _whole(values.get("max_queued_bytes", "0")) != 0:
        faults.append("max_queued_bytes is set: what comes beyond it is lost (0)")
    if flying is None or 0 < flying < WINDOW:
        faults.append(f"max_inflight_messages is {flying}: the listener catches up slowly (0, or {WINDOW} and more)")
    expiry = values.get("persistent_client_expiration")
    if expiry is not None and _days(expiry) < 1:
        faults.append(f"persistent_client_expiration is {expiry}: absences beyond it lose messages (1d or more)")
    return faults


def _whole(text: str) -> int | None:
    return int(text) if text.isdecimal() else None


def _days(text: str) -> float:
    number = _whole(text[:-1])
    return 0.0 if number is None else number * _UNITS.get(text[-1:], 0.0)
