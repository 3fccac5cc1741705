"""Compares crossings of counting lines with PedPy's N-t curve and flow (extra `bench`), person by person, on HERMES.

Run `VSD_REALDATA=... python tests/realdata/prove_pedpy.py`; a summary is in docs/lines.md. PedPy gives a crossing
the frame in which it is complete; ours is an instant between two frames, so its next frame is compared.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pedpy

from vsd_analytics.site.lines import Line

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]
from prove_lines import FRAME_MS, disturbed, hermes  # noqa: E402
from warehouse.small_projects import T0, Person, make_site, open_days, put  # noqa: E402


def crossings(records: Sequence[Person], lines: tuple[Line, ...]) -> pd.DataFrame:
    """Return line, person and instant (milliseconds from the start) of each crossing in the fact."""
    with tempfile.TemporaryDirectory() as root:
        site = replace(make_site(Path(root)), lines=lines)
        put(site, records)
        with open_days(site) as warehouse:
            rows = warehouse.rows("select line_id, track_id, ts_ms from line_crossings")
    return pd.DataFrame([(r["line_id"], int(r["track_id"].partition("#")[0]), r["ts_ms"] - T0) for r in rows])


def main() -> None:
    """Print, for each run, people through each line by both, those of the same frame, and the flow of both."""
    print("| run | line | people, ours | PedPy | same frame | people a second, ours | PedPy |")
    print("|---|---|--:|--:|--:|--:|--:|")
    for recording in hermes(Path(os.environ["VSD_REALDATA"])):
        frame_ms = FRAME_MS["hermes"]
        frames = np.round(recording.ms / frame_ms).astype(int)
        x_m, y_m = np.round(recording.xy * 1000).T / 1000
        table = pd.DataFrame({"id": recording.who, "frame": frames, "x": x_m, "y": y_m})
        trajectory = pedpy.TrajectoryData(data=table, frame_rate=1000 / frame_ms)
        lines = tuple(Line(n, n, "ground", ends, "left", "right") for n, ends in recording.lines.items())
        ours = crossings(list(disturbed(recording, lost=0.0, cut_s=None)), lines)
        for line in lines:
            mine = ours[ours[0] == line.line_id].set_index(1)[2]
            at = pedpy.MeasurementLine(list(line.points))
            _, theirs = pedpy.compute_n_t(traj_data=trajectory, measurement_line=at)
            their = theirs.set_index("id")["frame"]
            both = pd.concat([np.ceil(mine / frame_ms).rename("mine"), their.rename("their")], axis=1).dropna()
            same = int((both["mine"] == both["their"]).sum())
            frames_of_both = np.ceil(mine / frame_ms), their
            flows = [1000 * (len(f) - 1) / ((f.max() - f.min()) * frame_ms) for f in frames_of_both]
            counts = f"{len(mine)} | {len(their)} | {same} | {flows[0]:.6f} | {flows[1]:.6f}"
            print(f"| {recording.name} | {line.line_id} | {counts} |", flush=True)


if __name__ == "__main__":
    main()
