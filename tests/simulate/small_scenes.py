"""Small scenes for tests: a few people on an empty floor, with known numbers of violations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo

import msgspec
import numpy as np

from vsd_analytics.simulate.cameras import CAMERAS
from vsd_analytics.simulate.frame_messages import ENGINE, day_text
from vsd_analytics.simulate.people import simulate_day
from vsd_analytics.site.model import Point

Message = dict[str, Any]

START_MS = 1_794_211_200_000
"""2026-11-09 08:00:00 UTC, a Monday."""


def frame_message(
    camera: str,
    ts_ms: int,
    persons: Iterable[Mapping[str, Any]] = (),
    *,
    pairs: Iterable[Mapping[str, Any]] | None = None,
    seq: int | None = None,
    quality: str = "metric",
) -> dict[str, Any]:
    """Return one VSD frame message.

    Args:
        camera: Camera id.
        ts_ms: Instant, UTC milliseconds.
        persons: Objects with `id` and `x_m`, `y_m` or `u_px`, `v_px`; none = a heartbeat.
        pairs: Objects with `a`, `b`, `distance_m`; None = the engine sends no pairs.
        seq: Number of the frame; None leaves it out.
        quality: "metric", "body" or "relative".
    """
    at = str(np.datetime_as_string(np.datetime64(ts_ms, "ms"), unit="ms"))
    message: dict[str, Any] = {"v": 1, "camera": camera, "ts": f"{at}Z"}
    if seq is not None:
        message["seq"] = seq
    message |= {"engine": ENGINE, "quality": quality, "persons": [dict(p) for p in persons]}
    if pairs is not None:
        message["pairs"] = [dict(p) for p in pairs]
    return message


def make_empty(
    duration_s: float, *, start_ms: int = START_MS, interval_s: float = 1.0, camera: str = "cam-1"
) -> list[Message]:
    """Return heartbeats: frames with nobody in view, the first at `start_ms`, the last at most `duration_s` later."""
    return [frame_message(camera, ms) for ms in _instants(start_ms, duration_s, interval_s)]


def make_pair(
    distance_m: float,
    duration_s: float,
    *,
    start_ms: int = START_MS,
    interval_s: float = 1.0,
    camera: str = "cam-1",
    at: Point = (5.0, 5.0),
    ids: tuple[str, str] = ("1", "2"),
) -> list[Message]:
    """Return frames of two people standing still: one violation when they are close enough for long enough.

    Args:
        distance_m: Distance between them.
        duration_s: From first to last frame; both are sent.
        start_ms: First instant, UTC milliseconds.
        interval_s: Seconds from frame to frame.
        camera: Camera id.
        at: Middle of the pair, floor metres; they stand left and right of it.
        ids: Their track ids.
    """
    people = [
        {"id": ids[0], "x_m": at[0] - distance_m / 2, "y_m": at[1]},
        {"id": ids[1], "x_m": at[0] + distance_m / 2, "y_m": at[1]},
    ]
    return [frame_message(camera, ms, people) for ms in _instants(start_ms, duration_s, interval_s)]


def make_walk(
    start: Point,
    end: Point,
    *,
    duration_s: float,
    start_ms: int = START_MS,
    interval_s: float = 1.0,
    camera: str = "cam-1",
    track: str = "1",
) -> list[Message]:
    """Return frames of one person walking straight from `start` to `end` at constant speed; both ends are sent."""
    messages = []
    for ms in _instants(start_ms, duration_s, interval_s):
        share = (ms - start_ms) / 1000 / duration_s if duration_s > 0 else 0.0
        x, y = (a + (b - a) * share for a, b in zip(start, end, strict=True))
        messages.append(frame_message(camera, ms, [{"id": track, "x_m": round(x, 3), "y_m": round(y, 3)}]))
    return messages


def merge(*parts: Sequence[Message]) -> list[Message]:
    """Return messages in order of time, then camera; those of one camera and instant become one frame."""
    frames: dict[tuple[str, str], Message] = {}
    for message in (m for part in parts for m in part):
        key = (message["ts"], message["camera"])
        if key in frames:
            frames[key] = {**frames[key], "persons": [*frames[key]["persons"], *message["persons"]]}
        else:
            frames[key] = message
    return [frames[key] for key in sorted(frames)]


@dataclass(frozen=True, slots=True)
class TinyWeek:
    """A week of pairs standing still.

    Attributes:
        messages: Frame messages, ordered by time and camera.
        violations: Violations that arrive, by camera and local start of the hour.
    """

    messages: list[Message]
    violations: dict[tuple[str, datetime], int]


def make_week(
    monday: date = date(2026, 11, 9),
    *,
    timezone: str = "Europe/Rome",
    open_hours: tuple[int, int] = (9, 12),
    cameras: Sequence[str] = ("cam-1",),
    interval_s: float = 2.0,
    per_hour: int = 3,
    places: Sequence[Point] = ((3.0, 3.0), (9.0, 3.0), (3.0, 9.0)),
    hotspot: Point | None = None,
    hotspot_per_hour: int = 6,
    outage: tuple[str, datetime, datetime] | None = None,
) -> TinyWeek:
    """Return a week in which each camera sees an exact number of violations every open hour.

    Each violation is a pair 1.5 m apart for 10 s; between them nobody is in view, frames come all the time.

    Args:
        monday: First local date.
        timezone: IANA zone of the site.
        open_hours: First local hour with frames, and the hour in which they end.
        cameras: Camera ids.
        interval_s: Seconds from frame to frame; 10 s must be a multiple of it.
        per_hour: Violations an hour and camera, at the `places` in turn.
        places: Middles of the pairs, floor metres.
        hotspot: A place that has `hotspot_per_hour` violations more; None = none.
        hotspot_per_hour: See `hotspot`.
        outage: Camera, first lost and first recorded instant; its frames between them are left out.
    """
    per_place = [places[k % len(places)] for k in range(per_hour)] + ([hotspot] * hotspot_per_hour if hotspot else [])
    if 30 * len(per_place) > 3600:
        raise ValueError("more than 120 violations do not fit in an hour")
    zone = ZoneInfo(timezone)
    messages: list[Message] = []
    counts: dict[tuple[str, datetime], int] = {}
    for d in range(7):
        for hour in range(*open_hours):
            local = datetime(monday.year, monday.month, monday.day, hour, tzinfo=zone) + timedelta(days=d)
            start_ms = round(local.timestamp() * 1000)
            for camera in cameras:
                arrived, n = _hour(camera, start_ms, interval_s, per_place, outage)
                messages += arrived
                counts[camera, local] = n
    messages.sort(key=lambda m: (m["ts"], m["camera"]))
    return TinyWeek(messages, counts)


def _hour(
    camera: str,
    start_ms: int,
    interval_s: float,
    per_place: Sequence[Point],
    outage: tuple[str, datetime, datetime] | None,
) -> tuple[list[Message], int]:
    """Return one hour's frames that arrive and how many whole violations are among them."""
    lost = range(0)
    if outage is not None and outage[0] == camera:
        lost = range(round(outage[1].timestamp() * 1000), round(outage[2].timestamp() * 1000))
    frames = {ms: frame_message(camera, ms) for ms in _instants(start_ms, 3600.0 - interval_s, interval_s)}
    n = 0
    slot_ms = int(3_600_000 / max(len(per_place), 1) / (interval_s * 1000)) * round(interval_s * 1000)
    for k, place in enumerate(per_place):
        pair_ms = start_ms + k * slot_ms
        pair = make_pair(
            1.5,
            10.0,
            start_ms=pair_ms,
            interval_s=interval_s,
            camera=camera,
            at=place,
            ids=(f"{2 * k + 1}", f"{2 * k + 2}"),
        )
        instants = list(_instants(pair_ms, 10.0, interval_s))
        n += not any(ms in lost for ms in instants)
        frames.update(zip(instants, pair, strict=True))
    return [message for ms, message in frames.items() if ms not in lost], n


def simulate_frames(
    opens: datetime,
    *,
    closes: datetime,
    seed: int = 1,
    interval_s: float = 2.0,
    display_moved: bool = False,
    busy: float = 1.0,
    cameras: Sequence[str] = ("cam-1", "cam-2", "cam-3", "cam-4"),
) -> Iterator[Message]:
    """Yield the demo shop's messages of one day, camera by camera, as dictionaries; see `people.simulate_day`."""
    day = simulate_day(opens, closes=closes, seed=seed, interval_s=interval_s, display_moved=display_moved, busy=busy)
    decode = msgspec.json.Decoder(dict[str, Any]).decode
    for camera in CAMERAS:
        if camera.camera_id in cameras:
            yield from map(decode, day_text(day, camera, seed=seed).text.splitlines())


def _instants(start_ms: int, duration_s: float, interval_s: float) -> range:
    step = round(interval_s * 1000)
    return range(start_ms, start_ms + round(duration_s * 1000) + 1, step)
