"""`vsd failed`: a unit that failed is mailed with its last lines, to `failures_to`, else to `to`."""

from __future__ import annotations

import io
import sys
from email import message_from_bytes, policy
from pathlib import Path

import pytest
from report.send.test_sending import Inbox, server
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

UNIT = "vsd-report@shop.service"
MAIL = """
[mail]
smtp = "127.0.0.1"
port = {port}
tls = "none"
from = "reports@example.org"
"""


def failed(folder: Path, more: str, printed: str, monkeypatch: pytest.MonkeyPatch, *, language: str = "en") -> int:
    text = site_text("cam-1").replace("[site]\n", f'[site]\nlanguage = "{language}"\n')
    (folder / "vsd.toml").write_text(text + more, encoding="utf-8")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(printed.encode())))
    return run(cli, ["-C", str(folder), "--now", "2026-11-16T06:00+01:00", "failed", UNIT])


@pytest.mark.parametrize(
    ("more", "to"),
    [
        ('to = ["manager@example.org"]', ["manager@example.org"]),
        ('to = ["manager@example.org"]\nfailures_to = ["it@example.org"]', ["it@example.org"]),
        ('failures_to = ["it@example.org"]', ["it@example.org"]),
    ],
)
def test_the_mail_has_the_unit_and_its_last_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: str, to: list[str]
) -> None:
    inbox = Inbox()
    printed = "".join(f"line {k}\n" for k in range(100)) + "error[E304]: the disk is full\x1b[2J\n"
    with server(inbox) as port:
        assert failed(tmp_path, MAIL.format(port=port) + more, printed, monkeypatch) == 0
    [(_, sent_to, content)] = inbox.mails
    assert sent_to == to
    mail = message_from_bytes(content, policy=policy.default)
    text = mail.get_content()
    assert UNIT in mail["Subject"]
    assert "error[E304]: the disk is full" in text
    assert "\x1b" not in text
    assert "line 99" in text
    assert "line 40" not in text, "the last 60 lines"
    assert str(tmp_path) in text


def test_it_is_written_in_the_language_of_the_site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inbox = Inbox()
    with server(inbox) as port:
        failed(tmp_path, MAIL.format(port=port) + 'to = ["a@example.org"]', "", monkeypatch, language="it")
    assert "non è riuscito" in message_from_bytes(inbox.mails[0][2], policy=policy.default).get_content()


def test_an_address_that_is_refused_does_not_keep_the_mail_from_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    inbox = Inbox(refused={"gone@example.org": "550 no such user"})
    with server(inbox) as port:
        more = MAIL.format(port=port) + 'to = ["gone@example.org", "it@example.org"]'
        assert failed(tmp_path, more, "", monkeypatch) == 2
    assert [to for _, to, _ in inbox.mails] == [["it@example.org"]]
    assert "550 no such user" in capsys.readouterr().err


@pytest.mark.parametrize("more", ["", MAIL.format(port=25)])
def test_where_nobody_is_named_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], more: str
) -> None:
    assert failed(tmp_path, more, "", monkeypatch) == 1
    assert "nothing was sent" in capsys.readouterr().err
