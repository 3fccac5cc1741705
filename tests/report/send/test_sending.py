"""Mail against real SMTP servers on this machine: encrypted or not at all, tried again only where that is safe."""

from __future__ import annotations

import socket
import ssl
import stat
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from email import message_from_bytes, policy
from email.message import EmailMessage
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from report import sample_weeks as weeks

from vsd_analytics.errors import MailError
from vsd_analytics.report.pages.mail import as_bytes, make_mail
from vsd_analytics.report.send.mail_server import PASSWORD_VARIABLE, password_of, send
from vsd_analytics.site.routes import MailRoute

controller = pytest.importorskip("aiosmtpd.controller", reason="aiosmtpd is not installed")
smtp = pytest.importorskip("aiosmtpd.smtp")

TO = ("manager@example.org", "analyst@example.org")


@cache
def sample_mail() -> EmailMessage:
    """Return a mail of a normal week, made when it is first asked for: its picture takes half a second."""
    return make_mail(weeks.normal(), sender="reports@example.org", to=TO)


class Inbox:
    """Takes mails; refuses the addresses it is told to."""

    def __init__(self, refused: dict[str, str] | None = None, data: Sequence[str] = ()) -> None:
        self.refused, self.answers = refused or {}, list(data)
        self.mails: list[tuple[str, list[str], bytes]] = []

    async def handle_RCPT(self, server: Any, session: Any, envelope: Any, address: str, options: Any) -> str:
        if address in self.refused:
            return self.refused[address]
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        if self.answers:
            answer = self.answers.pop(0)
            if not answer.startswith("250"):
                return answer
        self.mails.append((envelope.mail_from, envelope.rcpt_tos, envelope.content))
        return "250 taken"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


@contextmanager
def server(inbox: Inbox, *, tls: ssl.SSLContext | None = None, **options: Any) -> Iterator[int]:
    kind = controller.Controller
    port = free_port()
    running = kind(inbox, hostname="127.0.0.1", port=port, tls_context=tls, **options)
    running.start()
    try:
        yield port
    finally:
        running.stop()


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> tuple[ssl.SSLContext, Path]:
    """A certificate of an authority nobody knows, and that authority's own."""
    trustme = pytest.importorskip("trustme", reason="trustme is not installed")
    ca = trustme.CA()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    ca.issue_cert("localhost", "127.0.0.1").configure_cert(context)
    file = tmp_path_factory.mktemp("ca") / "ca.pem"
    ca.cert_pem.write_to_path(str(file))
    return context, file


def route(port: int, **more: Any) -> MailRoute:
    return replace(MailRoute(sender="reports@example.org", to=TO, smtp="127.0.0.1", port=port, tls="none"), **more)


def refusal(call: Callable[[], Any]) -> MailError:
    with pytest.raises(MailError) as caught:
        call()
    assert caught.value.fix
    return caught.value


def no_sleep(_: float) -> None:
    """Wait for nothing."""


def test_what_arrives_is_the_file_byte_for_byte() -> None:
    inbox = Inbox()
    with server(inbox) as port:
        sent = send(sample_mail(), route=route(port), to=TO)
    assert (sent.accepted, sent.refused) == (TO, {})
    [(sender, to, content)] = inbox.mails
    assert (sender, tuple(to)) == ("reports@example.org", TO)
    assert content.rstrip() == as_bytes(sample_mail()).rstrip()
    assert message_from_bytes(content, policy=policy.default)["Message-ID"] == sample_mail()["Message-ID"]


def test_a_line_of_one_dot_does_not_end_the_mail() -> None:
    inbox = Inbox()
    mail = make_mail(weeks.normal(), sender="a@example.org", to=TO)
    mail.get_body(("plain",)).set_content("before\r\n.\r\n..\r\nafter\r\n", cte="7bit")  # type: ignore[union-attr]
    with server(inbox) as port:
        send(mail, route=route(port), to=TO)
    [(_, _, content)] = inbox.mails
    assert b"before\r\n.\r\n..\r\nafter\r\n" in content


