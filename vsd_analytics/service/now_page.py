"""The live page: a few large words for a wall or a phone, which asks its server for itself every minute."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Literal

from markupsafe import Markup

from vsd_analytics.figures.now import Fullest, Now, QueueNow, SilentNow
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.share.now import Band
from vsd_analytics.planner.script import one_script
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Site
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say, template
from vsd_analytics.wording.reasons import reason_text

SCRIPTS: Final = ("now.js",)
Tone = Literal["above", "below", "within", "plain"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NowPage:
    """Everything the template may use; each field is one variable.

    Attributes:
        site, floor: Names; the floor is empty where the site has only one.
        title: Title of the window.
        at: The clock.
        clock: The same in words.
        headline: How many people there are, beside what is usual.
        tone: How the headline is drawn.
        details: Sentences below it.
        queues: Name, how many wait, and how that is drawn, of each queue.
        advice: What to do next; empty for nothing.
        record: How often that was right.
        cameras: Sentences on cameras.
        has_silent: A camera is silent.
        pages: Address and name of the other floors' pages, and of the desk where it is shown there.
        notes: How to read the page.
        away: What the script says when the server is away, with its place `{n}` unfilled.
        style, style_hash, script, script_hash: The page's only style and script, and what the policy allows.
        is_made_up: The data are those of `vsd demo`.
        is_exact: The site hides nothing.
        version: The program's.
    """

    site: str
    floor: str
    title: str
    at: datetime
    clock: str
    headline: str
    tone: Tone
    details: tuple[str, ...]
    queues: tuple[tuple[str, str, Tone], ...]
    advice: str
    record: str
    cameras: tuple[str, ...]
    has_silent: bool
    pages: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    away: str
    style: Markup
    style_hash: str
    script: Markup
    script_hash: str
    is_made_up: bool
    is_exact: bool
    version: str


def now_policy() -> str:
    """Return the content security policy of the page: its own style and script, and its server."""
    return (
        f"default-src 'none'; style-src 'sha256-{policy_hash(_style())}'; "
        f"script-src 'sha256-{policy_hash(one_script(SCRIPTS))}'; img-src data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def render_now(
    floor_now: Now | None, site: Site, *, floor_id: str, at: datetime, folder: str = "/now", is_made_up: bool = False
) -> str:
    """Return the live page of a floor, in the language in force.

    Args:
        floor_now: The numbers; None = nothing is stored yet.
        site: The site.
        floor_id: The floor.
        at: The clock, in the site's zone.
        folder: Address below which the pages of floors are.
        is_made_up: The data are those of `vsd demo`.
    """
    mask, several = mask_of(site), len(site.floors) > 1
    headline, tone, details = _headline(floor_now, site)
    style, script = _style(), one_script(SCRIPTS)
    notes = [say("now.renewed", n=mask.below) if mask.is_on else say("now.renewed_exact")]
    if floor_now is not None and floor_now.data_until is not None:
        notes.insert(0, say("now.data_until", clock=fmt.clock(floor_now.data_until)))
    advice, record = _advice(floor_now)
    page = NowPage(
        site=site.name,
        floor=next(f.name for f in site.floors if f.floor_id == floor_id) if several else "",
        title=say("now.title", site=site.name, clock=fmt.clock(at), headline=headline),
        at=at,
        clock=say("today.as_of", day=fmt.date_short(at.date()), clock=fmt.clock(at)),
        headline=headline,
        tone=tone,
        details=details,
        queues=() if floor_now is None else tuple(_queue(queue) for queue in floor_now.queues),
        advice=advice,
        record=record,
        cameras=() if floor_now is None else _cameras(floor_now, site),
        has_silent=floor_now is not None and bool(floor_now.silent),
        pages=tuple(_pages(site, floor_id, folder)),
        notes=tuple(notes),
        away=template("now.away"),
        style=Markup(style),
        style_hash=policy_hash(style),
        script=Markup(script),
        script_hash=policy_hash(script),
        is_made_up=is_made_up,
        is_exact=not mask.is_on,
        version=VERSION,
    )
    return rendered("now.html.j2", page)


def _headline(floor_now: Now | None, site: Site) -> tuple[str, Tone, tuple[str, ...]]:
    """Return what the page says first, how it is drawn, and the sentences below it."""
    if floor_now is None:
        return say("now.h_empty"), "plain", (say("now.empty"),)
    if not floor_now.is_open and not floor_now.was_open:
        return say("now.h_closed"), "plain", _opens(floor_now)
    if not floor_now.was_open:
        return (
            say("now.h_opened", clock=fmt.clock(floor_now.start + timedelta(minutes=15))),
            "plain",
            (say("now.opened"),),
        )
    if floor_now.data_until is None:
        return say("now.h_nothing"), "plain", (say("now.silent"),)
    if len(floor_now.silent) == floor_now.n_cameras:
        return say("now.h_late", clock=fmt.clock(floor_now.data_until)), "plain", (say("now.silent"),)
    if floor_now.people is None:
        return say("now.h_unknown"), "plain", (say("now.because", reason=terms.capital(reason_text(floor_now.reason))),)
    headline, tone = _people(floor_now.people)
    end = floor_now.start + timedelta(minutes=15)
    seen = say("now.until", start=fmt.clock(floor_now.start), end=fmt.clock(end))
    return headline, tone, (_usual(floor_now), seen)


def _opens(floor_now: Now) -> tuple[str, ...]:
    if floor_now.opens is None:
        return ()
    return (say("now.opens", day=fmt.date_short(floor_now.opens.date()), clock=fmt.clock(floor_now.opens)),)


def _people(band: Band) -> tuple[str, Tone]:
    if band.crowd is None:
        return say("now.h_about", n=fmt.count(band.about)), "plain"
    tone: Tone = "within" if band.crowd == "few" else band.crowd
    return say(f"now.h_{band.crowd}", n=band.below), tone


def _usual(floor_now: Now) -> str:
    band = floor_now.people
    assert band is not None
    if band.hi is None:
        reason = floor_now.reason
        return say("now.usual_hour_unknown") if reason is None else say("now.usual_unknown", reason=reason_text(reason))
    key = "now.usual" if band.lo is not None else "now.usual_up_to"
    weekday = fmt.weekday(floor_now.start.date())
    return say(key, low=fmt.count(band.lo), high=fmt.count(band.hi), weekday=weekday)


def _queue(queue: QueueNow) -> tuple[str, str, Tone]:
    band = queue.band
    if band is None:
        return queue.name, say("now.q_unknown"), "plain"
    if band.crowd is None:
        return queue.name, say("now.q_about", n=fmt.count(band.about)), "plain"
    if band.crowd == "few":
        return queue.name, say("now.q_few", n=band.below), "plain"
    tone: Tone = "above" if band.crowd == "above" else "plain"
    assert band.hi is not None
    limit = fmt.count(band.hi) if band.hi == round(band.hi) else fmt.number(band.hi)
    return queue.name, say(f"now.q_{band.crowd}", n=limit), tone


def _advice(floor_now: Now | None) -> tuple[str, str]:
    """Return the instruction and its record; nothing while the site is closed, or without a record."""
    named: Fullest | None = None if floor_now is None or not floor_now.is_open else floor_now.fullest
    if floor_now is None or named is None:
        return "", ""
    is_now = named.hour == floor_now.at.hour
    clock = fmt.hour_label((named.hour + 1) % 24 if is_now else named.hour)
    record = say("now.record", n=named.n_right, of=named.n_days, weekday=fmt.weekday(floor_now.at.date()))
    return say("now.fullest_now" if is_now else "now.fullest", clock=clock), terms.capital(record)


def _cameras(floor_now: Now, site: Site) -> tuple[str, ...]:
    if not floor_now.was_open:
        return ()
    if not floor_now.silent:
        return (say("now.camera_all", plural=floor_now.n_cameras, n=floor_now.n_cameras),)
    return tuple(_silent(floor_now.silent, site))


def _silent(cameras: Sequence[SilentNow], site: Site) -> list[str]:
    names = {c.camera_id: c.name for c in site.cameras}
    return [
        say("now.camera_today", camera=names[c.camera_id])
        if c.last is None
        else say("now.camera_since", camera=names[c.camera_id], clock=fmt.clock(c.last))
        for c in cameras
    ]


def _pages(site: Site, floor_id: str, folder: str) -> list[tuple[str, str]]:
    desk = [("/desk", say("desk.pages.desk"))] if folder.startswith("/desk/") else []
    return [*desk, *((f"{folder}/{f.floor_id}", f.name) for f in site.floors if f.floor_id != floor_id)]


def _style() -> str:
    return shipped_style("report.css") + shipped_style("now.css")
