"""`vsd alarms`: the alarms of stored days, and whether those of the listener arrive."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import date, datetime
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option, language_option
from vsd_analytics.cli.output import count, emit_json, progress, render_error, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import LiveError, UsageError
from vsd_analytics.site.instants import parse_range

if TYPE_CHECKING:
    from vsd_analytics.answer import Answers
    from vsd_analytics.figures.alarms import Alarm
    from vsd_analytics.live.alarm_observer import LiveAlarms
    from vsd_analytics.live.delivery import AlarmSender
    from vsd_analytics.live.events import AlarmEvent
    from vsd_analytics.site.model import AlarmRule

_PATIENCE_S = 15.0


@click.command()
@click.argument("days", required=False, metavar="[RANGE]")
@click.option("--rule", "rule_ids", metavar="ID", multiple=True, help="Only this rule; repeat for several.")
@click.option("--events", "as_events", is_flag=True, help="Print every event as a JSON line, as it is delivered.")
@click.option("--deliver", is_flag=True, help="Send what was not sent before: alarms.jsonl, webhook, topic.")
@click.option("--test", "is_test", is_flag=True, help="Send one made-up event to the webhook and topic, and stop.")
@click.option("--page", "is_page", is_flag=True, help="Write the page of these alarms.")
@click.option("--out", metavar="DIR", help="Folder to write the page to (default: operator/ of the project).")
@click.option("--open", "is_opened", is_flag=True, help="Open the page in a browser.")
@language_option
@json_option
@pass_project
def alarms(
    project: Project,
    /,
    days: str | None,
    rule_ids: tuple[str, ...],
    as_events: bool,
    deliver: bool,
    is_test: bool,
    is_page: bool,
    out: str | None,
    is_opened: bool,
    as_json: bool,
) -> int:
    """Apply the rules of [[alarm]] to stored days and list their alarms. vsd listen sends them live.

    RANGE is a day, DAY..DAY or an ISO week; without it the last stored day is replayed.

    --page writes operator/2026-W46-alarms.html: the alarms by rule, by day and hour, the longest, and how many there
    would be if a rule waited longer (for_s). It shows single hours and small groups: do not share it. --json prints the
    same figures.

    \b
    Example:
      vsd alarms
      vsd alarms 2026-W46 --page --open
      vsd alarms 2026-W46 --rule queue-too-full --json
      vsd alarms 2026-11-11 --events
      vsd alarms --test
    """
    if is_test:
        _test(project)
        project.say("the sample arrived")
        return 0
    is_page = is_page or out is not None or is_opened
    if is_page + as_json + as_events > 1:
        raise UsageError("--page, --json and --events are three outputs", fix="vsd alarms --page")
    if deliver and (is_page or as_json):
        raise UsageError("--deliver sends events, and goes with the table or with --events", fix="vsd alarms --deliver")
    rules = _rules(project, rule_ids)
    if is_page or as_json:
        project.speak()
        answers = _answers(project, days, rules)
        if as_json:
            _print_json(answers)
        else:
            _write_page(project, answers, out, is_opened=is_opened)
        return 0
    events = _replay(project, days, rules) if rules else []
    is_delivered = _deliver(project, events) if deliver else True
    if as_events:
        import json

        for event in events:
            click.echo(json.dumps(event.as_dict(project.site.zone), ensure_ascii=False))
    elif not rules:
        click.echo("vsd.toml has no [[alarm]]: docs/alarms.md shows how to write one")
    else:
        from vsd_analytics.live.events import alarms_of

        _print_table(project, alarms_of(events, project.site.zone))
    return 0 if is_delivered else 1


@contextmanager
def live_alarms(project: Project, *, clock: Callable[[], datetime]) -> Iterator[LiveAlarms | None]:
    """Open the alarms of a listener; None when the site has no rules."""
    site = project.site
    if not site.alarms:
        yield None
        return
    from vsd_analytics.live.alarm_observer import LiveAlarms
    from vsd_analytics.live.delivery import FILE, AlarmLog, AlarmSender, webhook_of

    webhook = webhook_of(site.alarm_delivery, environ=os.environ)
    delivery = AlarmSender(site, log=AlarmLog(project.root / FILE), webhook=webhook)
    alarms = LiveAlarms(site, delivery=delivery, clock=clock, report=project.say)
    try:
        yield alarms
    finally:
        alarms.stop()


def _rules(project: Project, rule_ids: Sequence[str]) -> list[AlarmRule]:
    from vsd_analytics.errors import nearest

    known = {r.alarm_id: r for r in project.site.alarms}
    for rule_id in rule_ids:
        if rule_id not in known:
            near = nearest(rule_id, known)
            raise UsageError(
                f"vsd.toml has no alarm {rule_id!r}",
                why=f"its alarms: {', '.join(known) or 'none'}",
                fix=f"--rule {near}" if near else None,
            )
    return [r for r in known.values() if not rule_ids or r.alarm_id in rule_ids]


def _replay(project: Project, days: str | None, rules: Sequence[AlarmRule]) -> list[AlarmEvent]:
    from vsd_analytics.live.stored_frames import replay
    from vsd_analytics.warehouse.stored_days import calendar_days

    first, last = _range(project, days)
    runs = calendar_days(project.site, first, last, spare_days=0)
    total = sum((run.last_day - run.first_day).days + 1 for run in runs) * 86400
    with progress(None, total=total, label="replaying", unit=" s", quiet=project.quiet) as bar:
        options = {"rules": rules, "now": project.now, "on_time": bar.update}
        return [e for run in runs for e in replay(project.site, run.first_day, run.last_day, **options)]


def _range(project: Project, days: str | None) -> tuple[date, date]:
    from vsd_analytics.cli.ranges import nothing_stored
    from vsd_analytics.warehouse.stored_days import stored_extent

    if days is not None:
        return parse_range(days)
    extent = stored_extent(project.site)
    if extent is None:
        raise nothing_stored(project)
    return extent.last_day, extent.last_day


def _answers(project: Project, days: str | None, rules: Sequence[AlarmRule]) -> Answers:
    from vsd_analytics.figures.alarms import alarm_answers
    from vsd_analytics.live.alarm_days import alarm_days

    first, last = _range(project, days)
    total = ((last - first).days + 1) * 86400
    with progress(None, total=total, label="replaying", unit=" s", quiet=project.quiet) as bar:
        replayed_days = alarm_days(project.site, first, last, rules=rules, now=project.now, on_time=bar.update)
    return alarm_answers(replayed_days, project.site)


def _print_json(answers: Answers) -> None:
    from vsd_analytics.cli.answers import answers_json

    holds = answers["alarms"].holds_for
    emit_json(answers_json(answers, days=(holds.first, holds.last), notes=()))


def _write_page(project: Project, answers: Answers, out: str | None, *, is_opened: bool) -> None:
    """Write the page of alarms, and print its headline and its file."""
    from vsd_analytics.cli.report_formats import write
    from vsd_analytics.figures.week.results import WeekRef
    from vsd_analytics.report.pages.alarms import alarm_html, make_alarm_page
    from vsd_analytics.warehouse.provenance import are_made_up, engines

    site, holds = project.site, answers["alarms"].holds_for
    is_made_up = are_made_up(engines(site, holds.first, holds.last))
    page = make_alarm_page(answers, site, is_made_up=is_made_up)
    week = WeekRef.of(holds.first, zone=site.timezone)
    if (holds.first, holds.last) != (week.monday, week.sunday) or week.monday.weekday():
        week = WeekRef.of_days(holds.first, holds.last, zone=site.timezone)
    folder = project.pages(out, is_operators=True)
    [path] = write(folder, {f"{week.iso}-alarms.html": alarm_html(page).encode()})
    click.echo(page.headline)
    click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB")
    if is_opened:
        click.launch(str(path))


def _print_table(project: Project, alarms: Sequence[Alarm]) -> None:
    if not alarms:
        click.echo("no alarms")
        return
    rows = [("since", "lasted", "rule", "where", "what")]
    rows += [(f"{a.since:%Y-%m-%d %H:%M:%S}", _lasted(a), a.rule_id, _where(a), _what(a)) for a in alarms]
    click.echo("\n".join(table(rows)))
    click.echo(f"{count(len(alarms), 'alarm')}, times in {project.site.timezone}")


def _lasted(alarm: Alarm) -> str:
    hours, minutes = divmod(int(alarm.lasted_s) // 60, 60)
    duration = f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {int(alarm.lasted_s) % 60:02d} s"
    return duration if alarm.ended else f"{duration}, open"


def _where(alarm: Alarm) -> str:
    place = f" at {alarm.x_m:.1f}, {alarm.y_m:.1f} m" if alarm.x_m is not None else ""
    return f"{alarm.area_id + ', ' if alarm.area_id else ''}{alarm.camera_id}{place}"


def _what(alarm: Alarm) -> str:
    if alarm.kind == "silence":
        return "camera silent"
    what = f"up to {alarm.n_people_max} people" if alarm.kind == "gathering" else "contact"
    return f"{what}, nearest {alarm.nearest_m:.2f} m"


def _deliver(project: Project, events: Sequence[AlarmEvent]) -> bool:
    """Send events that were not sent before; return whether all arrived, after saying what did not."""
    from vsd_analytics.live.delivery import FILE, AlarmLog

    with _delivery(project, log=AlarmLog(project.root / FILE)) as delivery:
        sent = delivery.send(events)
        problem = _problem(delivery)
    project.say(f"{len(sent):,} events sent, {len(events) - len(sent):,} were sent before")
    if problem is not None:
        click.echo(render_error(problem, word="warning"), err=True)
    return problem is None


def _test(project: Project) -> None:
    """Send a sample.

    Raises:
        UsageError: E101, there is neither a webhook nor a topic.
        LiveError: E710, it did not arrive.
    """
    from vsd_analytics.live.events import AlarmEvent

    site = project.site
    if site.alarm_delivery.webhook is None and site.alarm_delivery.topic is None:
        fix = 'add [alarms] with webhook = "https://..." or topic = "..."'
        raise UsageError("there is nowhere to send a sample", why="vsd.toml names no webhook and no topic", fix=fix)
    now_ms, camera = round(project.now.timestamp() * 1000), site.cameras[0]
    head = ("0" * 16, "test", "gathering", "start", now_ms, now_ms - 60_000)
    place = (site.site_id, camera.camera_id, camera.floor_id, None, 0.0, 0.0)
    sample = AlarmEvent(*head, *place, n_people=4, n_people_max=4, nearest_mm=1500)  # type: ignore[arg-type]
    with _delivery(project, log=None) as delivery:
        delivery.send([sample])
        problem = _problem(delivery)
    if problem is not None:
        raise problem


@contextmanager
def _delivery(project: Project, *, log: Any) -> Iterator[AlarmSender]:
    """Open the ways out; LiveError E710 when the broker cannot be reached."""
    from vsd_analytics.live.delivery import AlarmSender, Publisher, webhook_of
    from vsd_analytics.live.mqtt import password_of

    site = project.site
    with ExitStack() as stack:
        publisher = None
        if site.alarm_delivery.topic is not None and site.broker is not None:
            password = password_of(site.broker, environ=os.environ)
            publisher = stack.enter_context(Publisher(site.broker, password=password))
        webhook = webhook_of(site.alarm_delivery, environ=os.environ)
        delivery = AlarmSender(site, log=log, webhook=webhook)
        delivery.publish = publisher
        yield delivery


def _problem(delivery: AlarmSender) -> LiveError | None:
    """Wait for what is on its way; return what went wrong, or None when all arrived."""
    why = [f"alarms.jsonl: {delivery.error}"] if delivery.n_unlogged else []
    if delivery.n_unpublished:
        why.append(f"topic: {delivery.n_unpublished} events were not acknowledged by the broker")
    webhook = delivery.webhook
    if webhook is not None:
        is_done = webhook.stop(timeout_s=_PATIENCE_S)
        if not is_done or webhook.n_refused or webhook.n_dropped:
            n_lost = webhook.n_waiting + webhook.n_refused + webhook.n_dropped
            why.append(f"webhook: {n_lost} events not taken: {webhook.refusal or webhook.error or 'no answer'}")
    if not why:
        return None
    return LiveError("alarms did not arrive", code="E710", why="; ".join(why), fix="fix it, then: vsd alarms --test")
