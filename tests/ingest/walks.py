"""People who walk through a hall of 20 x 12 m, as rows of tables in any dress; seeded."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

import numpy as np

START = datetime(2025, 11, 25, 9, tzinfo=UTC)  # no month has a number 25
VSD_TOML = """\
[site]
id = "hall"
name = "Hall"
timezone = "Europe/Berlin"
opening = {{ mon-sat = "08:00-20:00" }}

[[floor]]
id = "ground"
name = "Ground floor"
plan = "plan.svg"
plan_m_per_px = 0.1
"""
CAMERA = """
[[camera]]
id = "{id}"
name = "{id}"
picture_px = [1280, 720]
{more}
"""
PLAN = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 120"></svg>'


@dataclass(frozen=True)
class Step:
    """One record of a walk: instant, id, place in metres."""

    at: datetime
    track: int
    x_m: float
    y_m: float


@cache
def walks(*, n_people: int = 6, seconds: int = 60, hz: float = 1.0, seed: int = 15) -> tuple[Step, ...]:
    """Return the records of people who walk at about 1 m/s and turn at the walls, in order of time."""
    random = np.random.default_rng(seed)
    places = random.uniform((2, 2), (18, 10), size=(n_people, 2))
    headings = random.uniform(0, 2 * np.pi, n_people)
    steps = []
    for frame in range(int(seconds * hz)):
        for person in range(n_people):
            at = START + timedelta(seconds=frame / hz)
            x, y = places[person].round(3)
            steps.append(Step(at, person + 1, float(x), float(y)))
            headings[person] += random.normal(0, 0.2)
            places[person] += random.uniform(0.002, 0.02, 2) * random.choice((-1, 1), 2)  # nobody has a place twice
            moved = places[person] + np.array((np.cos(headings[person]), np.sin(headings[person]))) / hz
            if not (0.5 < moved[0] < 19.5 and 0.5 < moved[1] < 11.5):
                headings[person] += np.pi
            else:
                places[person] = moved
    return tuple(steps)


def project(folder: Path, *cameras: str, more: str = "") -> Path:
    """Write a project of a hall with a plan and cameras, by default cam-1 on the clock UTC."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plan.svg").write_text(PLAN, encoding="utf-8")
    described = [CAMERA.format(id=camera, more=more or 'clock = "UTC"') for camera in cameras or ("cam-1",)]
    (folder / "vsd.toml").write_text(VSD_TOML.format() + "".join(described), encoding="utf-8")
    return folder
