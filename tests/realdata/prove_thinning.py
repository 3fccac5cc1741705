"""Counts the violations of street scenes whole and with every k-th annotation only, through store and warehouse.

Run `VSD_REALDATA=... python tests/realdata/prove_thinning.py`; the table stands in docs/statistics.md. Each scene is
ingested from its file, once as it is (2.5 annotations a second) and once for each of the k phases of every k-th.
"""

from __future__ import annotations

import gzip
import os
import tempfile
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path

from vsd_analytics.ingest.adapter import IngestOptions
from vsd_analytics.ingest.pipeline import ingest
from vsd_analytics.settings import Settings
from vsd_analytics.site import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import open_warehouse

FPS = {"seq_eth": 15.0, "seq_hotel": 25.0, "zara01": 25.0}
STEP = 3
_OBSMAT = ("frame", "track_id", "x_m", "z", "y_m", "vx", "vz", "vy")
_START = 1_767_258_000_000  # 2026-01-01 09:00 UTC
_DAY = date(2026, 1, 1)


@dataclass(frozen=True)
class Count:
    """What the marts say of one recording: frame interval, all episodes, and those that are violations."""

    interval_ms: int
    n_episodes: int
    n_violations: int


def thinned(path: Path, *, step: int, phase: int) -> str:
    """Return the lines of every `step`-th annotated frame, from number `phase` on."""
    lines = [line for line in gzip.decompress(path.read_bytes()).decode().splitlines() if line.strip()]
    frames = sorted({float(line.split()[0]) for line in lines})
    kept = set(frames[phase::step])
    return "".join(f"{line}\n" for line in lines if float(line.split()[0]) in kept)


def count(root: Path, path: Path, *, fps: float, step: int = 1, phase: int = 0) -> Count:
    """Return what is counted of a scene's every `step`-th annotation; `root` is an empty folder."""
    file = root / "obsmat.txt"
    file.write_text(thinned(path, step=step, phase=phase))
    site = Site(
        "site", "Site", "UTC", root / "project",
        floors=(Floor("floor", "Floor"),),
        cameras=(Camera("street", "Street", "floor"),),
        settings=Settings().with_values({"pseudonyms": False}),
    )  # fmt: skip
    options = IngestOptions(format="positions", columns=_OBSMAT, fps=fps, start=_START)
    result = ingest(site, [file], options, now=datetime(2026, 11, 20, tzinfo=UTC))
    if any(s.error for s in result.sources):
        raise ValueError(result)
    with open_warehouse(site, _DAY, _DAY) as warehouse:
        rows = warehouse.rows(
            "select (select max(interval_ms) from camera_days) as interval_ms, "
            "(select count(*) from episodes) as n_episodes, (select count(*) from violations) as n_violations"
        )
    return Count(**{k: int(v) for k, v in rows[0].items()})


def measure(folder: Path, scene: str, *, step: int = STEP) -> tuple[Count, list[Count]]:
    """Return the counts of a scene as it is, and of each phase of every `step`-th annotation."""
    path = folder / scene / "obsmat.txt.gz"
    found = []
    for phase in (None, *range(step)):
        with tempfile.TemporaryDirectory() as root:
            every = {} if phase is None else {"step": step, "phase": phase}
            found.append(count(Path(root), path, fps=FPS[scene], **every))
    return found[0], found[1:]


def main() -> None:
    """Print the table: the bar's rate (every third), and others."""
    folder = Path(os.environ["VSD_REALDATA"]) / "eth_ucy"
    print("| frames/s | scene | episodes, whole | thinned, by phase | violations, whole | thinned, by phase | change |")
    print("|---|---|---|---|---|---|---|")
    for step in (2, 3, 4, 5):
        whole_sum = thin_sum = 0.0
        for scene in FPS:
            whole, thin = measure(folder, scene, step=step)
            changes = [c.n_violations / whole.n_violations - 1 for c in thin]
            whole_sum, thin_sum = whole_sum + whole.n_violations, thin_sum + sum(c.n_violations for c in thin) / step
            print(
                f"| {1000 / thin[0].interval_ms:.2f} | {scene} | {whole.n_episodes} "
                f"| {', '.join(str(c.n_episodes) for c in thin)} | {whole.n_violations} "
                f"| {', '.join(str(c.n_violations) for c in thin)} | {', '.join(f'{x:+.1%}' for x in changes)} |"
            )
        print(f"| {2.5 / step:.2f} | all, phases pooled | | | {whole_sum:.0f} | {thin_sum:.1f} ",
              f"| {thin_sum / whole_sum - 1:+.1%} |")  # fmt: skip


if __name__ == "__main__":
    main()
