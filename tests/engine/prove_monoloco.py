"""Makes the table of Monoloco's places in docs/methods: `python tests/engine/prove_monoloco.py`, about a minute."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engine.monoloco_output import write_monoloco
from engine.simulated_people import SIZE, Array, SimulatedCamera, simulate

from vsd_analytics.engine.monoloco_files import read_monoloco
from vsd_analytics.engine.monoloco_method import floor_of_calibration, floor_of_people, locate_monoloco
from vsd_analytics.errors import CalibrationError

CAMERAS = ((3.0, 10.0), (5.0, 10.0), (3.0, 20.0), (5.0, 20.0), (5.0, 30.0), (8.0, 30.0), (8.0, 45.0))
SEEDS = range(6)


def row(height_m: float, tilt_deg: float) -> str:
    """Return the line of a camera."""
    camera = SimulatedCamera(height_m=height_m, tilt_deg=tilt_deg, roll_deg=1.5)
    level, people, given, tilts, covered = [], [], [], [], []
    for seed in SEEDS:
        scene = simulate(camera, seed=seed, n_tracks=60, seconds=20)
        with tempfile.TemporaryDirectory() as folder:
            write_monoloco(Path(folder) / "m", scene, spread=0.05, seed=seed)
            found = read_monoloco(Path(folder) / "m")
        calibrated = floor_of_calibration(camera.homography(), picture_px=SIZE, name="")
        seen = locate_monoloco(found, calibrated, within_m=np.inf)
        true = np.linalg.norm(scene.xy[seen.a] - scene.xy[seen.b], axis=1)
        some = (true > 1) & (true < 6)
        assert seen.sd_m is not None
        covered.append(np.mean(np.abs(seen.distance_m - true)[some] < 1.645 * seen.sd_m[some]))

        def error(xy: Array, a: Array = seen.a, b: Array = seen.b, t: Array = true, some: Array = some) -> float:
            return float(np.median(np.abs(np.linalg.norm(xy[a] - xy[b], axis=1)[some] / t[some] - 1)))

        level.append(error(found.xyz[:, [0, 2]]))
        given.append(error(found.xyz @ calibrated.turn.T))
        try:
            turned = floor_of_people(found)
        except CalibrationError:
            continue
        people.append(error(found.xyz @ turned.turn.T))
        tilts.append(abs(np.degrees(np.arccos(np.clip(turned.turn[1, 2], -1, 1))) - tilt_deg))
    by_people = f"{np.median(people):.1%}" if people else "–"
    tilt = f"{max(tilts):.1f}" if tilts else "–"
    numbers = f"{np.median(level):.1%} | {by_people} | {np.median(given):.1%} | {tilt} | {len(SEEDS) - len(tilts)} of 6"
    return f"| {height_m:g} m, {tilt_deg:g} degrees | {numbers} | {np.mean(covered):.2f} |"


def main() -> None:
    """Print the table."""
    print(
        "| camera | as if level | tilt from people | tilt from calibration | worst tilt, degrees | refused | in 90 % |"
    )
    print("|---|---|---|---|---|---|---|")
    for camera in CAMERAS:
        print(row(*camera))


if __name__ == "__main__":
    main()
