"""Counts the violations of real recordings whole and with every k-th frame only, through store and warehouse.

Run `VSD_REALDATA=... python tests/realdata/prove_thinning.py`; the tables are in docs/methods. Each street
scene is ingested from its file, once as it is (2.5 annotations a second) and once for each of the k phases of every
k-th; three hours of a shopping centre likewise (one frame a second).
"""

from __future__ import annotations

import gzip
import os
import tempfile
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path

from prove_atc import FILES, OPTIONS

from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import open_warehouse

FPS = {"seq_eth": 15.0, "seq_hotel": 25.0, "zara01": 25.0}
STEP = 3
_OBSMAT = ("frame", "track_id", "x_m", "z", "y_m", "vx", "vz", "vy")
_START = 1_767_258_000_000  # 2026-01-01 09:00 UTC
_DAY, _ATC_DAY = date(2026, 1, 1), date(2012, 10, 24)


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


def count(root: Path, text: str, options: IngestOptions, *, day: date = _DAY) -> Count:
    """Return what is counted of a file of positions; `root` is an empty folder."""
    file = root / "positions.txt"
    file.write_text(text)
    site = Site(
        "site", "Site", "UTC", root / "project",
        floors=(Floor("floor", "Floor"),),
        cameras=(Camera("street", "Street", "floor"),),
        settings=Settings().with_values({"pseudonyms": False}),
    )  # fmt: skip
    result = ingest(site, [file], options, now=datetime(2026, 11, 20, tzinfo=UTC))
    if any(s.error for s in result.sources):
        raise ValueError(result)
    with open_warehouse(site, day, day) as warehouse:
        rows = warehouse.rows(
            "select (select max(interval_ms) from camera_days) as interval_ms, "
            "(select count(*) from episodes) as n_episodes, (select count(*) from violations) as n_violations"
        )
    return Count(**{k: int(v) for k, v in rows[0].items()})


def measure(folder: Path, scene: str, *, step: int = STEP) -> tuple[Count, list[Count]]:
    """Return the counts of a scene as it is, and of each phase of every `step`-th annotation."""
    path = folder / scene / "obsmat.txt.gz"
    options = IngestOptions(format="positions", columns=_OBSMAT, fps=FPS[scene], start=_START)
    found = []
    for n, phase in ((1, 0), *((step, k) for k in range(step))):
        with tempfile.TemporaryDirectory() as root:
            found.append(count(Path(root), thinned(path, step=n, phase=phase), options))
    return found[0], found[1:]


def shopping_centre(folder: Path, *, step: int) -> tuple[Count, list[Count]]:
    """Return the counts of three hours of a shopping centre, and of each phase of every `step`-th second of them."""
    texts = [gzip.decompress((folder / name).read_bytes()).decode() for name in FILES]
    seconds = [(int(float(line.split(",")[0])), line) for text in texts for line in text.splitlines() if line.strip()]
    found = []
    for n, phase in ((1, 0), *((step, k) for k in range(step))):
        with tempfile.TemporaryDirectory() as root:
            kept = "".join(f"{line}\n" for second, line in seconds if second % n == phase)
            found.append(count(Path(root), kept, OPTIONS, day=_ATC_DAY))
    return found[0], found[1:]


def main() -> None:
    """Print the tables: streets at the bar's rate (every third) and others, the shopping centre at half and a third."""
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
    print("\n| frames/s | violations, whole | thinned, by phase | change | pooled |")
    print("|---|---|---|---|---|")
    for step in (2, 3):
        whole, thin = shopping_centre(folder.parent / "atc", step=step)
        changes = [c.n_violations / whole.n_violations - 1 for c in thin]
        print(
            f"| {1 / step:.2f} | {whole.n_violations} | {', '.join(str(c.n_violations) for c in thin)} "
            f"| {', '.join(f'{x:+.1%}' for x in changes)} | {sum(changes) / step:+.1%} |"
        )


if __name__ == "__main__":
    main()
