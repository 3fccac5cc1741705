"""What the cameras of a report's week recorded."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDay:
    """What one camera recorded on one local day."""

    day: date = _f("Local date.")
    scheduled_h: float = _f("Open hours of the day; 0 when closed.", "h")
    recorded_h: float = _f("Open hours recorded.", "h", "M1")
    share: float | None = _f("Recorded over scheduled; None when closed all day, or to come.", "share", "M1")
    hourly_share: tuple[float | None, ...] = _f(
        "24 values, local hours 0 to 23: share of the hour recorded; None where closed or not over.", "share", "M1"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRecord:
    """What one camera recorded in the week."""

    camera_id: str = _f("Identifier.")
    name: str = _f("Display name; free text.")
    label: str = _f("Short label on the map and in tables, such as 1 or C1.")
    days: tuple[CameraDay, ...] = _f("Monday to Sunday.", metric="M1")
    scheduled_h: float = _f("Open hours of the week.", "h")
    recorded_h: float = _f("Open hours recorded.", "h", "M1")
    share: float | None = _f("Recorded over scheduled.", "share", "M1")
    is_silent: bool = _f(
        "True: it recorded no hour of the week that enters rates, so the floor that only it sees is not known.",
        default=False,
    )
    last_record: datetime | None = _o(
        "Instant of the last record up to this week, in the site's zone; None: none in the sixty days before.",
    )
    not_counted: Reason | None = _o("Why its violations cannot be counted, so that rates leave it out.")
    not_compared: Reason | None = _o("Why the comparison with the week before leaves it out.")
    moved: Reason | None = _o("In words, that it loses or gains people beside its neighbours.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outage:
    """An interval of open hours without data."""

    camera_ids: tuple[str, ...] = _f("Cameras that were silent together.", metric="M2")
    start: datetime = _f("First missing instant, in the site's zone.", metric="M2")
    end: datetime = _f("End of the interval, in the site's zone.", metric="M2")
    open_h: float = _f("Open hours lost, per camera.", "h", "M2")
    is_inferred: bool = _f("True when the engine sends no heartbeat.", default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How much of the open hours was recorded."""

    share: float = _f("Recorded over scheduled camera-hours.", "share", "M1")
    recorded_h: float = _f("Recorded open camera-hours.", "camera-hours", "M1")
    scheduled_h: float = _f("Open camera-hours; those that are over.", "camera-hours", "M1")
    open_h: float = _f("Open hours of the site in the week; those that are over.", "h")
    seen_h: float | None = _o("Open clock hours in which at least one person was seen.", "h")
    cameras: tuple[CameraRecord, ...] = _f("In the order of vsd.toml.", default=())
    outages: tuple[Outage, ...] = _f("In order of start.", metric="M2", default=())
    is_inferred: bool = _f(
        "True when any camera's engine sends no heartbeat: coverage is guessed from gaps.", default=False
    )
    missing_messages: int | None = _o(
        "Messages that never arrived or are in quarantine, by the engine's running numbers; None: it numbers nothing.",
        "messages",
    )
    message_gaps: int = _f("Gaps these are in.", default=0)
    not_over_from: datetime | None = _o(
        "Start of the first hour that is not over, in the site's zone: from it on hours are neither recorded nor "
        "missing; None: the week's open hours are over.",
    )
