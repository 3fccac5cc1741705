"""A site as `vsd.toml` describes it: floors, cameras with their calibrations, areas, opening hours, change log."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import date, datetime
from pathlib import Path
from typing import Literal
from zoneinfo import ZoneInfo

from vsd_analytics.resources import DEFAULT_LANGUAGE
from vsd_analytics.settings import Settings, Value
from vsd_analytics.site.calendar import Calendar, Opening, OpeningChange, OpeningHours, touches
from vsd_analytics.site.lines import Line
from vsd_analytics.site.routes import CameraSource, ExchangeRoute, MailRoute

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Calibration:
    """A homography from image pixels to floor metres, valid from an instant on.

    Attributes:
        homography: 3x3, row by row: (x, y, w) = H (u, v, 1), floor position (x/w, y/w) in metres.
        valid_from: UTC instant from which it is valid; None = always.
        calibration_id: 8 hexadecimal digits of the BLAKE2 hash of the nine numbers.
        error_m: Error of a position by the points it was made from; None where unknown.
        source: File it was read from.
        error_cells: For a calibration from people: x and y of the middle of each floor cell of 1 m, and the standard
            deviation of a distance of 2 m there, metres.
    """

    homography: tuple[tuple[float, float, float], ...]
    valid_from: datetime | None
    calibration_id: str
    error_m: float | None = None
    source: Path | None = None
    error_cells: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Plane:
    """A part of a camera's picture with a homography of its own: a ramp, a stage, a floor behind a step.

    Attributes:
        plane_id: Identifier within the camera.
        polygon_px: Corners in the picture, pixels; whoever has the foot point in it is on this plane.
        calibration: Its homography to metres of the floor plan; it begins to hold at its `valid_from`.
        height_m: (a, b, c): at (x, y) of the plan its height above the floor is a + b x + c y; None = not stated.
    """

    plane_id: str
    polygon_px: tuple[Point, ...]
    calibration: Calibration
    height_m: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera, or any sensor that acts as one.

    Attributes:
        camera_id: Identifier.
        name: Display name; free text, always escaped.
        floor_id: Floor it looks at.
        calibrations: In order of `valid_from`; empty when the engine sends floor metres.
        picture: Picture of the empty scene.
        picture_px: Width and height of the picture the homography is for; None = unknown.
        hz: Processed frames per second; None = median frame interval of the day.
        clock: IANA zone of times without an offset.
        engine_ids: What the engine calls this camera.
        view: Polygon in floor metres of what it sees; None = taken from homography and picture size. With planes, their
            outline where the site states none.
        has_clock: Whether the site states `clock`; else times without an offset are doubtful.
        planes: Parts of its picture with homographies of their own, for `vsd engine run`; the first that matches wins.
        source: Where `vsd engine live` gets its pictures; None = another engine sends its people.
        first_day: First local day on which it is there; None = always was.
        end_day: Local day from which it no longer is; None = still is.
        ignore_px: Polygons in the picture, pixels: a mirror, a screen, a window to the street. Whoever has the feet in
            one is left out, and the floor in it counts as not seen.
    """

    camera_id: str
    name: str
    floor_id: str
    calibrations: tuple[Calibration, ...] = ()
    picture: Path | None = None
    picture_px: tuple[int, int] | None = None
    hz: float | None = None
    clock: str = "UTC"
    engine_ids: tuple[str, ...] = ()
    view: tuple[Point, ...] | None = None
    has_clock: bool = False
    planes: tuple[Plane, ...] = ()
    source: CameraSource | None = None
    ignore_px: tuple[tuple[Point, ...], ...] = ()
    first_day: date | None = None
    end_day: date | None = None

    def is_there(self, first: date, last: date) -> bool:
        """Tell whether it is there on any local day from `first` to `last`."""
        return touches(self.first_day, self.end_day, first, last)


