"""Live soak: a day at ten times the published load through a real Mosquitto, brokers restarted, listeners killed.

    python tests/live/prove_soak.py --hours 24 --seed 1

18 cameras send a message a second with 15 people each, in accelerated time: their instants fill the last `--hours` up
to now, and they come as fast as `--rate` says. Meanwhile the listener is killed (kill -9) and the broker restarted
(SIGTERM) at random moments. Then sent must equal stored, each once. Then the broker is killed (kill -9) during further
sending: it may lose what it had acknowledged, and the gaps in the stored numbers must be exactly that.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from local_broker import MOSQUITTO, WHY_NOT, Mosquitto, write_project
from soak_producer import Camera, Load, produce
from soak_report import Event, Life, Outcome, print_report
from soak_truth import gaps, lost, stored_sums, tracks_stored, tracks_true, truth_sums

N_CAMERAS, N_PEOPLE, STEP_MS = 18, 15, 1000
CHUNK = 1800
STATUS_EVERY_S = 0.5
CAUGHT_UP_S = 1.0
PATIENCE_S = 20.0
SECOND_PART_S = 30.0
QUIET_S = 3.0


class Producer:
    """Sends in a thread of its own, and remembers when the broker had acknowledged how much."""

    def __init__(self, load: Load, *, port: int) -> None:
        self.load = load
        self.cameras = [Camera(i, port) for i in range(load.n_cameras)]
        self.log: list[tuple[float, list[int]]] = []
        self.error: BaseException | None = None
        self._thread: threading.Thread | None = None

    @property
    def n_acknowledged(self) -> int:
        return sum(c.n_acknowledged for c in self.cameras)

    @property
    def is_running(self) -> bool:
        if self.error is not None:
            raise self.error
        return self._thread is not None and self._thread.is_alive()

    def start(self, *, end: int, rate: float) -> None:
        self._thread = threading.Thread(target=self._run, args=(end, rate), daemon=True)
        self._thread.start()

    def _run(self, end: int, rate: float) -> None:
        try:
            for first in range(self.cameras[0].n_acknowledged, end, CHUNK):
                stop = min(first + CHUNK, end)
                for camera in self.cameras:
                    data, camera.starts = self.load.packets(camera.index, first, stop)
                    camera.data, camera.first = memoryview(data), first
                produce(self.cameras, end=stop, rate=rate)
        except BaseException as error:
            self.error = error

    def note(self) -> None:
        self.log.append((time.monotonic(), [c.n_acknowledged for c in self.cameras]))

    def acknowledged_s(self, camera: int, seq: int) -> float:
        """Return when the broker had not yet acknowledged message `seq` of a camera for the last time."""
        return next((at for at, n in reversed(self.log) if n[camera] <= seq), self.log[0][0])


class Listeners:
    """Keeps one listener running, and looks at what it says."""

    def __init__(self, project: Path, *, late_s: int) -> None:
        self.project = project
        self.lives: list[Life] = []
        self.process: subprocess.Popen[bytes] | None = None
        self.last_seq: dict[str, int] = {}
        self._changed = (-1, 0.0)
        self._environ = {**os.environ, "VSD_LIVE_LATE_MAX_S": str(late_s)}
        self._vsd = [sys.executable, "-c", "from vsd_analytics.cli import main; main()", "-C", str(project), "listen"]

    def start(self) -> None:
        with (self.project.parent / "listener.log").open("ab") as log:
            command = [*self._vsd, "--status-every", str(STATUS_EVERY_S)]
            self.process = subprocess.Popen(command, env=self._environ, stdout=log, stderr=log)
        self.lives.append(Life(self.process.pid, time.monotonic()))
        self._changed = (-1, time.monotonic())

    def look(self) -> dict[str, Any] | None:
        """Return the newest status of the running listener, None before its first."""
        life = self.lives[-1]
        assert self.process is None or self.process.poll() is None, "the listener ended by itself"
        try:
            for line in Path(f"/proc/{life.pid}/status").read_text().splitlines():
                if line.startswith("VmHWM:"):
                    life.peak_mb = max(life.peak_mb, int(line.split()[1]) * 1024 / 1e6)
            told: dict[str, Any] = json.loads((self.project / "status" / "listen.json").read_text())
        except (OSError, ValueError):
            return None
        if told.get("pid") != life.pid:
            return None
        life.status = told
        for name, camera in told["cameras"].items():
            self.last_seq[name] = max(camera["last_seq"], self.last_seq.get(name, -1))
        if told["received"] != self._changed[0]:
            self._changed = (told["received"], time.monotonic())
        if told["fold"] is not None and told["fold"]["error"] is None:
            life.folds[told["folds"]] = (told["fold"]["took_s"], told["fold"]["peak_mb"])
        return told

    @property
    def quiet_s(self) -> float:
        """Return for how long the running listener has received nothing."""
        return time.monotonic() - self._changed[1]

    def kill(self, *, with_fold: bool) -> None:
        assert self.process is not None
        self.look()
        pid = self.process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split() if with_fold else []
        self.process.kill()
        self.process.wait()
        for child in children:
            with suppress(ProcessLookupError):
                os.kill(int(child), signal.SIGKILL)
        self._ended("kill -9 with its fold" if children else "kill -9")

    def stop(self) -> float:
        """End with SIGTERM; return how long that took."""
        assert self.process is not None
        began_s = time.monotonic()
        self.process.terminate()
        code = self.process.wait(30)
        took_s = time.monotonic() - began_s
        assert code == 0, f"the listener ended with exit code {code}"
        self.lives[-1].status = json.loads((self.project / "status" / "listen.json").read_text())
        assert self.lives[-1].status["state"] == "stopped"
        self._ended("SIGTERM, exit code 0")
        return took_s

    def _ended(self, how: str) -> None:
        self.process = None
        self.lives[-1].end, self.lives[-1].ended_s = how, time.monotonic()

    def once(self) -> None:
        """Take what is left, and fold."""
        subprocess.run([*self._vsd, "--once"], env=self._environ, check=True, capture_output=True, timeout=600)


def lag_s(told: dict[str, Any] | None, producer: Producer, listeners: Listeners) -> float | None:
    """Return for how long the broker has had a message that no listener is known to have stored, at the worst camera.

    What a killed listener stored after its last heartbeat is not known of; it is known that nothing is left when
    nothing has come for a while.
    """
    if told is None or told["connected_since"] is None:
        return None
    if not producer.is_running and listeners.quiet_s > QUIET_S:
        return 0.0
    worst_s = 0.0
    for camera in producer.cameras:
        last = listeners.last_seq.get(f"cam-{camera.index + 1}", -1)
        if last + 1 < camera.n_acknowledged:
            worst_s = max(worst_s, time.monotonic() - producer.acknowledged_s(camera.index, last + 1))
    return worst_s


def run_part(
    producer: Producer, listeners: Listeners, broker: Mosquitto, events: list[Event], *, end: int, rate: float
) -> float:
    """Send up to `end` of each camera while the faults happen; return the seconds until all is acknowledged."""
    began_s, first, shown_s = time.monotonic(), producer.n_acknowledged, 0.0
    total = end * producer.load.n_cameras - first
    waiting = sorted(events, key=lambda e: e.at_share)
    current: Event | None = None
    producer.start(end=end, rate=rate)
    while True:
        time.sleep(0.1)
        producer.note()
        told = listeners.look()
        lag, now_s = lag_s(told, producer, listeners), time.monotonic()
        share = (producer.n_acknowledged - first) / total
        is_up = told is not None and told["connected_since"] is not None
        if current is not None and current.recovered_s is None and now_s - current.at_s > 1.0:
            current.worst_lag_s = max(current.worst_lag_s, lag if lag is not None else now_s - current.at_s)
            if is_up and lag is not None and lag < CAUGHT_UP_S:
                current.recovered_s = now_s - current.at_s
        is_calm = current is None or current.recovered_s is not None or now_s - current.at_s > PATIENCE_S
        if waiting and share >= waiting[0].at_share and is_calm and is_up:
            current = waiting.pop(0)
            current.at_s = now_s
            strike(current, listeners, broker)
        if now_s - shown_s > 10:
            shown_s = now_s
            lag_shown = "-" if lag is None else f"{lag:.1f} s"
            line = f"{now_s - began_s:6.0f} s  {share:6.1%} sent, lag {lag_shown}, {len(waiting)} faults to come"
            print(line, file=sys.stderr, flush=True)
        is_over = current is None or current.recovered_s is not None or now_s - current.at_s > PATIENCE_S
        if not producer.is_running and not waiting and lag == 0.0 and is_over:
            return time.monotonic() - began_s


def strike(event: Event, listeners: Listeners, broker: Mosquitto) -> None:
    if event.kind == "broker kill -9, listener away":
        listeners.kill(with_fold=False)
        time.sleep(1.5)
        broker.stop(signal.SIGKILL)
        broker.start()
        listeners.start()
    elif event.kind.startswith("listener"):
        listeners.kill(with_fold=event.kind.endswith("fold"))
        listeners.start()
    else:
        broker.stop(signal.SIGKILL if "kill" in event.kind else signal.SIGTERM)
        broker.start()


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hours", type=float, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=2000, help="messages a second")
    parser.add_argument("--listener-kills", type=int, default=20)
    parser.add_argument("--broker-restarts", type=int, default=5)
    parser.add_argument("--broker-kills", type=int, default=2)
    parser.add_argument("--folder", type=Path, help="where to work, and leave everything (default: temporary)")
    asked = parser.parse_args()
    if MOSQUITTO is None:
        print(f"skipped: {WHY_NOT}")
        return 0
    folder = asked.folder or Path(tempfile.mkdtemp(prefix="vsd-soak-"))
    shutil.rmtree(folder, ignore_errors=True)
    try:
        outcome = soak(asked, folder)
    finally:
        if asked.folder is None:
            shutil.rmtree(folder, ignore_errors=True)
    print_report(outcome)
    return 0 if outcome.is_exact and outcome.is_reported else 1


def soak(asked: argparse.Namespace, folder: Path) -> Outcome:
    chance = random.Random(asked.seed)
    n_each = int(asked.hours * 3600)
    n_more = max(600, n_each // 48)
    load = Load(N_CAMERAS, N_PEOPLE, int(time.time() * 1000) - (n_each + n_more) * STEP_MS, STEP_MS)
    broker = Mosquitto(folder / "broker").start()
    project = write_project(folder / "project", port=broker.port, n_cameras=N_CAMERAS)
    listeners = Listeners(project, late_s=n_each + n_more + 7200)
    producer = Producer(load, port=broker.port)
    kinds = [f"listener kill -9{' with fold' if i % 2 else ''}" for i in range(asked.listener_kills)]
    kinds += ["broker SIGTERM"] * asked.broker_restarts
    faults = [Event(kind, chance.uniform(0.02, 0.95)) for kind in kinds]
    kinds = ["broker kill -9" if i % 2 else "broker kill -9, listener away" for i in range(asked.broker_kills)]
    crashes = [Event(kind, chance.uniform(0.1, 0.7)) for kind in kinds]
    try:
        listeners.once()  # makes the session
        listeners.start()
        sending_s = run_part(producer, listeners, broker, faults, end=n_each, rate=asked.rate)
        sigterm_s = listeners.stop()
        listeners.once()
        truth, found = truth_sums(load, end=n_each), stored_sums(project)
        tracks = tracks_stored(project), tracks_true(load, end=n_each)
        listeners.start()
        rate = min(asked.rate, N_CAMERAS * n_more / SECOND_PART_S)
        run_part(producer, listeners, broker, crashes, end=n_each + n_more, rate=rate)
        listeners.stop()
        listeners.once()
    finally:
        if listeners.process is not None:
            listeners.process.kill()
        broker.stop(signal.SIGKILL)
    return Outcome(
        command=f"python tests/live/prove_soak.py --hours {asked.hours:g} --seed {asked.seed} --rate {asked.rate:g}",
        load=load,
        n_each=n_each,
        lives=listeners.lives,
        faults=faults,
        crashes=crashes,
        sending_s=sending_s,
        sigterm_s=sigterm_s,
        truth=truth,
        found=found,
        tracks=tracks,
        gaps=gaps(project),
        lost=lost(project, load, end=n_each + n_more),
    )


if __name__ == "__main__":
    sys.exit(main())
