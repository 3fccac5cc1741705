"""The parts of `vsd.toml` that say where reports and records go: `[mail]`, two keys of `[report]`, and `[exchange]`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final, get_args
from urllib.parse import urlsplit

from vsd_analytics.config.reader import ID_PATTERN, REFUSED, TableReader, suggest_id
from vsd_analytics.site.routes import ExchangeRoute, MailRoute, MailTls

PORTS: Final[dict[MailTls, int]] = {"starttls": 587, "tls": 465, "none": 25}
ADDRESS_MAX_CHARS: Final = 254
_LOCAL = r"[A-Za-z0-9!#$%&'*+/=?^_`{|}~-]+"
_LABEL = r"[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_ADDRESS = re.compile(rf"{_LOCAL}(?:\.{_LOCAL})*@{_LABEL}(?:\.{_LABEL})*")


def is_address(text: str) -> bool:
    """Tell whether a text is a plain mail address, such as `manager@example.org`, and nothing more.

    Only ASCII is taken, since not every server carries other letters; no name, quotes, spaces or line ends.
    """
    return len(text) <= ADDRESS_MAX_CHARS and _ADDRESS.fullmatch(text) is not None


def read_mail(root: TableReader) -> MailRoute | None:
    """Return the route of `[mail]`, or None when there is no such table."""
    if root.raw("mail") is None:
        return None
    table = root.inner("mail")
    for key in ("password", "passwd", "pass"):
        if table.raw(key, REFUSED) is not None:
            table.mistakes.add(
                table.path,  # not the line itself: messages end in logs
                f"[mail] {key}: a password does not belong in vsd.toml",
                code="E124",
                why="the file is copied, mailed and kept in version control",
                fix='put it into the environment variable VSD_MAIL_PASSWORD, or: password_file = "/etc/vsd/mail"',
            )
    smtp = table.text("smtp", example='"mail.example.org"')
    sendmail = _program(table)
    why = 'or, with a mail program: sendmail = "/usr/sbin/sendmail"'
    if (smtp is None) == (sendmail is None) and not {"smtp", "sendmail"} <= set(table.values):
        table.missing("smtp", '"mail.example.org"', why=why, instead="sendmail")
    elif smtp is not None and sendmail is not None:
        table.fault("sendmail", "[mail] has both smtp and sendmail", fix="keep one of the two")
    tls = _tls(table)
    port = table.number("port", minimum=1, maximum=65535, unit="", example=str(PORTS[tls]), whole=True)
    user = table.text("user", example='"reports@example.org"')
    if user is not None and tls == "none":
        table.fault(
            "tls",
            '[mail] user with tls = "none" would send the password for everyone to read',
            fix='tls = "starttls" (port 587) or tls = "tls" (port 465)',
        )
    sender = table.text("from", example='"reports@example.org"', required=True)
    if sender is not None and not is_address(sender):
        table.fault("from", f"[mail] from: {sender!r} is no mail address", fix='from = "reports@example.org"')
    route = MailRoute(
        sender=sender or "",
        to=_recipients(table, "to", example="manager@example.org"),
        failures_to=_recipients(table, "failures_to", example="it@example.org"),
        smtp=smtp,
        port=int(port) if port is not None else PORTS[tls],
        tls=tls,
        user=user,
        password_file=_password_file(table),
        ca_file=table.file("ca_file", example='"tls/ca.pem"'),
        sendmail=sendmail,
    )
    table.close()
    return route


def read_base_url(report: TableReader) -> str | None:
    """Return `[report] base_url`, the address the folder of reports can be read at, without a slash at its end."""
    text = report.text("base_url", example='"https://intranet.example.org/distancing"')
    if text is not None and not _is_web_address(text):
        fix = 'base_url = "https://intranet.example.org/distancing"'
        report.fault("base_url", f"[report] base_url: {text!r} is no http or https address", fix=fix)
        return None
    return None if text is None else text.rstrip("/")


def read_chromium(report: TableReader) -> Path | None:
    """Return `[report] chromium`, the browser that prints the PDF; None = looked for on the PATH."""
    text = report.text("chromium", example='"/usr/bin/chromium"')
    return None if text is None else Path(text)


def _is_web_address(text: str) -> bool:
    try:
        parts = urlsplit(text)
        is_plain = not (parts.query or parts.fragment or parts.username or parts.password)
        return (
            parts.scheme in ("http", "https")
            and bool(parts.hostname)
            and is_plain
            and re.search(r'[\s<>"]', text) is None
        )
    except ValueError:
        return False


def _tls(table: TableReader) -> MailTls:
    kinds: tuple[MailTls, ...] = get_args(MailTls)
    return table.word("tls", kinds, example="starttls", fix="starttls") or "starttls"


def _recipients(table: TableReader, key: str, *, example: str) -> tuple[str, ...]:
    recipients = table.texts(key, example=f'["{example}"]')
    for address in recipients:
        if not is_address(address):
            table.fault(key, f"[mail] {key}: {address!r} is no mail address", fix=f'{key} = ["{example}"]')
    return tuple(dict.fromkeys(recipients))


def _password_file(table: TableReader) -> Path | None:
    """Return the file, which may be missing on this machine, but never lie where the project is copied along."""
    text = table.text("password_file", example='"/etc/vsd/mail-password"')
    if text is None:
        return None
    path = Path(text).expanduser()
    fix = 'password_file = "/etc/vsd/mail-password" (chmod 600)'
    if not path.is_absolute() or path.resolve().is_relative_to(table.folder.resolve()):
        why = "the project is copied, shared and kept in version control"
        table.fault("password_file", "[mail] password_file must lie outside the project", why=why, fix=fix)
        return None
    return path


def _program(table: TableReader) -> Path | None:
    text = table.text("sendmail", example='"/usr/sbin/sendmail"')
    if text is not None and not Path(text).is_absolute():
        fix = 'sendmail = "/usr/sbin/sendmail"'
        table.fault("sendmail", f"[mail] sendmail: {text!r} is no whole path of a program", fix=fix)
        return None
    return None if text is None else Path(text)


_PLACE = '"/mnt/exchange"'


def read_exchange(root: TableReader) -> ExchangeRoute | None:
    """Return where records are handed on or received, or None when there is no `[exchange]`."""
    if root.raw("exchange") is None:
        return None
    table = root.inner("exchange")
    place = table.text("place", example=_PLACE, required=True)
    node = _node(table)
    table.close()
    if place is None:
        return None
    scheme, separator, rest = place.partition("://")
    is_bucket = scheme == "s3" and bool(rest.partition("/")[0]) and bool(rest.partition("/")[2].strip("/"))
    if not is_bucket and (separator or not Path(place).is_absolute()):
        table.fault(
            "place",
            f"[exchange] place {place!r} is neither an absolute path nor s3://BUCKET/FOLDER",
            fix=f'place = {_PLACE} or "s3://exchange/shop"',
        )
    return ExchangeRoute(place, node)


def _node(table: TableReader) -> str | None:
    name = table.text("node", example='"north"')
    table.raw("node", {"type": "string", "pattern": f"^{ID_PATTERN}$"}, example='"north"')
    if name is not None and not re.fullmatch(ID_PATTERN, name):
        why = "it becomes a folder name: a-z, 0-9, - and _, at most 63, first a letter or digit"
        table.fault(
            "node", f"{name!r} cannot be the name of a node", code="E125", why=why, fix=f'node = "{suggest_id(name)}"'
        )
    return name