@pytest.mark.parametrize("kind", ["starttls", "tls"])
def test_login_over_an_own_authority(authority: tuple[ssl.SSLContext, Path], kind: str) -> None:
    context, file = authority
    seen: list[tuple[bytes, bytes]] = []

    def check(server: Any, session: Any, envelope: Any, mechanism: str, data: Any) -> Any:
        seen.append((data.login, data.password))
        return smtp.AuthResult(success=data.password == b"right", handled=False)

    inbox = Inbox()
    with tls_server(inbox, context, kind=kind, authenticator=check, auth_required=True) as port:
        there = route(port, tls=kind, user="vsd", ca_file=file)
        assert send(sample_mail(), route=there, to=TO, password="right").accepted == TO
        wrong = refusal(lambda: send(sample_mail(), route=there, to=TO, password="wrong"))
    assert wrong.code == "E805"
    assert "wrong" not in (wrong.why or "") + wrong.what
    assert len(inbox.mails) == 1
    assert (b"vsd", b"right") in seen


@contextmanager
def tls_server(inbox: Inbox, context: ssl.SSLContext, *, kind: str, **options: Any) -> Iterator[int]:
    if kind == "starttls":
        with server(inbox, tls=context, require_starttls=True, **options) as port:
            yield port
        return
    port = free_port()
    options["auth_require_tls"] = False  # it cannot see that the whole connection is encrypted
    running = controller.Controller(inbox, hostname="127.0.0.1", port=port, ssl_context=context, **options)
    running.start()
    try:
        yield port
    finally:
        running.stop()


@pytest.mark.parametrize("kind", ["starttls", "tls"])
def test_a_certificate_of_nobody_known_is_refused(authority: tuple[ssl.SSLContext, Path], kind: str) -> None:
    inbox = Inbox()
    with tls_server(inbox, authority[0], kind=kind) as port:
        error = refusal(lambda: send(sample_mail(), route=route(port, tls=kind, user="vsd"), to=TO, password="secret"))
    assert error.code == "E804"
    assert inbox.mails == []


def test_a_server_without_starttls_hears_no_password() -> None:
    inbox = Inbox()
    with server(inbox) as port:
        error = refusal(
            lambda: send(sample_mail(), route=route(port, tls="starttls", user="vsd"), to=TO, password="secret")
        )
    assert (error.code, inbox.mails) == ("E804", [])


def test_one_refused_recipient_does_not_keep_the_mail_from_the_others() -> None:
    inbox = Inbox({TO[1]: "550 5.1.1 no such user"})
    with server(inbox) as port:
        sent = send(sample_mail(), route=route(port), to=TO)
    assert sent.accepted == TO[:1]
    assert sent.refused == {TO[1]: "550 5.1.1 no such user"}
    assert [to for _, to, _ in inbox.mails] == [[TO[0]]]


def test_all_recipients_refused_is_an_error_with_the_servers_words() -> None:
    inbox = Inbox(dict.fromkeys(TO, "550 go away"))
    with server(inbox) as port:
        error = refusal(lambda: send(sample_mail(), route=route(port), to=TO))
    assert error.code == "E806"
    assert "go away" in (error.why or "")


def test_later_is_tried_again_and_never_is_not() -> None:
    waits: list[float] = []
    inbox = Inbox(data=["451 busy", "452 full", "250 taken"])
    with server(inbox) as port:
        send(sample_mail(), route=route(port), to=TO, sleep=waits.append, waits_s=(1, 2))
        assert (waits, len(inbox.mails)) == ([1, 2], 1)
        inbox.answers = ["554 spam"]
        error = refusal(lambda: send(sample_mail(), route=route(port), to=TO, sleep=waits.append))
    assert (error.code, len(waits), len(inbox.mails)) == ("E806", 2, 1)


def test_nobody_listens() -> None:
    waits: list[float] = []
    error = refusal(lambda: send(sample_mail(), route=route(free_port()), to=TO, sleep=waits.append, waits_s=(1, 2, 4)))
    assert (error.code, waits) == ("E803", [1, 2, 4])


