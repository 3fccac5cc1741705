"""A real Mosquitto on a free port of this machine, with the recommended configuration, for tests and proofs."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from vsd_analytics.live.mqtt import recommended_config

MOSQUITTO = shutil.which("mosquitto") or next((p for p in ("/usr/sbin/mosquitto",) if Path(p).exists()), None)
WHY_NOT = "mosquitto is not on this machine (Debian package: mosquitto)"


class Mosquitto:
    """A broker that can be stopped, killed and started again; its sessions live in `folder`."""

    def __init__(self, folder: Path, *, extra: Sequence[str] = (), replace: dict[str, str] | None = None) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.port = free_port()
        changes = {
            "listener": f"{self.port} 127.0.0.1",
            **(replace or {}),
        }
        lines = []
        for line in recommended_config().splitlines():
            key = line.partition(" ")[0]
            lines.append(f"{key} {changes[key]}" if key in changes else line)
        self.config = folder / "mosquitto.conf"
        self.config.write_text(
            "\n".join([*lines, f"persistence_location {folder}/", *extra, f"user {os.environ.get('USER', 'root')}"])
            + "\n"
        )
        self.log = folder / "mosquitto.log"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> Mosquitto:
        assert MOSQUITTO is not None, WHY_NOT
        with self.log.open("ab") as log:
            self.process = subprocess.Popen([MOSQUITTO, "-c", str(self.config)], stdout=log, stderr=log)
        until_s = time.monotonic() + 10
        while time.monotonic() < until_s:
            with socket.socket() as s:
                if s.connect_ex(("127.0.0.1", self.port)) == 0:
                    return self
            time.sleep(0.02)
        raise AssertionError(f"mosquitto did not start: {self.log.read_text()[-500:]}")

    def stop(self, number: int = signal.SIGTERM) -> None:
        if self.process is not None:
            self.process.send_signal(number)
            self.process.wait(30)
            self.process = None


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def publish(port: int, messages: Sequence[tuple[str, bytes]], *, qos: int = 1, retain: bool = False) -> None:
    """Publish messages and return when the broker has acknowledged all of them."""
    client = paho.Client(CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
    client.connect("127.0.0.1", port)
    client.loop_start()
    try:
        for info in [client.publish(topic, payload, qos=qos, retain=retain) for topic, payload in messages]:
            info.wait_for_publish(10)
            assert info.is_published()
    finally:
        client.disconnect()
        client.loop_stop()


def frame(
    seq: int, *, camera: str = "cam-1", at: datetime | None = None, n_persons: int = 2, **other: Any
) -> tuple[str, bytes]:
    """Return topic and payload of a frame message; its instant is `seq` seconds after `at` (default: a minute ago)."""
    ts = (at or datetime.now(tz=UTC) - timedelta(seconds=60)) + timedelta(milliseconds=seq)
    persons = [{"id": str(i), "x_m": 1.0 + i + seq / 1000, "y_m": 2.0} for i in range(n_persons)]
    message = {"v": 1, "camera": camera, "ts": ts.isoformat(timespec="milliseconds"), "seq": seq, "persons": persons}
    return f"vsd/{camera}/frames", json.dumps({**message, **other}).encode()


def write_project(root: Path, *, port: int, n_cameras: int = 2, more: str = "", host: str = "127.0.0.1") -> Path:
    """Write the vsd.toml of a small site that listens to a broker on this machine."""
    root.mkdir(parents=True, exist_ok=True)
    cameras = "".join(f'[[camera]]\nid = "cam-{i + 1}"\nname = "Camera {i + 1}"\n' for i in range(n_cameras))
    root.joinpath("vsd.toml").write_text(
        '[site]\nid = "shop"\nname = "Riverside Store"\ntimezone = "Europe/Rome"\n'
        f'[[floor]]\nid = "ground"\nname = "Ground floor"\n{cameras}'
        f'[mqtt]\nhost = "{host}"\nport = {port}\n{more}'
    )
    return root
