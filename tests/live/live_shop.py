"""A shop of three cameras for `vsd engine live`: two videos in a loop, and one camera of the network."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
from engine.blob_video import CAMERA, COLOURS, SIZE, Walk
from engine.detector_models import blob_model
from live.picture_server import CameraServer, looped_video

from vsd_analytics.store.store import Store

VSD = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
HEAD = '[site]\nid = "shop"\nname = "Riverside Store"\ntimezone = "Europe/Rome"\n'
NEAR_S, CYCLE_S = 12, 60


def pair_walks(shift_s: float) -> list[Walk]:
    """Return one who stands, and one who comes to 1.2 m once a minute, stays for 12 s and goes to 4.5 m."""

    def comes(time_s: float) -> tuple[float, float]:
        away = abs((time_s + shift_s) % CYCLE_S - CYCLE_S / 2)
        return (-1.0 + 1.2 + 1.1 * min(max(away - NEAR_S / 2, 0.0), 3.0), 8.0)

    return [Walk(lambda t: (-1.0, 8.0 + 0.3 * np.sin(t / 5))), Walk(comes)]


def live_shop(
    root: Path,
    camera: CameraServer | None = None,
    *,
    seconds: float = 60,
    hz: float = 1.0,
    keys: str = "",
    walks: list[Walk] | None = None,
) -> list[str]:
    """Make the project; return its cameras. Each is on a floor of its own.

    Args:
        root: Project folder.
        camera: The camera of the network; None = all are videos.
        seconds: Length of the videos.
        hz: Pictures a second of each camera.
        walks: Who walks in all videos; None = two people who meet once a minute, at another second for each.
        keys: More lines of the last camera.
    """
    root.mkdir(parents=True, exist_ok=True)
    names = ["cam-1", "cam-2", "cam-3"]
    text = HEAD
    for k, name in enumerate(names):
        source = f"{name}.avi"
        if camera is not None and k == 2:
            source = camera.address
        else:
            looped_video(root / source, lambda _, k=k: walks or pair_walks(7 * k), seconds=seconds, seed=k)
        np.savetxt(root / f"{name}.txt", CAMERA.homography())
        text += f'[[floor]]\nid = "floor-{k + 1}"\nname = "Floor {k + 1}"\n[[camera]]\nid = "{name}"\nname = "{name}"\n'
        text += f'floor = "floor-{k + 1}"\nhz = {hz}\npicture_px = [320, 240]\nsource = "{source}"\n'
        text += f'homography = "{name}.txt"\n'
    (root / "vsd.toml").write_text(text + keys)
    blob_model(root / "blobs.onnx", COLOURS[:3], SIZE)
    return names


def engine_live(root: Path, *words: str, before: list[str] | None = None, **environ: str) -> subprocess.Popen[str]:
    """Start `vsd engine live` in a process of its own."""
    arguments = [*(before or []), *VSD, "-C", str(root), "engine", "live", "--detector", str(root / "blobs.onnx")]
    return subprocess.Popen(
        [*arguments, "--status-every", "0.5", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environ},  # a fresh copy of the program would cache itself
    )


def status_of(root: Path) -> dict[str, Any]:
    """Return the heartbeat; empty before the first."""
    try:
        return dict(json.loads((root / "status" / "listen.json").read_text()))
    except (OSError, ValueError):
        return {}


def stored_instants(root: Path) -> dict[str, list[int]]:
    """Return the instants of all stored frames by camera, UTC milliseconds in order, after a fold."""
    store = Store(root / "store", site_id="shop")
    store.fold()
    names = [str(p.path) for p in store.parts("frames")]
    if not names:
        return {}
    query = "select camera_id, list(epoch_ms(ts) order by ts) from read_parquet($n) group by 1 order by 1"
    return dict(duckdb.execute(query, {"n": names}).fetchall())


def vsd_json(root: Path, *words: str) -> dict[str, Any]:
    """Return what a command prints with --json."""
    done = subprocess.run([*VSD, "-C", str(root), *words, "--json"], capture_output=True, text=True, check=False)
    return dict(json.loads(done.stdout))
