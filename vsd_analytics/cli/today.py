"""`vsd today`: the card of the day, for a phone and a mail."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import exact_option, json_option, language_option
from vsd_analytics.cli.output import emit_json, rounded
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import nothing_stored, warehouse_of
from vsd_analytics.errors import UsageError, Where
from vsd_analytics.site.places import named_floors

if TYPE_CHECKING:
    from vsd_analytics.cli.report_mail import MailOptions
    from vsd_analytics.figures.today import Today


@click.command()
@click.option("--floor", "floor_id", metavar="FLOOR", help="Only this floor (default: one card for each).")
@click.option("--out", metavar="DIR", help="Folder to write to (default: operator/ of the project).")
@click.option("--open", "is_opened", is_flag=True, help="Open the card in a browser.")
@click.option("--mail", "is_mailed", is_flag=True, help="Write the card as a mail, .eml (in mail/ of the project).")
@click.option("--send", "is_sent", is_flag=True, help="Send it by [mail] of vsd.toml, to nobody twice a day.")
@click.option("--to", "to", metavar="ADDRESS", multiple=True, help="Who it goes to (default: [mail] to); repeatable.")
@click.option("--from", "sender", metavar="ADDRESS", help="Who it comes from (default: [mail] from).")
@click.option("--again", "is_again", is_flag=True, help="Send it even to those who have today's card.")
@click.option("--publish", "is_published", is_flag=True, help="Publish the figures at [mqtt] figures_topic.")
@exact_option
@language_option
@json_option
@pass_project
def today(
    project: Project,
    floor_id: str | None,
    out: str | None,
    is_opened: bool,
    is_mailed: bool,
    is_sent: bool,
    to: tuple[str, ...],
    sender: str | None,
    is_again: bool,
    is_published: bool,
    as_json: bool,
) -> int:
    """Write the card of the day: yesterday and today so far, silent cameras, what to expect until tomorrow.

    The card that it prints and writes is the operator's, with exact counts of single hours: do not share it. What is
    mailed or published is of days that are over, in round numbers; with --exact, it is the operator's card too.

    A day is compared with the same hours of the same weekday in the twelve weeks before. Hours count when they are
    over. The exit code is 1 when a camera sends no data. With --now before the command, the card is that of an earlier
    instant.

    --publish puts the figures of each floor on its topic below figures_topic, as a retained message. With
    home_assistant = true in [mqtt], Home Assistant finds them as sensors. Run it every hour, five minutes past.

    \b
    Example:
      vsd today --open
      vsd today --send
      vsd today --exact --publish
      vsd --now 2026-11-14T14:20+01:00 today
    """
    from vsd_analytics.cli import report_mail

    project.speak()
    is_mailed = is_mailed or is_sent
    if is_published:
        _check_topic(project)
    if as_json and (is_mailed or out is not None or is_opened):
        raise UsageError("--json prints the figures and nothing else", fix="vsd today --json")
    if not is_mailed and (to or sender or is_again):
        raise UsageError("--to, --from and --again go with a mail", fix="--mail, or --mail --send")
    options = report_mail.MailOptions(sender=sender, to=to, is_sent=is_sent, is_again=is_again)
    mail = report_mail.checked(project, options) if is_mailed else None
    cards, inputs = _today(project, floor_id)
    if is_published:
        _publish(project, cards)
    if as_json:
        emit_json(rounded({"today": [_card_json(project, card, inputs) for card in cards]}))
    else:
        paths = [path for card in cards for path in _write(project, card, out, mail)]
        if is_opened:
            click.launch(str(paths[0]))
    return 1 if any(card.silent for card in cards) else 0


def _check_topic(project: Project) -> None:
    broker = project.site.broker
    if broker is None or broker.figures_topic is None:
        raise UsageError(
            "there is no topic to publish to",
            where=Where(str(project.root / "vsd.toml")),
            fix='add figures_topic = "vsd/shop/today" to [mqtt]',
        )


def _publish(project: Project, cards: list[Today]) -> None:
    """Publish the figures of each floor, and announce them to Home Assistant if it is asked for."""
    import json
    import os

    from vsd_analytics.errors import LiveError
    from vsd_analytics.figures.share.days import closed_days
    from vsd_analytics.live.day_topics import day_figures, day_topic
    from vsd_analytics.live.delivery import Publisher
    from vsd_analytics.live.home_assistant import discovery_messages
    from vsd_analytics.live.mqtt import password_of

    site, broker = project.site, project.site.broker
    assert broker is not None
    floors = {f.floor_id: f for f in site.floors}
    messages: dict[str, dict[str, Any]] = {}
    for card in cards:
        floor = floors[card.floor_id or site.floors[0].floor_id]
        messages |= discovery_messages(site, broker, floor) if broker.is_home_assistant else {}
        messages[day_topic(broker, floor)] = day_figures(closed_days(card, site), site, floor)
    with Publisher(broker, password=password_of(broker, environ=os.environ), what="figures") as publish:
        lost = [t for t, message in messages.items() if not publish(t, json.dumps(message).encode(), retain=True)]
    if lost:
        raise LiveError(f"the broker did not acknowledge {lost[0]}", code="E710", fix="may this user publish there?")
    project.say(f"{len(messages)} messages published below {broker.figures_topic}")


def _card_json(project: Project, card: Today, inputs: str) -> dict[str, Any]:
    from vsd_analytics.figures.today_answers import today_answers
    from vsd_analytics.render.json_form import as_json

    answers = today_answers(card, project.site, inputs=inputs)
    return {
        "at": card.at.isoformat(),
        "floor_id": card.floor_id,
        "n_cameras": card.n_cameras,
        "answers": {answer.name: as_json(answer) for answer in answers},
    }


def _today(project: Project, floor_id: str | None) -> tuple[list[Today], str]:
    from vsd_analytics.figures import today as figures
    from vsd_analytics.warehouse.stored_days import stored_extent

    site = project.site
    floors = named_floors(site, floor_id)
    at: datetime = project.now.astimezone(site.zone)
    if stored_extent(site) is None:
        raise nothing_stored(project)
    read = ("camera_hours", "camera_slots", "track_hours")
    days = f"{figures.first_day(at)}..{at.date()}"
    with warehouse_of(project, week=None, days=days, relations=read) as warehouse:
        warehouse.materialise(*read)
        return [figures.today(warehouse, at, floor_id=f) for f in floors], warehouse.inputs_digest


def _write(project: Project, card: Today, out: str | None, options: MailOptions | None) -> list[Path]:
    """Print a card, write its page and, with options of a mail, its mail; return the files."""
    from vsd_analytics.cli import report_mail
    from vsd_analytics.cli.report_formats import write
    from vsd_analytics.figures.share.days import closed_days
    from vsd_analytics.figures.today import first_day
    from vsd_analytics.report.pages.mail import as_bytes, filled
    from vsd_analytics.report.pages.today import make_today_page, today_html, today_mail
    from vsd_analytics.report.send.sent_mails import FOLDER, Week
    from vsd_analytics.warehouse.provenance import are_made_up, engines

    site = project.site
    sent_by = engines(site, first_day(card.at), card.at.date())
    is_made_up = are_made_up(sent_by)
    page = make_today_page(card, site, is_made_up=is_made_up)
    click.echo(filled("today_mail.txt.j2", page).partition("\n-- \n")[0])
    floor = "" if len(site.floors) == 1 else f"-{card.floor_id}"
    folder = project.pages(out, is_operators=True)
    paths = write(folder, {f"today{floor}.html": today_html(page).encode()})
    if options is not None:
        date = project.now.astimezone(site.zone) if options.is_sent else None
        shared = make_today_page(closed_days(card, site), site, is_made_up=is_made_up)
        mail = today_mail(shared, sender=options.sender, to=options.to, date=date)
        target = Path(out) if out is not None else project.root / FOLDER
        paths += write(target, {f"today{floor}.eml": as_bytes(mail)})
    for path in paths:
        click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB")
    if options is not None and options.is_sent and site.mail is not None:
        day = Week(floor_id=card.floor_id or "", week=card.at.date().isoformat())
        report_mail.send(project, mail, day, route=site.mail, to=options.to, is_again=options.is_again)
    return paths
