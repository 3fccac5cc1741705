"""Sends a mail by SMTP or by the machine's mail program. Encrypted where it logs in, or not at all.

What is tried again is only what is known not to have arrived. A server that took the whole mail and then did not answer
may have delivered it or not. The error E807 reports this, and the mail is not sent again automatically.
"""

from __future__ import annotations

import contextlib
import re
import smtplib
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from email.message import EmailMessage
from pathlib import Path
from typing import Final

from vsd_analytics.errors import MailError
from vsd_analytics.report.pages.mail import as_bytes
from vsd_analytics.site.routes import MailRoute

PASSWORD_VARIABLE: Final = "VSD_MAIL_PASSWORD"
TIMEOUT_S: Final = 60.0
WAITS_S: Final = (2.0, 10.0)
"""Waits before the second and the third try of what may pass."""
_TEMPFAIL: Final = 75


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """What became of a mail.

    Attributes:
        accepted: Addresses the server took it for.
        refused: Why it did not take it for others, by address.
    """

    accepted: tuple[str, ...]
    refused: Mapping[str, str]


class _PassingError(Exception):
    """The mail was not taken, and may be later."""

    def __init__(self, error: MailError) -> None:
        super().__init__(error.what)
        self.error = error


def send(
    mail: EmailMessage,
    *,
    route: MailRoute,
    to: Sequence[str],
    password: str | None = None,
    timeout_s: float = TIMEOUT_S,
    waits_s: Sequence[float] = WAITS_S,
    sleep: Callable[[float], None] = time.sleep,
) -> Sent:
    """Hand a mail over for some of its recipients.

    Args:
        mail: The mail.
        route: `[mail]`.
        to: Addresses it is handed over for; they may be fewer than the mail names.
        password: Of `route.user`; see `password_of`.
        timeout_s: Longest wait for an answer of the server or the end of the program.
        waits_s: Waits before further tries.
        sleep: Waits.

    Returns:
        Who it was taken for, and who not; at least one was accepted.

    Raises:
        MailError: E803 not reachable, E804 no encryption, E805 login refused, E806 refused, E808 the program failed:
            nothing was sent. E807: not known whether it was sent.
    """
    hand_over = _by_program if route.sendmail is not None else _by_smtp
    for wait_s in (*waits_s, None):
        try:
            return hand_over(mail, route=route, to=to, password=password, timeout_s=timeout_s)
        except _PassingError as later:
            if wait_s is None:
                raise later.error from None
            sleep(wait_s)
    raise AssertionError("the last try returns or raises")


def password_of(route: MailRoute, *, environ: Mapping[str, str]) -> str | None:
    """Return the password of `route.user`: VSD_MAIL_PASSWORD, else the first line of `password_file`.

    Raises:
        MailError: E802, there is a user and no password, or the file cannot be read.
    """
    if route.user is None:
        return None
    if environ.get(PASSWORD_VARIABLE):
        return environ[PASSWORD_VARIABLE]
    if route.password_file is None:
        raise _no_password(f"neither {PASSWORD_VARIABLE} nor password_file is set")
    try:
        lines = route.password_file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise _no_password(str(error)) from None
    if not lines or not lines[0].strip():
        raise _no_password(f"the first line of {route.password_file} is empty")
    return lines[0].strip()


def _no_password(why: str) -> MailError:
    return MailError(
        "the password of the mail server cannot be read",
        code="E802",
        why=why,
        fix=f'export {PASSWORD_VARIABLE}=..., or in [mail]: password_file = "/etc/vsd/mail-password" (chmod 600)',
    )


def _by_smtp(
    mail: EmailMessage, *, route: MailRoute, to: Sequence[str], password: str | None, timeout_s: float
) -> Sent:
    with _connected(route, timeout_s=timeout_s) as server:
        try:
            if route.user is not None:
                server.login(route.user, password or "")
            code, reply = server.mail(route.sender)
            if code != 250:
                raise _refusal(f"{route.sender} as the sender", code, reply)
            answers = {address: server.rcpt(address) for address in to}
            accepted = tuple(a for a, (code, _) in answers.items() if code in (250, 251))
            refused = {a: _answer(*answers[a]) for a in to if a not in accepted}
            if not accepted:
                first = answers[to[0]]
                raise _refusal("every recipient: " + "; ".join(f"{a} ({why})" for a, why in refused.items()), *first)
        except smtplib.SMTPAuthenticationError as error:
            raise _login_refused(route, _answer(error.smtp_code, error.smtp_error)) from None
        except smtplib.SMTPNotSupportedError as error:
            raise _login_refused(route, str(error)) from None
        except (OSError, smtplib.SMTPException) as error:
            raise _PassingError(_unreachable(route, error)) from None
        _transmit(server, as_bytes(mail), route)
        return Sent(accepted=accepted, refused=refused)


def _transmit(server: smtplib.SMTP, data: bytes, route: MailRoute) -> None:
    """Send the mail itself; only a failure after its last byte leaves open whether it arrived."""
    try:
        code, reply = server.docmd("DATA")
        if code != 354:
            raise _refusal("the mail", code, reply)
        server.send(re.sub(rb"(?m)^\.", b"..", data).removesuffix(b"\r\n") + b"\r\n.\r\n")
    except (OSError, smtplib.SMTPException) as error:
        raise _PassingError(_unreachable(route, error)) from None
    try:
        code, reply = server.getreply()
    except (OSError, smtplib.SMTPException) as error:
        raise _unknown(route, error) from None
    if code != 250:
        raise _refusal("the mail", code, reply)


