"""One camera of `vsd engine live`: from a picture of now to a frame message."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Final, Protocol

import numpy as np

from vsd_analytics.engine.bodies import Bodies, body_sizes_px
from vsd_analytics.engine.calibration_error import LikelyCameras, floor_per_px
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.floor_method import locate
from vsd_analytics.engine.floor_points import floor_points
from vsd_analytics.engine.frame_pictures import Picture
from vsd_analytics.engine.ignored_parts import engine_ignoring, in_parts
from vsd_analytics.engine.live_sources import HUNG_S, LivePicture, LiveSource
from vsd_analytics.engine.live_tracker import LiveTracker
from vsd_analytics.engine.messages import frame_messages
from vsd_analytics.engine.people import People
from vsd_analytics.engine.people_calibration_file import read_stated_error
from vsd_analytics.engine.people_of_pictures import PeopleOfPictures, SeenFrame, rounded_px
from vsd_analytics.engine.plane_method import locate_on_planes, standing
from vsd_analytics.engine.seen import Seen
from vsd_analytics.engine.tiles import PictureTile, tiles_for, tiles_of
from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.geometry.plane_views import planes_in_force
from vsd_analytics.geometry.stated_errors import beside
from vsd_analytics.live.status import iso_utc
from vsd_analytics.site.model import Calibration, Camera, Plane
from vsd_analytics.warehouse.owner_spans import in_force

RECENT: Final = 300
"""Frames whose people say how large a body is, for a calibration by eye."""
SAME_SHAPE: Final = 0.01
"""Pictures whose proportions differ more than this from `picture_px` show something else."""


class PersonFinder(Protocol):
    """A detector, as `engine.detector.Detector`."""

    def people(self, picture: Picture, *, tiles: Sequence[PictureTile] | None = None) -> Detections:
        """Return the people of a picture."""


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """What was found in one picture.

    Attributes:
        ms: UTC milliseconds.
        picture: The picture; in memory only.
        people: Those found, in pixels of the picture.
        seen: Their places and near pairs; None without a calibration.
    """

    ms: int
    picture: Picture
    people: People
    seen: Seen | None


@dataclass(frozen=True, slots=True)
class TileChoice:
    """Which parts of a picture the detector looks at.

    Attributes:
        input_px: Width and height of the network's input; None = the whole picture at once.
        side_px: Side of the parts; None = by the size of people, 0 = the whole picture.
    """

    input_px: tuple[int, int] | None = None
    side_px: int | None = None

    def tiles(self, size_px: tuple[int, int], calibration: Calibration | None) -> list[PictureTile]:
        """Return the parts of a picture of a size."""
        if self.side_px == 0 or (self.side_px is None and self.input_px is None):
            return [PictureTile(0, 0, *size_px)]
        body_px = None if calibration is None else body_sizes_px(calibration.homography, size_px)
        if self.side_px is not None:
            overlap = self.side_px // 4 if body_px is None else round(body_px[1])
            return tiles_of(size_px, side_px=self.side_px, overlap_px=(overlap // 2, overlap))
        assert self.input_px is not None
        return tiles_for(size_px, input_px=self.input_px, body_px=body_px)


class LiveCamera:
    """Looks at the pictures of one camera.

    A picture that equals the last one to the byte may be of a camera that hangs. Its frame waits until a new picture
    comes: within `HUNG_S` seconds the scene stood still, and the frame counts; later it was an outage, and none of the
    frames in it does.

    Args:
        camera: The camera.
        source: Where its pictures come from.
        within_m, distance_m: As in `floor_method.locate`.
        tiles: Which parts of a picture the detector looks at.

    Attributes:
        n_processed: Pictures looked at.
        n_hung: Pictures that were not counted since they showed nothing of now.
        n_unstored: Frames that found no room because nothing could be stored.
        n_ignored: People left out because they were in a part of the picture that is ignored.
        error: Why its last picture could not be looked at; None = it could.
        last_ms: When the last picture looked at was; None = none yet.
        newest: The last frame, for the look page; None where nobody looks.
        recent: The people of the last `RECENT` frames, for the look page.
    """

    def __init__(
        self, camera: Camera, source: LiveSource, *, within_m: float, distance_m: float, tiles: TileChoice
    ) -> None:
        self.camera, self.source = camera, source
        self.n_processed = self.n_hung = self.n_unstored = self.n_ignored = 0
        self.error: str | None = None
        self.last_ms: int | None = None
        self.newest: LiveFrame | None = None
        self.recent: deque[People] = deque(maxlen=RECENT)
        self.is_looked_at = False
        self._within_m, self._distance_m, self._tile_choice = within_m, distance_m, tiles
        self._ground: tuple[Calibration | None, tuple[int, int]] | None = None
        self._tiles: list[PictureTile] = []
        self._bodies = Bodies(None, (1, 1))
        self._tracker = LiveTracker()
        self._stated: LikelyCameras | None = None
        self._found: Detections | None = None
        self._waiting: list[tuple[int, Picture]] = []

    def messages(self, live: LivePicture, detector: PersonFinder) -> list[bytes]:
        """Return the frame messages that a picture makes sure of; none while it may be one of a camera that hangs."""
        if live.same_s > HUNG_S:
            self.n_hung += len(self._waiting) + 1
            self._waiting.clear()
            return []
        if live.same_s > 0:
            self._waiting.append((live.ms, live.picture))
            return []
        waiting, self._waiting = self._waiting, []
        still = [one for one in waiting if live.ms - waiting[0][0] <= HUNG_S * 1000]
        self.n_hung += len(waiting) - len(still)
        same = self._found
        frames = [self._frame(ms, picture, same) for ms, picture in still if same is not None]
        self._stand_on_ground(live.picture, live.ms)
        self._found = rounded_px(detector.people(live.picture, tiles=self._tiles))
        frames.append(self._frame(live.ms, live.picture, self._found))
        return [message for frame in frames for message in self._message(frame)]

    def as_dict(self) -> dict[str, Any]:
        """Return its state for the heartbeat."""
        source, counts = self.source, self.source.counts
        last = None if self.last_ms is None else iso_utc(datetime.fromtimestamp(self.last_ms / 1000, tz=UTC))
        return {
            "state": source.state if self.error is None or source.state != "on" else "failing",
            "error": source.error or self.error,
            "last": last,
            "pictures": counts.n_pictures,
            "processed": self.n_processed,
            "too_slow": counts.n_replaced,
            "hung": self.n_hung,
            "not_stored": self.n_unstored,
            "people_ignored": self.n_ignored,
            "connections": counts.n_connections,
        }

    def _stand_on_ground(self, picture: Picture, ms: int) -> None:
        """Note the calibration in force; raise ValueError where pictures are of another shape than it is for."""
        picture_px = _size(picture)
        known = self.camera.picture_px
        if known is not None and abs(picture_px[0] * known[1] / (picture_px[1] * known[0]) - 1) > SAME_SHAPE:
            raise ValueError(f"its pictures are {picture_px[0]}x{picture_px[1]}, picture_px says {known[0]}x{known[1]}")
        used = next(iter(in_force(self.camera, ms)), None)
        if self._ground == (used, picture_px):
            return
        self._ground, size_px = (used, picture_px), known or picture_px
        self._tiles = self._tile_choice.tiles(picture_px, used if size_px == picture_px else None)
        self._bodies = Bodies(None if used is None else used.homography, size_px)
        self._stated = _stated_error(used)

    def _frame(self, ms: int, picture: Picture, detections: Detections) -> LiveFrame:
        used = None if self._ground is None else self._ground[0]
        picture_px = _size(picture)
        size_px = self.camera.picture_px or picture_px
        detections = detections.mapped((size_px[0] / picture_px[0], size_px[1] / picture_px[1]), (0.0, 0.0))
        is_ignored = in_parts(detections.box, self.camera.ignore_px)
        self.n_ignored += int(is_ignored.sum())
        detections = detections.rows(~is_ignored)
        planes = planes_in_force(self.camera.planes, datetime.fromtimestamp(ms / 1000, tz=UTC))
        if used is not None and not planes:
            self._bodies.learn(detections)
            detections = self._bodies.cleaned(detections)
        people, seen = _people(detections, ms), None
        if planes:
            seen = self._seen_on_planes(people, planes, used, size_px, ms)
        elif used is not None:
            seen = self._seen(people, used, size_px, ms)
        frame = LiveFrame(ms, picture, people, seen)
        if self.is_looked_at:
            self.newest = frame
            self.recent.append(people)
        self.n_processed += 1
        self.last_ms, self.error = ms, None
        return frame

    def _seen(self, people: People, used: Calibration, size_px: tuple[int, int], ms: int) -> Seen:
        uv = floor_points(people, homography=used.homography, picture_px=size_px)
        xy = to_floor(used.homography, uv, picture_px=size_px)
        per_px = floor_per_px(used.homography, uv, picture_px=size_px)
        return locate(
            self._tracker.with_ids(people, xy, per_px, ms=ms),
            homography=used.homography,
            picture_px=size_px,
            within_m=self._within_m,
            distance_m=self._distance_m,
            name=used.calibration_id,
            error=self._stated,
        )

    def _seen_on_planes(
        self, people: People, planes: Sequence[Plane], used: Calibration | None, size_px: tuple[int, int], ms: int
    ) -> Seen:
        on = standing(people, planes=planes, calibration=used, picture_px=size_px)
        return locate_on_planes(
            self._tracker.with_ids(people, on.xy, on.floor_per_px, ms=ms),
            planes=planes,
            calibration=used,
            picture_px=size_px,
            within_m=self._within_m,
            distance_m=self._distance_m,
            stated_error=_stated_error,
        )

    def _message(self, frame: LiveFrame) -> list[bytes]:
        if frame.seen is None:
            return []
        seen = replace(frame.seen, engine=engine_ignoring(frame.seen.engine, self.camera.ignore_px))
        return list(frame_messages(seen, camera=self.camera.camera_id, ts_ms=np.array([frame.ms])))


def _size(picture: Picture) -> tuple[int, int]:
    return int(picture.shape[1]), int(picture.shape[0])


def _people(detections: Detections, ms: int) -> People:
    one = PeopleOfPictures()
    one.add(SeenFrame(0, ms, detections))
    return replace(one.people(), ts_ms=np.array([ms], dtype=np.int64))


def _stated_error(used: Calibration | None) -> LikelyCameras | None:
    if used is None or used.source is None:
        return None
    return read_stated_error(beside(used.source, "people"), calibration_id=used.calibration_id)