@dataclass(frozen=True, slots=True)
class Floor:
    """A floor and its plan. Floor x runs right, y up, metres.

    Attributes:
        floor_id: Identifier.
        name: Display name.
        plan: SVG, PNG or JPG picture of the plan.
        plan_m_per_px: Metres per plan pixel.
        plan_origin_m: Floor metres of the plan's lower left corner.
        target_per_open_h: Violations per open hour that the site wants to stay below; None = no target.
        capacity: People it is meant for at once; None = not stated.
    """

    floor_id: str
    name: str
    plan: Path | None = None
    plan_m_per_px: float | None = None
    plan_origin_m: Point = (0.0, 0.0)
    target_per_open_h: float | None = None
    capacity: int | None = None


@dataclass(frozen=True, slots=True)
class Area:
    """A named polygon on a floor.

    Attributes:
        area_id: Identifier.
        name: Display name; free text, always escaped.
        floor_id: Its floor.
        polygon: Corners in floor metres.
        ask: What the report is to ask about it; None = by rule.
        first_day: First local day that counts for it; None = always was.
        end_day: Local day from which it counts no longer; None = still does.
        has_visits: Visits of it are counted, and how long they last.
        is_door, is_staff: A track that begins or ends inside was not cut; only staff are inside for long.
        long_visit_s: Dwell time from which a visit is a long one; None = the setting of that name.
        is_queue: People wait here: how many, and how long.
        served_in, queue_limit: Area that a queue leads to: who steps from the queue into it is served; people waiting,
            mean of an hour, above which another point of service is worth it; None = not stated.
        capacity: People it is meant for at once; None = not stated.
    """

    area_id: str
    name: str
    floor_id: str
    polygon: tuple[Point, ...]
    ask: str | None = None
    first_day: date | None = None
    end_day: date | None = None
    has_visits: bool = False
    is_door: bool = False
    is_staff: bool = False
    long_visit_s: float | None = None
    is_queue: bool = False
    served_in: str | None = None
    queue_limit: float | None = None
    capacity: int | None = None

    def is_there(self, first: date, last: date) -> bool:
        """Tell whether it is there on any local day from `first` to `last`."""
        return touches(self.first_day, self.end_day, first, last)


FixtureKind = Literal["shelf", "wall", "till", "other"]