@contextlib.contextmanager
def _connected(route: MailRoute, *, timeout_s: float) -> Iterator[smtplib.SMTP]:
    """Open a connection, encrypted as the route says; say good-bye at the end, whether or not it is heard."""
    assert route.smtp is not None
    server: smtplib.SMTP
    try:
        if route.tls == "tls":
            server = smtplib.SMTP_SSL(
                route.smtp, route.port, local_hostname=_own_name(), timeout=timeout_s, context=_context(route)
            )
        else:
            server = smtplib.SMTP(route.smtp, route.port, local_hostname=_own_name(), timeout=timeout_s)
    except ssl.SSLError as error:
        raise _no_tls(route, _tls_words(error)) from None
    except (OSError, smtplib.SMTPException) as error:
        raise _PassingError(_unreachable(route, error)) from None
    try:
        if route.tls == "starttls":
            _encrypt(server, route)
        try:
            server.ehlo_or_helo_if_needed()
        except (OSError, smtplib.SMTPException) as error:
            raise _PassingError(_unreachable(route, error)) from None
        yield server
    finally:
        with contextlib.suppress(OSError, smtplib.SMTPException):
            server.quit()
        server.close()


def _own_name() -> str:
    """Return how this machine calls itself, without asking the network."""
    name = socket.gethostname()
    return name if "." in name and name.isascii() else "[127.0.0.1]"


def _encrypt(server: smtplib.SMTP, route: MailRoute) -> None:
    try:
        server.ehlo()
        if not server.has_extn("starttls"):
            raise _no_tls(route, "the server does not offer STARTTLS")
        server.starttls(context=_context(route))
    except ssl.SSLError as error:
        raise _no_tls(route, _tls_words(error)) from None
    except smtplib.SMTPResponseException as error:
        raise _no_tls(route, _answer(error.smtp_code, error.smtp_error)) from None
    except (OSError, smtplib.SMTPException) as error:
        raise _PassingError(_unreachable(route, error)) from None


def _context(route: MailRoute) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=None if route.ca_file is None else str(route.ca_file))
    except (OSError, ssl.SSLError) as error:
        raise _no_tls(route, f"the certificates of ca_file cannot be read: {error}") from None


def _by_program(
    mail: EmailMessage, *, route: MailRoute, to: Sequence[str], password: str | None, timeout_s: float
) -> Sent:
    assert route.sendmail is not None
    del password
    command = [str(route.sendmail), "-i", "-f", route.sender, "--", *to]
    data = as_bytes(mail).replace(b"\r\n", b"\n")
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        raise _unknown(route, f"it did not end within {timeout_s:g} s") from None
    except OSError as error:
        raise _program_failed(route.sendmail, str(error.strerror or error)) from None
    if done.returncode != 0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        words = lines[-1][:300] if lines else "it said nothing"
        failed = _program_failed(route.sendmail, f"it ended with {done.returncode}: {words}")
        raise _PassingError(failed) if done.returncode == _TEMPFAIL else failed
    return Sent(accepted=tuple(to), refused={})


def _answer(code: int, reply: bytes | str) -> str:
    text = reply.decode("utf-8", "replace") if isinstance(reply, bytes) else reply
    return f"{code} {' '.join(text.split())}"[:300]


def _refusal(what: str, code: int, reply: bytes | str) -> Exception:
    """Return the error of a refusal; one that says "later" (4xx) may be tried again."""
    error = MailError(
        f"the mail server refuses {what}",
        code="E806",
        why=_answer(code, reply),
        fix="the server's own words stand above; addresses stand under [mail] from and to. Nothing was sent",
    )
    return _PassingError(error) if 400 <= code < 500 else error


def _place(route: MailRoute) -> str:
    return str(route.sendmail) if route.sendmail is not None else f"{route.smtp}:{route.port}"


def _unreachable(route: MailRoute, error: Exception) -> MailError:
    why = "it did not answer in time" if isinstance(error, TimeoutError | socket.timeout) else str(error)
    return MailError(
        f"the mail server {_place(route)} cannot be reached",
        code="E803",
        why=why or type(error).__name__,
        fix="are smtp and port of [mail] right, is it running, does a firewall stand between? Nothing was sent: run "
        "the same command again later",
    )


def _no_tls(route: MailRoute, why: str) -> MailError:
    return MailError(
        f"no encrypted connection to the mail server {_place(route)}",
        code="E804",
        why=why,
        fix='[mail] tls = "starttls" goes with port 587, "tls" with 465; a certificate of your own authority: '
        'ca_file = "tls/ca.pem"; smtp must be the name in the certificate. Nothing was sent',
    )


def _tls_words(error: ssl.SSLError) -> str:
    return str(getattr(error, "verify_message", "") or error.reason or error)


def _login_refused(route: MailRoute, why: str) -> MailError:
    return MailError(
        f"the mail server refuses the login of {route.user}",
        code="E805",
        why=why,
        fix=f"check [mail] user, and the password in {PASSWORD_VARIABLE} or password_file; many providers want a "
        "password made for programs. Nothing was sent",
    )


def _unknown(route: MailRoute, why: Exception | str) -> MailError:
    return MailError(
        f"{_place(route)} took the mail and did not say whether it will deliver it",
        code="E807",
        why=str(why) or type(why).__name__,
        fix="ask a recipient; if it did not come: the same command with --again",
    )


def _program_failed(program: Path, why: str) -> MailError:
    return MailError(
        "the mail program did not take the mail",
        code="E808",
        why=why,
        fix='in a unit of systemd: [mail] smtp = "localhost" and tls = "none" in place of sendmail; '
        f"else run it by hand: echo test | {program} you@example.org; its log tells more. Nothing was sent",
    )
