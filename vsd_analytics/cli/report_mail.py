"""`vsd report --mail` and `--send`: the week as an `.eml` file, handed to the server of `[mail]`, to nobody twice."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import click

from vsd_analytics.cli.output import render_error
from vsd_analytics.cli.project import Project
from vsd_analytics.cli.report_formats import ReportFiles, pdf_or_none, write
from vsd_analytics.errors import MailError, ReportError, UsageError, VsdError

if TYPE_CHECKING:
    from email.message import EmailMessage

    from vsd_analytics.report.send.sent_mails import Week
    from vsd_analytics.site.routes import MailRoute


@dataclass(frozen=True, slots=True, kw_only=True)
class MailOptions:
    """What the command line says about the mail; where it says nothing, `checked` takes sender and `to` from `[mail]`.

    Attributes:
        sender: `--from`.
        to: `--to`.
        is_sent: `--send`.
        is_again: `--again`.
        subject: `--subject`.
        is_zipped: `--zip`.
    """

    sender: str | None
    to: tuple[str, ...]
    is_sent: bool
    is_again: bool
    subject: str | None = None
    is_zipped: bool = False


def checked(project: Project, options: MailOptions) -> MailOptions:
    """Return the options with sender and recipients, refusing what cannot be sent before anything is computed.

    Raises:
        UsageError: E101, an address is none.
        MailError: E801, nothing to send by, from or to; E802, no password.
    """
    from vsd_analytics.config.routes import is_address
    from vsd_analytics.report.send.mail_server import password_of

    for address in (*([options.sender] if options.sender else []), *options.to):
        if not is_address(address):
            raise UsageError(f"{address!r} is no mail address", fix="manager@example.org, without name and quotes")
    route = project.site.mail
    sender = options.sender or (route.sender if route else None)
    to = tuple(dict.fromkeys(options.to or (route.to if route else ())))
    if options.is_sent:
        if route is None:
            raise _cannot_send("vsd.toml has no [mail]", 'smtp = "mail.example.org", from = "...", to = ["..."]')
        if not to:
            raise _cannot_send("there is nobody to send it to", 'to = ["manager@example.org"], or --to')
        password_of(route, environ=os.environ)
    return replace(options, sender=sender, to=to)


def _cannot_send(what: str, fix: str) -> MailError:
    return MailError(what, code="E801", fix=f"in vsd.toml: [mail] {fix}; without --send the mail is only written")


def mail_week(project: Project, files: ReportFiles, *, options: MailOptions, out: Path) -> Path:
    """Write the mail of one report and, if asked, send it.

    Returns:
        The `.eml` file.

    Raises:
        MailError: E803 to E809; the `.eml` file is written all the same.
    """
    from vsd_analytics.report.pages.mail import Attachment, as_bytes, make_mail
    from vsd_analytics.report.send.sent_mails import Week

    attachments = []
    pdf = pdf_or_none(files)
    if isinstance(pdf, ReportError):
        click.echo(render_error(_no_pdf(pdf), word="warning"), err=True)
    else:
        attachments.append(Attachment(name=pdf[0], kind="pdf", data=pdf[1]))
    if options.is_zipped:
        attachments.append(Attachment(name=f"{files.stem}.zip", kind="zip", data=zipped(files.of("html"))))
    base = project.site.base_url
    mail = make_mail(
        files.report,
        sender=options.sender,
        to=options.to,
        subject=options.subject,
        date=project.now.astimezone(project.site.zone) if options.is_sent else None,
        link=None if base is None else f"{base}/{quote(files.stem)}.html",
        attachments=attachments,
    )
    [path] = write(out, {f"{files.stem}.eml": as_bytes(mail)})
    if options.is_sent and project.site.mail is not None:
        week = Week(floor_id=files.report.site.floor_id, week=files.report.week.iso)
        send(project, mail, week, route=project.site.mail, to=options.to, is_again=options.is_again)
    return path


def zipped(files: dict[str, bytes]) -> bytes:
    """Return files as a zip archive: the same bytes for the same files."""
    out = io.BytesIO()
    with ZipFile(out, "w", compression=ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data in files.items():
            entry = ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = ZIP_DEFLATED
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            archive.writestr(entry, data)
    return out.getvalue()


def late(project: Project, files: ReportFiles, *, week: str) -> VsdError | None:
    """Return the warning that `--week last` is older than the last week of the clock, as data are missing; or None."""
    if not week.startswith("last"):
        return None
    today = project.now.astimezone(project.site.zone).date()
    back = int(week.partition("-")[2] or 0)
    expected = today - timedelta(days=today.weekday() + 7 * (1 + back))
    if files.report.week.monday >= expected:
        return None
    year, number, _ = expected.isocalendar()
    return VsdError(
        f"week {year}-W{number:02d} has no data yet: {week} is {files.report.week.iso}",
        code="W800",
        fix=f"vsd doctor, vsd coverage; to mail it as it is: --week {year}-W{number:02d}",
    )


def _no_pdf(error: ReportError) -> VsdError:
    return VsdError(f"the mail has no PDF: {error.what}", code="W801", why=error.why, fix=error.fix)


def send(
    project: Project, mail: EmailMessage, week: Week, *, route: MailRoute, to: tuple[str, ...], is_again: bool
) -> None:
    """Send a mail to those of its recipients who do not have it, and note who has.

    Raises:
        MailError: E803 to E809; what was sent is noted.
    """
    from vsd_analytics.report.send import mail_server
    from vsd_analytics.report.send.sent_mails import FILE, FOLDER, SentLog, to_send

    folder = project.root / FOLDER
    folder.mkdir(mode=0o700, exist_ok=True)
    identity = str(mail["Message-ID"])
    now: datetime = project.now
    with SentLog(folder / FILE) as log:
        left, has = to_send(log, week, to, is_again=is_again)
        for address in has:
            is_other = log.message_id(week, address) != identity
            changed = "; its figures or words have changed since: --again sends it again" if is_other else ""
            project.say(f"{address} has {week.week} already{changed}")
        if not left:
            return
        log.note(week, dict.fromkeys(left, "begun"), message_id=identity, at=now)
        try:
            password = mail_server.password_of(route, environ=os.environ)
            sent = mail_server.send(mail, route=route, to=left, password=password)
        except MailError as error:
            if error.code != "E807":
                log.note(week, dict.fromkeys(left, "not sent"), message_id=identity, at=now)
            raise
        log.note(week, dict.fromkeys(sent.accepted, "sent"), message_id=identity, at=now)
        if sent.refused:
            log.note(week, dict.fromkeys(sent.refused, "not sent"), message_id=identity, at=now)
    project.say(f"{week.week} sent to {', '.join(sent.accepted)}")
    if sent.refused:
        raise MailError(
            f"the mail server refuses {', '.join(sent.refused)}",
            code="E806",
            why="; ".join(f"{a}: {why}" for a, why in sent.refused.items()),
            fix="correct [mail] to, then run the same command again: only these are tried, the others have it",
        )
