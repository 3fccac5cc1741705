"""The pages of the desk: the question, a change, what was written; and the page to sign in. No script, no request."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final

from markupsafe import Markup

from vsd_analytics.config.asked_questions import read_asked
from vsd_analytics.config.floor_targets import read_target_changes
from vsd_analytics.config.log_records import NAME_MAX_CHARS, TEXT_MAX_CHARS
from vsd_analytics.config.opening import WEEKDAYS
from vsd_analytics.config.opening_changes import in_words
from vsd_analytics.report.pages.replies import KINDS
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.service.desk_history import HistoryLine, desk_history
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AskedQuestion
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

LINES_MAX: Final = 30
"""Lines of the log on the page; all are in the file."""
EMPTY: Final = dict.fromkeys(
    ("job", "question", "answer", "at", "text", "area", "floor", "value", "from", *WEEKDAYS), ""
)
"""Of all forms, the fields that are shown again as they were filled in."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeskQuestion:
    """A question that waits for an answer, or has one.

    Attributes:
        question_id: Its id.
        title: The week that asked, and the floor where there are several.
        text: Its words.
        given: The line of its answer; None = it is open.
    """

    question_id: str
    title: str
    text: str
    given: DeskLine | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeskLine:
    """A line of the log: texts.

    Attributes:
        line: Its number.
        kind: What was done.
        at: When.
        text: What it says.
        about: Area or whole site.
        by: Who; empty = not stated.
        can_undo: It can be taken back.
        is_gone: It does not hold any more.
    """

    line: int
    kind: str
    at: str
    text: str
    about: str
    by: str
    can_undo: bool
    is_gone: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DeskTarget:
    """The target of a floor: texts.

    Attributes:
        floor_id: The floor.
        name: Its name; empty where the site has one floor.
        value: The target as a field has it; empty = none.
        said: Who set it last, and when; empty where nobody did here.
        undo: Number of that change; empty where it cannot be taken back.
    """

    floor_id: str
    name: str
    value: str
    said: str
    undo: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeskHours:
    """The opening hours: texts.

    Attributes:
        days: Key, name and spans of each weekday, as the fields have them.
        first: The day from which a change holds, unless another is chosen.
        changes: What began lately or will begin: its day, what is said of it, and whether it can be taken back.
    """

    days: tuple[tuple[str, str, str], ...]
    first: str
    changes: tuple[tuple[str, str, bool], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeskPage:
    """Everything the template of the desk may use; each field is one variable.

    Attributes:
        site: Name of the site.
        title: Title of the page.
        style: The page's only style.
        style_hash: Its hash, for the content security policy.
        writer: Who is signed in.
        form_token: What each form sends back.
        request_id: Id of the next request: sent twice, it is done once.
        said: What was done; empty for nothing.
        mistake: Name of a field that cannot be taken, and why; None = none.
        filled: What was filled in where there is a mistake, and the job.
        questions: The last question of each floor.
        answers: Word of each kind of answer.
        areas: Id and name of each area.
        targets: The target of each floor.
        hours: The opening hours.
        now: The present, as fields for times have it.
        text_max: Longest text.
        lines: What was written, the last first.
        is_more: There are more lines than these.
        pages: Address and name of each page of the site.
        version: Version of the program.
    """

    site: str
    title: str
    style: Markup
    style_hash: str
    writer: str
    form_token: str
    request_id: str
    said: str
    mistake: tuple[str, str] | None
    filled: Mapping[str, str]
    questions: tuple[DeskQuestion, ...]
    answers: tuple[tuple[str, str, str], ...]
    areas: tuple[tuple[str, str], ...]
    targets: tuple[DeskTarget, ...]
    hours: DeskHours
    now: str
    text_max: int
    lines: tuple[DeskLine, ...]
    is_more: bool
    pages: tuple[tuple[str, str], ...]
    version: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SignInPage:
    """Everything the templates of signing in and of problems may use; each field is one variable.

    Attributes:
        site: Name of the site.
        title: Title of the page.
        style: The page's only style.
        style_hash: Its hash.
        problem: What is wrong; empty for nothing.
        detail: More about it.
        name_max: Longest name.
        writer: Name that was filled in.
        after: Address to go to after signing in.
        version: Version of the program.
    """

    site: str
    title: str
    style: Markup
    style_hash: str
    problem: str = ""
    detail: str = ""
    name_max: int = NAME_MAX_CHARS
    writer: str = ""
    after: str = ""
    version: str = VERSION


def desk_policy() -> str:
    """Return the content security policy of the desk's pages: their own style, and forms to this address alone."""
    return (
        f"default-src 'none'; style-src 'sha256-{policy_hash(_style())}'; img-src data:; form-action 'self'; "
        "base-uri 'none'; frame-ancestors 'none'"
    )


def render_desk(
    site: Site,
    *,
    writer: str,
    form_token: str,
    request_id: str,
    now: datetime,
    said: str = "",
    mistake: tuple[str, str] | None = None,
    filled: Mapping[str, str] = EMPTY,
    has_index: bool = False,
) -> str:
    """Return the page of the desk.

    Args:
        site: The site.
        writer: Who is signed in.
        form_token: What each form sends back.
        request_id: Id of the next request.
        now: The present.
        said: What was done.
        mistake: Name of a field that cannot be taken, and why.
        filled: What was filled in, and under `job` which form.
        has_index: There is an index of all sites and weeks.
    """
    history = desk_history(site)
    names = {a.area_id: a.name for a in site.areas}
    lines = [_line(line, names) for line in history]
    local = now.astimezone(site.zone)
    return rendered(
        "desk/desk.html.j2",
        DeskPage(
            site=site.name,
            title=say("desk.title", site=site.name),
            style=Markup(_style()),
            style_hash=policy_hash(_style()),
            writer=writer,
            form_token=form_token,
            request_id=request_id,
            said=said,
            mistake=mistake,
            filled={**EMPTY, **filled},
            questions=tuple(_question(one, site, history, names) for one in _last_asked(site)),
            answers=tuple((k, say(f"desk.answer.{_key(k)}"), say(f"desk.answer_hint.{_key(k)}")) for k in KINDS),
            areas=tuple((a.area_id, a.name) for a in site.areas if a.is_there(local.date(), local.date())),
            targets=_targets(site),
            hours=_hours(site, local.date()),
            now=f"{local:%Y-%m-%dT%H:%M}",
            text_max=TEXT_MAX_CHARS,
            lines=tuple(lines[:LINES_MAX]),
            is_more=len(lines) > LINES_MAX,
            pages=_pages(site, has_index=has_index),
            version=VERSION,
        ),
    )


def render_sign_in(site: Site, *, problem: str = "", writer: str = "", after: str = "") -> str:
    """Return the page to sign in.

    Args:
        site: The site.
        problem: What is wrong with what was sent; empty for nothing.
        writer: Name that was filled in.
        after: Address to go to then.
    """
    title, style = say("desk.sign_in.title", site=site.name), _style()
    page = SignInPage(
        site=site.name,
        title=title,
        style=Markup(style),
        style_hash=policy_hash(style),
        problem=problem,
        writer=writer,
        after=after,
    )
    return rendered("desk/sign_in.html.j2", page)


def render_problem(site: Site, *, problem: str, detail: str) -> str:
    """Return a page that says what could not be done, and why."""
    style = _style()
    page = SignInPage(
        site=site.name,
        title=problem,
        style=Markup(style),
        style_hash=policy_hash(style),
        problem=problem,
        detail=detail,
    )
    return rendered("desk/problem.html.j2", page)


def _last_asked(site: Site) -> tuple[AskedQuestion, ...]:
    """Return the last question of each floor, in the order of the floors."""
    last = {one.floor_id: one for one in read_asked(site)}
    return tuple(last[f.floor_id] for f in site.floors if f.floor_id in last)


def _question(
    one: AskedQuestion, site: Site, history: tuple[HistoryLine, ...], names: Mapping[str, str]
) -> DeskQuestion:
    floors = {f.floor_id: f.name for f in site.floors}
    week = one.monday.isocalendar().week
    key = "week_floor" if len(floors) > 1 else "week"
    answer = next((h for h in history if h.question == one.question_id and not h.is_gone), None)
    return DeskQuestion(
        question_id=one.question_id,
        title=say(f"desk.question.{key}", week=week, floor=floors[one.floor_id]),
        text=one.text,
        given=None if answer is None else _line(answer, names),
    )


def _targets(site: Site) -> tuple[DeskTarget, ...]:
    last = {change.floor_id: (n, change) for n, change in enumerate(read_target_changes(site))}
    targets = []
    for floor in site.floors:
        number, change = last.get(floor.floor_id, (0, None))
        holds = change is not None and change.after == floor.target_per_open_h
        note = ""
        if change is not None and holds:
            before = say("desk.target.none") if change.before is None else f"{change.before:g}"
            note = say("desk.target.said", by=change.by or "", at=fmt.instant_short(change.at), before=before)
        targets.append(
            DeskTarget(
                floor_id=floor.floor_id,
                name=floor.name if len(site.floors) > 1 else "",
                value="" if floor.target_per_open_h is None else f"{floor.target_per_open_h:g}",
                said=note.strip(" ,"),
                undo=str(number) if holds else "",
            )
        )
    return tuple(targets)


def _hours(site: Site, today: date) -> DeskHours:
    monday = today - timedelta(days=today.weekday())
    last = site.opening_changes[-1].opening if site.opening_changes else site.opening
    spans = in_words(last) if last is not None else dict.fromkeys(WEEKDAYS, "00:00-24:00")
    days = tuple((key, fmt.weekday(monday + timedelta(days=k)), spans[key]) for k, key in enumerate(WEEKDAYS))
    changes = tuple(
        (
            c.first.isoformat(),
            say("desk.hours.since", day=fmt.date_short(c.first), by=c.by or "").strip(" ,"),
            c.first >= monday,
        )
        for c in reversed(site.opening_changes)
    )
    return DeskHours(days=days, first=f"{monday + timedelta(days=7)}", changes=changes[:3])


def _line(line: HistoryLine, names: Mapping[str, str]) -> DeskLine:
    return DeskLine(
        line=line.line,
        kind=say(f"desk.kind.{_key(line.kind)}"),
        at="" if line.at is None else fmt.instant_short(line.at),
        text=line.text,
        about=say("desk.whole_site") if line.area_id is None else names.get(line.area_id, line.area_id),
        by=line.by or "",
        can_undo=line.undo is not None,
        is_gone=line.is_gone,
    )


def _pages(site: Site, *, has_index: bool) -> tuple[tuple[str, str], ...]:
    """Return address and name of the pages of each floor, and of the index."""
    several = len(site.floors) > 1
    pages = []
    for floor in site.floors:
        for kind in ("page", "planner"):
            name = say(f"desk.pages.{kind}_floor" if several else f"desk.pages.{kind}", floor=floor.name)
            pages.append((f"/desk/weeks/last/floors/{floor.floor_id}/{kind}", name))
        name = say("desk.pages.now_floor" if several else "desk.pages.now", floor=floor.name)
        pages.append((f"/desk/now/{floor.floor_id}", name))
        name = say("desk.pages.places_floor" if several else "desk.pages.places", floor=floor.name)
        pages.append((f"/desk/places/{floor.floor_id}", name))
    return (*pages, *([("/desk/sites/index.html", say("desk.pages.sites"))] if has_index else []))


def _key(kind: str) -> str:
    return kind.replace("-", "_")


def _style() -> str:
    return shipped_style("report.css") + shipped_style("desk.css")
