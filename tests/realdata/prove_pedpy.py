"""Compares crossings of counting lines with PedPy's N-t curve and flow (extra `bench`), person by person, on HERMES.

Run `VSD_REALDATA=... python tests/realdata/prove_pedpy.py`; a summary is in docs/lines.md. PedPy gives a crossing
the frame in which it is complete; ours is an instant between two frames, so its next frame is compared. With `tracks`
as argument, PedPy computes speed, density and flow at a line, the fundamental diagram and the pair distribution twice:
of the recording, and of the tracks that a project has stored of it.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pedpy

from vsd_analytics.api.tracks import tracks
from vsd_analytics.site.lines import Line

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parent)]
from prove_lines import FRAME_MS, Recording, disturbed, hermes  # noqa: E402
from warehouse.small_projects import T0, Person, make_site, open_days, put  # noqa: E402


def crossings(records: Sequence[Person], lines: tuple[Line, ...]) -> pd.DataFrame:
    """Return line, person and instant (milliseconds from the start) of each crossing in the fact."""
    with tempfile.TemporaryDirectory() as root:
        site = replace(make_site(Path(root)), lines=lines)
        put(site, records)
        with open_days(site) as warehouse:
            rows = warehouse.rows("select line_id, track_id, ts_ms from line_crossings")
    return pd.DataFrame([(r["line_id"], int(r["track_id"].partition("#")[0]), r["ts_ms"] - T0) for r in rows])


RATE_HZ = 1000 / FRAME_MS["hermes"]
EVERY = 32
"""Voronoi cells and distances of pairs are computed in every 32nd frame, every two seconds."""
LINE = pedpy.MeasurementLine([(-2.0, -1.0), (5.0, -1.0)])
AREA = pedpy.MeasurementArea([(-2.0, -2.0), (5.0, -2.0), (5.0, 0.0), (-2.0, 0.0)])
FLOOR = pedpy.WalkableArea([(-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (-30.0, 30.0)])


def stored(recording: Recording) -> pedpy.TrajectoryData:
    """Return the tracks that a project has stored of a recording, as docs/python.md hands them to PedPy."""
    with tempfile.TemporaryDirectory() as root:
        site = make_site(Path(root), cameras=recording.cameras)
        put(site, list(disturbed(recording, lost=0.0, cut_s=None)))
        found = tracks(site, "cam", first=date(2026, 11, 9), last=date(2026, 11, 9))
    table = found.df()
    table["id"] = table["track_id"].str.partition("#")[0].astype(int)
    return in_order(table[["id", "frame", "x", "y"]], found.frame_rate_hz)


def of_recording(recording: Recording, *, digits: int) -> pedpy.TrajectoryData:
    """Return the recording itself, its metres with so many digits; frames begin at 0, as in stored tracks."""
    frames = np.round(recording.ms / FRAME_MS["hermes"]).astype(int)
    x_m, y_m = np.round(recording.xy.T, digits)
    table = pd.DataFrame({"id": recording.who, "frame": frames - frames.min(), "x": x_m, "y": y_m})
    return in_order(table, RATE_HZ)


def in_order(table: pd.DataFrame, rate_hz: float) -> pedpy.TrajectoryData:
    """Return tracks in one order, so that what PedPy draws at random is the same of both."""
    return pedpy.TrajectoryData(data=table.sort_values(["frame", "id"], ignore_index=True), frame_rate=rate_hz)


def numbers(trajectory: pedpy.TrajectoryData) -> dict[str, np.ndarray]:
    """Return what PedPy computes of tracks, by name."""
    speed = pedpy.compute_individual_speed(
        traj_data=trajectory, frame_step=5, compute_velocity=True,
        speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED,
    )  # fmt: skip
    nt, crossed = pedpy.compute_n_t(traj_data=trajectory, measurement_line=LINE)
    flow = pedpy.compute_flow(
        nt=nt, crossing_frames=crossed, individual_speed=speed, delta_frame=160, frame_rate=trajectory.frame_rate
    )
    few = in_order(trajectory.data[trajectory.data["frame"] % EVERY == 0], trajectory.frame_rate)
    cells = pedpy.compute_individual_voronoi_polygons(
        traj_data=few, walkable_area=FLOOR, cut_off=pedpy.Cutoff(radius=1.0, quad_segments=3)
    )
    species = pedpy.compute_species(
        individual_voronoi_polygons=cells, measurement_line=LINE, trajectory_data=trajectory, frame_step=25
    )
    at_line = {"individual_voronoi_polygons": cells, "measurement_line": LINE, "species": species}
    line_speed = pedpy.compute_line_speed(**at_line, individual_speed=speed)
    line_flow = pedpy.compute_line_flow(**at_line, individual_speed=speed)
    density, met = pedpy.compute_voronoi_density(individual_voronoi_data=cells, measurement_area=AREA)
    mean = pedpy.compute_voronoi_speed(
        traj_data=few, individual_speed=speed, individual_voronoi_intersection=met, measurement_area=AREA
    )
    at = np.unique(met["frame"])
    np.random.seed(0)  # noqa: NPY002 (PedPy draws from it)
    _, pairs = pedpy.compute_pair_distribution_function(traj_data=few, radius_bin_size=0.2, randomisation_stacking=1)
    return {
        "frame of crossing": crossed.sort_values("id")["frame"].to_numpy(),
        "flow, 1/s": flow["flow"].to_numpy(),
        "speed of the flow, m/s": flow["mean_speed"].to_numpy(),
        "speed at the line, m/s": line_speed["speed"].to_numpy(),
        "density at the line, 1/m²": pedpy.compute_line_density(**at_line)["density"].to_numpy(),
        "flow at the line, 1/(m s)": line_flow["flow"].to_numpy(),
        "density (fundamental diagram), 1/m²": density.set_index("frame")["density"].loc[at].to_numpy(),
        "speed (fundamental diagram), m/s": mean.set_index("frame")["speed"].loc[at].to_numpy(),
        "pair distribution": pairs,
    }


def compare_tracks() -> None:
    """Print, for each number of all runs: how many, their mean, and the largest difference of stored tracks.

    Differences are from the recording in millimetres, as the store has it, and from the recording with all digits.
    """
    found: dict[str, list[list[np.ndarray]]] = {}
    for recording in hermes(Path(os.environ["VSD_REALDATA"])):
        of_each = [numbers(of) for of in (stored(recording), *(of_recording(recording, digits=d) for d in (3, 9)))]
        for name, mine in of_each[0].items():
            found.setdefault(name, []).append([mine, *(of[name] for of in of_each[1:])])
        print(f"{recording.name}: {len(of_each[0]['frame of crossing'])} people", flush=True)
    print("| number | n | mean, recording | stored tracks | largest difference, recording in mm | in all digits |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, runs in found.items():
        assert all(len({len(of) for of in run}) == 1 for run in runs), name
        mine, rounded, exact = (np.concatenate([run[k] for run in runs]) for k in range(3))
        assert (np.isnan(mine) == np.isnan(exact)).all(), name
        off = " | ".join(f"{np.nanmax(np.abs(mine - of)):.2g}" for of in (rounded, exact))
        print(f"| {name} | {len(mine):,} | {np.nanmean(exact):.5f} | {np.nanmean(mine):.5f} | {off} |")


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
    compare_tracks() if "tracks" in sys.argv[1:] else main()