class Scripted:
    """A server that says what it is told to, and is silent or gone at the word it is told to."""

    def __init__(self, stops_at: str, *, hangs: bool) -> None:
        self.stops_at, self.hangs, self.heard = stops_at, hangs, 0
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]
        self._done = threading.Event()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def close(self) -> None:
        self._done.set()
        self._socket.close()

    def wait_until_heard(self, n: int, *, timeout_s: float = 30.0) -> None:
        """Wait until so many connections were accepted."""
        until_s = time.monotonic() + timeout_s
        while self.heard < n and time.monotonic() < until_s:
            time.sleep(0.01)

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                threading.Thread(target=self._talk, args=(connection,), daemon=True).start()

    def _talk(self, connection: socket.socket) -> None:
        self.heard += 1
        with connection, connection.makefile("rwb") as lines, suppress(OSError):

            def say(word: str, text: bytes) -> bool:
                if word == self.stops_at:
                    if self.hangs:
                        self._done.wait(30)
                    return False
                lines.write(text + b"\r\n")
                lines.flush()
                return True

            if not say("banner", b"220 here"):
                return
            for line in lines:
                word = line[:4].decode("ascii", "replace").strip().upper()
                if word == "DATA":
                    if not say("DATA", b"354 go on"):
                        return
                    while lines.readline() not in (b".\r\n", b""):
                        pass
                    if not say("end", b"250 taken"):
                        return
                elif not say(word, b"250 ok"):
                    return


@pytest.mark.parametrize("hangs", [True, False], ids=["slow", "gone"])
@pytest.mark.parametrize("stops_at", ["banner", "EHLO", "MAIL", "RCPT", "DATA"])
def test_what_surely_did_not_arrive_is_tried_again(stops_at: str, hangs: bool) -> None:
    there = Scripted(stops_at, hangs=hangs)
    try:
        error = refusal(
            lambda: send(sample_mail(), route=route(there.port), to=TO, timeout_s=0.2, sleep=no_sleep, waits_s=(0,))
        )
        there.wait_until_heard(2)  # a busy machine may accept a connection after the sender gave it up
    finally:
        there.close()
    assert (error.code, there.heard) == ("E803", 2)


@pytest.mark.parametrize("hangs", [True, False], ids=["slow", "gone"])
def test_what_may_have_arrived_is_never_tried_again(hangs: bool) -> None:
    there = Scripted("end", hangs=hangs)
    try:
        error = refusal(
            lambda: send(sample_mail(), route=route(there.port), to=TO, timeout_s=0.2, sleep=no_sleep, waits_s=(0, 0))
        )
    finally:
        there.close()
    assert (error.code, there.heard) == ("E807", 1)


def program(folder: Path, body: str) -> Path:
    file = folder / "sendmail"
    file.write_text(f"#!/bin/sh\n{body}\n")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return file


def test_the_mail_program_gets_the_mail_and_its_recipients(tmp_path: Path) -> None:
    there = MailRoute(
        sender="reports@example.org", sendmail=program(tmp_path, f'echo "$@" > {tmp_path}/said; cat > {tmp_path}/mail')
    )
    assert send(sample_mail(), route=there, to=TO).accepted == TO
    assert (tmp_path / "said").read_text().split() == ["-i", "-f", "reports@example.org", "--", *TO]
    assert (tmp_path / "mail").read_bytes() == as_bytes(sample_mail()).replace(b"\r\n", b"\n")


@pytest.mark.parametrize(
    ("body", "code", "n_tries"),
    [
        ("echo x >> tries; echo no such host >&2; exit 68", "E808", 1),
        ("echo x >> tries; exit 75", "E808", 3),
        ("echo x >> tries; exec sleep 30", "E807", 1),
    ],
)
def test_a_mail_program_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, code: str, n_tries: int
) -> None:
    monkeypatch.chdir(tmp_path)
    there = MailRoute(sender="reports@example.org", sendmail=program(tmp_path, body))
    error = refusal(lambda: send(sample_mail(), route=there, to=TO, timeout_s=0.5, sleep=no_sleep))
    assert error.code == code
    assert len((tmp_path / "tries").read_text().split()) == n_tries
    missing = replace(there, sendmail=tmp_path / "none")
    assert refusal(lambda: send(sample_mail(), route=missing, to=TO)).code == "E808"


def test_the_password_comes_from_the_environment_or_the_first_line_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "password"
    here = route(25, tls="tls", user="vsd", password_file=file)
    assert password_of(here, environ={PASSWORD_VARIABLE: "from outside"}) == "from outside"
    assert refusal(lambda: password_of(here, environ={})).code == "E802"
    file.write_text("  \n")
    assert refusal(lambda: password_of(here, environ={})).code == "E802"
    file.write_text("of the file\nsecond line\n")
    assert password_of(here, environ={}) == "of the file"
    assert password_of(route(25), environ={PASSWORD_VARIABLE: "unused"}) is None
