"""What can be written at the desk, each by the function of its command: the answer to a question, a change, undo."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final

from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.change_log import add_answer, add_entry, remove_entry
from vsd_analytics.config.floor_targets import RANGE, read_target_changes, set_target
from vsd_analytics.config.log_records import ANSWERS, NAME_MAX_CHARS, TEXT_MAX_CHARS, is_name
from vsd_analytics.config.opening import WEEKDAYS, OpeningError, parse_spans
from vsd_analytics.config.opening_changes import change_opening, take_opening_back
from vsd_analytics.config.place_edits import KINDS, PlaceEdit, end_place, mark_place, standing, take_place_back
from vsd_analytics.config.values import parse_instant
from vsd_analytics.errors import CONTROL, ConfigError, UsageError
from vsd_analytics.service.desk_history import desk_history
from vsd_analytics.service.plan_picture import corners_of
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AnswerKind
from vsd_analytics.wording.catalogue import say

FIELD_MAX_CHARS: Final = 2000
"""Of any field; a longer one is no form of the desk."""
_SPAN_GAPS: Final = re.compile(r"[\s,;]+")
_NUMBER: Final = re.compile(r"\d{1,7}(\.\d{1,3})?")
FAR: Final = timedelta(days=5 * 366)
"""A change so far from today has a wrong date."""


class FormMistakeError(Exception):
    """A form cannot be taken as it is.

    Args:
        name: Name of the field.
        words: What is wrong with it, for its reader.
    """

    def __init__(self, name: str, words: str) -> None:
        super().__init__(words)
        self.name, self.words = name, words


@dataclass(frozen=True, slots=True)
class Writing:
    """One form to be written.

    Attributes:
        site: The site as it is now.
        fields: What was filled in, by name.
        writer: Who writes.
        now: The present.
    """

    site: Site
    fields: Mapping[str, str]
    writer: str
    now: datetime

    def text(self, name: str, *, is_needed: bool) -> str:
        """Return a line of text."""
        text = " ".join(self.fields.get(name, "").split())
        if not text and is_needed:
            raise FormMistakeError(name, say("desk.mistake.empty"))
        if len(text) > TEXT_MAX_CHARS or CONTROL.search(text):
            raise FormMistakeError(name, say("desk.mistake.text", n=TEXT_MAX_CHARS))
        return text

    def instant(self, name: str) -> datetime:
        """Return a time of the site; an empty one is now."""
        given = self.fields.get(name, "").strip()
        if not given:
            return self.now
        try:
            at = parse_instant(given, timezone=self.site.timezone)
        except ValueError:
            raise FormMistakeError(name, say("desk.mistake.time")) from None
        if abs(at - self.now) > FAR:
            raise FormMistakeError(name, say("desk.mistake.time"))
        return at

    @property
    def monday(self) -> date:
        """Return the first day of the running week."""
        today = self.now.date()
        return today - timedelta(days=today.weekday())

    def area(self, name: str) -> str | None:
        """Return the id of an area; None for the whole site."""
        given = self.fields.get(name, "")
        if given and given not in {a.area_id for a in self.site.areas}:
            raise FormMistakeError(name, say("desk.mistake.area"))
        return given or None


def answer_question(form: Writing) -> str:
    """Store the answer to a question of the week; return what the page says then."""
    kind: AnswerKind | None = next((kind for kind in ANSWERS if kind == form.fields.get("answer")), None)
    asked = next((q for q in read_asked(form.site) if q.question_id == form.fields.get("question")), None)
    if asked is None:
        raise FormMistakeError("question", say("desk.mistake.question"))
    if kind is None:
        raise FormMistakeError("answer", say("desk.mistake.answer"))
    text, at = form.text("text", is_needed=False), form.instant("at")
    when = at if kind == "tried" else form.now
    add_answer(form.site, asked.question_id, kind, at=when, text=text or None, by=form.writer)
    return say(f"desk.done.{kind.replace('-', '_')}")


def log_change(form: Writing) -> str:
    """Log a change; return what the page says then."""
    text, at, area = form.text("text", is_needed=True), form.instant("at"), form.area("area")
    added = add_entry(form.site, text=text, at=at, area=area, by=form.writer)
    return say("desk.done.logged" if added.is_new else "desk.done.logged_before")


def set_floor_target(form: Writing) -> str:
    """Set or take away the target of a floor; return what the page says then."""
    floor_id, given = form.fields.get("floor", ""), form.fields.get("value", "").strip().replace(",", ".")
    if floor_id not in {f.floor_id for f in form.site.floors}:
        raise FormMistakeError("value", say("desk.mistake.floor"))
    value = None
    if given:
        value = float(given) if _NUMBER.fullmatch(given) else 0.0
        if not RANGE[0] <= value <= RANGE[1]:
            raise FormMistakeError("value", say("desk.mistake.number"))
    try:
        changed = set_target(form.site, floor_id, value, at=form.now, by=form.writer)
    except ConfigError:
        raise FormMistakeError("value", say("desk.mistake.table")) from None
    if changed is None:
        return say("desk.done.target_before")
    return say("desk.done.target" if value is not None else "desk.done.no_target")


def take_target_back(form: Writing) -> str:
    """Give a floor the target it had before its last change; return what the page says then."""
    last = {str(n): change for n, change in enumerate(read_target_changes(form.site))}.get(form.fields.get("line", ""))
    now = {f.floor_id: f.target_per_open_h for f in form.site.floors}
    if last is None or last.floor_id not in now or now[last.floor_id] != last.after:
        return say("desk.done.undone_before")
    try:
        set_target(form.site, last.floor_id, last.before, at=form.now, by=form.writer)
    except ConfigError:
        return say("desk.mistake.table")
    return say("desk.done.undone")


def change_hours(form: Writing) -> str:
    """Change the opening hours from a day on; return what the page says then."""
    first = _day(form, "from")
    week = []
    for day in WEEKDAYS:
        try:
            week.append(parse_spans(_spans(form.fields.get(day, "")), day=day))
        except OpeningError:
            raise FormMistakeError(day, say("desk.mistake.hours")) from None
    try:
        changed = change_opening(form.site, tuple(week), first=first, today=form.now.date(), by=form.writer)
    except UsageError:
        raise FormMistakeError("from", say("desk.mistake.hours_from")) from None
    except ConfigError:
        raise FormMistakeError("from", say("desk.mistake.hours_file")) from None
    return say("desk.done.hours" if changed else "desk.done.hours_before")


def take_hours_back(form: Writing) -> str:
    """Delete the opening hours that hold from a day on; return what the page says then."""
    try:
        gone = take_opening_back(form.site, _day(form, "line"), today=form.now.date())
    except (UsageError, ConfigError):
        return say("desk.mistake.hours_file")
    return say("desk.done.undone" if gone else "desk.done.undone_before")


def mark(form: Writing) -> str:
    """Mark an area or a fixture; return what the page says then."""
    kind = next((kind for kind in KINDS if kind == form.fields.get("kind")), None)
    name, first = form.text("name", is_needed=False), _day(form, "from")
    if kind is None or form.fields.get("floor") not in {f.floor_id for f in form.site.floors}:
        raise FormMistakeError("kind", say("desk.mistake.kind"))
    if not is_name(name):
        raise FormMistakeError("name", say("desk.mistake.name", n=NAME_MAX_CHARS))
    try:
        corners = corners_of(form.fields.get("corners", ""))
    except ValueError:
        raise FormMistakeError("corners", say("desk.mistake.corners")) from None
    if first < form.monday:
        raise FormMistakeError("from", say("desk.mistake.place_from"))
    try:
        mark_place(
            form.site, kind=kind, name=name, floor_id=form.fields["floor"], polygon=corners, first=first, at=form.now,
            by=form.writer,
        )  # fmt: skip
    except UsageError:
        raise FormMistakeError("corners", say("desk.mistake.corners")) from None
    except ConfigError:
        raise FormMistakeError("corners", say("desk.mistake.place_file")) from None
    return say("desk.done.marked")


def end(form: Writing) -> str:
    """Say that an area or a fixture is not there any more; return what the page says then."""
    day = _day(form, "until")
    if day < form.monday:
        raise FormMistakeError("until", say("desk.mistake.place_from"))
    try:
        change = end_place(form.site, form.fields.get("place", ""), day, at=form.now, by=form.writer)
    except UsageError:
        raise FormMistakeError("place", say("desk.mistake.place")) from None
    except ConfigError:
        raise FormMistakeError("until", say("desk.mistake.place_file")) from None
    return say("desk.done.ended" if change is not None else "desk.done.ended_before")


def take_mark_back(form: Writing) -> str:
    """Take back that a place was marked or ended; return what the page says then."""
    changes = {place_line(change): change for change in standing(form.site)}
    change = changes.get(form.fields.get("line", ""))
    try:
        is_done = change is not None and take_place_back(form.site, change, at=form.now, by=form.writer)
    except (UsageError, ConfigError):
        return say("desk.mistake.place_file")
    return say("desk.done.undone" if is_done else "desk.done.undone_before")


def place_line(change: PlaceEdit) -> str:
    """Return what names a change in a form."""
    return f"{change.place_id} {change.action}"


def _spans(text: str) -> list[str]:
    """Return the spans of a field such as "8:00 – 13:00, 15:00-19:00"; an empty one is a closed day."""
    joined = re.sub(r"\s*[-\u2013]\s*", "-", text.strip())
    return [part for part in _SPAN_GAPS.split(joined) if part not in ("", "-")]


def _day(form: Writing, name: str) -> date:
    try:
        return date.fromisoformat(form.fields.get(name, "").strip())
    except ValueError:
        raise FormMistakeError(name, say("desk.mistake.day")) from None


def take_back(form: Writing) -> str:
    """Take back what one line of the log says; return what the page says then.

    The line is named, not only its question: of two people who take back the last answer, one takes back nothing.
    """
    line = form.fields.get("line", "")
    row = next((r for r in desk_history(form.site) if str(r.line) == line), None)
    if row is None or row.undo is None:
        return say("desk.done.undone_before")
    remove_entry(form.site, row.undo, at=form.now, by=form.writer)
    return say("desk.done.undone")


JOBS: Final[dict[str, Callable[[Writing], str]]] = {
    "answer": answer_question,
    "log": log_change,
    "undo": take_back,
    "target": set_floor_target,
    "undo-target": take_target_back,
    "hours": change_hours,
    "undo-hours": take_hours_back,
    "mark": mark,
    "end": end,
    "undo-mark": take_mark_back,
}
"""By the last part of the address that a form is sent to."""
PLACE_JOBS: Final = frozenset({"mark", "end", "undo-mark"})
"""Those of the page of a floor's areas and fixtures."""