@dataclass(frozen=True, slots=True)
class Fixture:
    """Something nobody walks through, as a polygon in floor metres.

    Attributes:
        fixture_id: Identifier.
        name: Display name; free text, always escaped.
        floor_id: Its floor.
        polygon: Its footprint.
        kind: "shelf" (also counters and displays), "wall" (also closed rooms), "till", or "other".
        is_movable: True when staff could move it, so that a report may ask whether it should.
        height_m: Its height, so that a picture shows what it hides; None = unknown.
        valid_from: UTC instant from which it is there; None = always was.
        valid_to: UTC instant from which it no longer is; None = still is.
    """

    fixture_id: str
    name: str
    floor_id: str
    polygon: tuple[Point, ...]
    kind: FixtureKind = "shelf"
    is_movable: bool = False
    height_m: float | None = None
    valid_from: datetime | None = None
    valid_to: datetime | None = None

    def is_there(self, at: datetime, *, until: datetime | None = None) -> bool:
        """Tell whether it is there at an instant, and up to another one where that is given."""
        has_come = self.valid_from is None or self.valid_from <= at
        if self.valid_to is None:
            return has_come
        return has_come and (self.valid_to > at if until is None else self.valid_to >= until)


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One line of the site's change log: what was moved, when, where.

    Attributes:
        at: Instant of the change (with offset).
        text: Free text, always escaped.
        area_id: Area it concerns, or None for the whole site.
        question: Id of the report's question it answers; None = none. Two entries that differ in this alone are one.
        by: Who logged it, likewise; None = not stated.
        prediction: Number of the receipt of `vsd whatif` that foresaw it, likewise; None = none.
    """

    at: datetime
    text: str
    area_id: str | None = None
    question: str | None = field(default=None, compare=False)
    by: str | None = field(default=None, compare=False)
    prediction: int | None = field(default=None, compare=False)


AlarmKind = Literal["gathering", "contact", "silence"]


@dataclass(frozen=True, slots=True)
class AlarmRule:
    """A situation that raises an alarm while it lasts.

    Attributes:
        alarm_id: Identifier.
        kind: "gathering" (`n_people` linked by distances under `distance_m`), "contact" (two), "silence" (a camera's).
        for_s: How long it must last before the alarm starts, in seconds.
        area_id: Area it must happen in; None = anywhere.
        camera_ids: Cameras it is about; empty = all.
        n_people: People of a gathering.
        cooldown_s: After an end, the same situation at the same place raises no alarm for this long, in seconds.
        is_open_only, is_between_groups: Only in opening hours; only contacts of two who are not together.
    """

    alarm_id: str
    kind: AlarmKind
    for_s: float
    area_id: str | None = None
    camera_ids: tuple[str, ...] = ()
    n_people: int = 3
    cooldown_s: float = 300.0
    is_open_only: bool = True
    is_between_groups: bool = True


@dataclass(frozen=True, slots=True)
class AlarmDelivery:
    """Where alarms go besides the screen.

    Attributes:
        webhook: http(s) address that gets each event as a JSON POST; None = none.
        topic: MQTT topic of the broker of `[mqtt]` that gets each event; None = none.
    """

    webhook: str | None = None
    topic: str | None = None


@dataclass(frozen=True, slots=True)
class Broker:
    """The MQTT broker frame messages come from.

    Attributes:
        host: Name or address.
        port: TCP port.
        topics: Topic filters subscribed to.
        client_id: Names the persistent session; one listener per client id.
        username: None = no login; the password is never in vsd.toml: see `password_file`.
        password_file: File with the password on its first line; the environment's VSD_MQTT_PASSWORD wins.
        is_tls: Encrypt.
        ca_file: Certificates to trust; None = the system's.
        cert_file, key_file: Certificate and key that name this client to the broker.
        status_topic: Topic of the heartbeat; None = none.
        figures_topic: Topic below which `vsd today --publish` puts the figures of the day; None = none.
        is_home_assistant: It announces them to Home Assistant, too.
    """

    host: str
    port: int = 1883
    topics: tuple[str, ...] = ("vsd/+/frames",)
    client_id: str = "vsd-listen"
    username: str | None = None
    password_file: Path | None = None
    is_tls: bool = False
    ca_file: Path | None = None
    cert_file: Path | None = None
    key_file: Path | None = None
    status_topic: str | None = None
    figures_topic: str | None = None
    is_home_assistant: bool = False


@dataclass(frozen=True, slots=True)
class EngineError:
    """The measurement error of the site's engine, as the site states it: from a data sheet or a check by hand.

    Attributes:
        precision: Share of its violation records that are true, above 0 to 1; None = not known.
        recall: Share of the true violation records that it gives, above 0 to 1; None = not known.
        distance_sd_m: Standard deviation of a distance it measures, near the legal one; None = not known.
    """

    precision: float | None = None
    recall: float | None = None
    distance_sd_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingRule:
    """How files of one kind are read: a `[[source]]` of `vsd.toml`.

    Attributes:
        rule_id: Its id.
        files: Patterns of file names, such as "till-*.csv"; with a slash they are compared with the end of the path.
        format: Name of an adapter; None = detected.
        camera: Camera of records that name none, by any of its names.
        camera_from_name: Pattern of file names with `{camera}` where they say the camera of records that name none.
        columns: Names of the columns of a headerless table, in order.
        map: Our column names to theirs.
        unit: Unit of positions and distances whose column names none.
        zone: IANA zone of times without an offset.
        time_format: How times are written, in the words of strptime.
        where: Rows to read.
        size_px: Width and height of the picture, for positions given as shares of it.
        period_s: Sampling period in seconds.
        fps: Frames per second, for files with frame numbers.
        engine: Engine name and version.
        persons: Path of the list of persons in a JSON message.
        no_list_is_nobody: A message without that list is a frame without persons.
        topics: MQTT topic filters of messages that are read so.
    """

    rule_id: str
    files: tuple[str, ...]
    format: str | None = None
    camera: str | None = None
    camera_from_name: str | None = None
    columns: tuple[str, ...] | None = None
    map: dict[str, str] = field(default_factory=dict)
    unit: str | None = None
    zone: str | None = None
    time_format: str | None = None
    where: str | None = None
    size_px: tuple[int, int] | None = None
    period_s: float | None = None
    fps: float | None = None
    engine: str | None = None
    persons: str | None = None
    no_list_is_nobody: bool | None = None
    topics: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Site:
    """A site as `vsd.toml` and the files it names describe it.

    Attributes:
        site_id, name: Identifier, a Hive folder name; display name.
        timezone, root: IANA zone all local times are in; the project folder.
        opening, opening_changes: Before the first change, None = always open; and changes in the order of their days.
        closed, calendar: Local dates on which the site is closed; `[calendar]`, `[[event]]`.
        day_starts_min: Minutes after local midnight at which a site day starts.
        doors_empty_min: Those at which floors are empty, so that counts of doors start at 0; None = not stated.
        floors, cameras, areas, fixtures, lines: In the order of the file.
        settings: Values in force.
        own_settings: Settings of vsd.toml where others are in force; None = `settings`. Facts of both lie side by side.
        broker, exchange: `[mqtt]`, None = no live source; `[exchange]`, None = all records come here directly.
        alarms, alarm_delivery: `[[alarm]]`, in the order of the file, and `[alarms]`.
        engine, mail: `[engine]`, None = nothing is known of its error; `[mail]`, None = mails are written, not sent.
        base_url: `[report] base_url`, where the folder of reports can be read, without a slash at its end; None = none.
        language, chromium: Of pages; the browser that prints PDFs, None = looked for on the PATH.
        ingest_map, sources: `[ingest.map]`, ours to theirs; `[[source]]`, in the order of the file.
        setting_sources: For each setting that is not the default: "vsd.toml line 7" or an environment variable.
    """

    site_id: str
    name: str
    timezone: str
    root: Path
    opening: Opening | None = None
    opening_changes: tuple[OpeningChange, ...] = ()
    closed: frozenset[date] = frozenset()
    calendar: Calendar = field(default_factory=Calendar)
    day_starts_min: int = 240
    doors_empty_min: int | None = None
    floors: tuple[Floor, ...] = ()
    cameras: tuple[Camera, ...] = ()
    areas: tuple[Area, ...] = ()
    fixtures: tuple[Fixture, ...] = ()
    lines: tuple[Line, ...] = ()
    broker: Broker | None = None
    exchange: ExchangeRoute | None = None
    alarms: tuple[AlarmRule, ...] = ()
    alarm_delivery: AlarmDelivery = field(default_factory=AlarmDelivery)
    engine: EngineError | None = None
    mail: MailRoute | None = None
    base_url: str | None = None
    chromium: Path | None = None
    language: str = DEFAULT_LANGUAGE
    settings: Settings = field(default_factory=Settings)
    own_settings: Settings | None = None
    ingest_map: dict[str, str] = field(default_factory=dict)
    sources: tuple[ReadingRule, ...] = ()
    setting_sources: dict[str, str] = field(default_factory=dict)

    def with_settings(self, **values: Value) -> Site:
        """Return the site with other settings in force; KeyError for an unknown name."""
        own_values = self.own_settings or self.settings
        return replace(self, settings=self.settings.with_values(values), own_settings=own_values)

    def with_own_settings(self) -> Site:
        """Return the site with the settings of vsd.toml in force."""
        return self if self.own_settings is None else replace(self, settings=self.own_settings, own_settings=None)

    @property
    def hours(self) -> OpeningHours:
        """Return the opening hours at all times."""
        return OpeningHours(self.opening, self.opening_changes)

    @property
    def node(self) -> str | None:
        """Return the name of the node that this project is; None = it is a site's own store."""
        return None if self.exchange is None else self.exchange.node

    @property
    def acknowledged(self) -> Path:
        """Return the folder of the spool that records go to: `outbox` of a node, else `store`."""
        return self.root / ("store" if self.node is None else "outbox")

    @property
    def zone(self) -> ZoneInfo:
        """Return the site's time zone."""
        return ZoneInfo(self.timezone)

    def camera(self, camera_id: str) -> Camera:
        """Return the camera with this id; KeyError if there is none."""
        return next(c for c in self.cameras if c.camera_id == camera_id)
