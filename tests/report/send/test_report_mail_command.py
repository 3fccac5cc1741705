"""`vsd report` end to end: all formats from one model; the mail goes to everybody once, whatever happens between."""

from __future__ import annotations

import json
import stat
import zipfile
from collections.abc import Callable
from datetime import date, datetime
from email import message_from_bytes, policy
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from report import ingested_worlds as w
from report.send.test_sending import Inbox, Scripted, free_port, server

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages import story
from vsd_analytics.report.send import mail_server
from vsd_analytics.site.model import Site

MAIL = """
[mail]
smtp = "127.0.0.1"
port = PORT
tls = "none"
from = "reports@example.org"
to = ["manager@example.org", "analyst@example.org"]
"""
BOTH = ["manager@example.org", "analyst@example.org"]
WEEK = ("report", "--week", "2026-W46")


def busy(day: int, hour: int) -> dict[w.Place, int]:
    return {w.QUEUE: 20 + day, w.DOOR: 12 + day % 4, w.AISLE: 9 + (day * 5) % 4}


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Site:
    site = w.world(tmp_path_factory.mktemp("shop"), w.toml(), w.messages(busy, monday=w.BEFORE), w.messages(busy))
    w.report(site)
    return site


@pytest.fixture(scope="module")
def known(shop: Site) -> Callable[..., WeekReport]:
    """Compute each week once: these tests are about what becomes of it."""
    real = story.week_report
    made: dict[Any, WeekReport] = {}

    def week_report(site: Site, monday: date, *, floor_id: str, now: datetime | None, **more: Any) -> WeekReport:
        key = monday, floor_id, now
        if key not in made:
            made[key] = real(site, monday, floor_id=floor_id, now=now, **more)
        return made[key]

    return week_report


@pytest.fixture
def project(shop: Site, known: Callable[..., WeekReport], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shop without mail, without a browser, and without waiting between tries."""
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.delenv("VSD_CHROMIUM", raising=False)
    monkeypatch.setattr("vsd_analytics.report.pages.pdf.MAC_APPS", ())
    monkeypatch.setattr(story, "week_report", known)
    monkeypatch.setattr("vsd_analytics.report.pages.mail.map_picture", lambda report: None)
    monkeypatch.setattr(mail_server.send, "__kwdefaults__", {**(mail_server.send.__kwdefaults__ or {}), "waits_s": ()})
    for path in shop.root.glob("mail/*"):
        path.unlink()
    configure(shop.root, "")
    return shop.root


def configure(root: Path, more: str, port: int = 0) -> None:
    (root / "vsd.toml").write_text(w.toml(more=more.replace("PORT", str(port))), encoding="utf-8")


def vsd(root: Path, *arguments: str) -> int:
    return run(cli, ["-C", str(root), "--now", "2026-11-16T06:00+01:00", *arguments])


def steps(root: Path) -> list[tuple[str, str]]:
    return [(r["to"], r["step"]) for r in map(json.loads, (root / "mail" / "sent.jsonl").read_text().splitlines())]


def test_all_formats_come_from_one_model(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    real = story.week_report
    monkeypatch.setattr(story, "week_report", lambda *a, **k: made.append(1) or real(*a, **k))
    assert vsd(project, *WEEK, "--format", "html,json,csv", "--mail", "--out", str(tmp_path)) == 0
    names = {p.name for p in tmp_path.iterdir()}
    assert {"2026-W46.html", "2026-W46.json", "2026-W46-hours.csv", "2026-W46-areas.csv", "2026-W46.eml"} <= names
    assert len(made) == 1
    assert not [n for n in names if n.startswith(".")]


def test_all_says_what_is_missing_and_goes_on(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vsd(project, *WEEK, "--format", "all", "--out", str(tmp_path)) == 0
    assert "warning[E520]" in capsys.readouterr().err
    assert {p.suffix for p in tmp_path.iterdir()} == {".html", ".json", ".csv"}
    assert vsd(project, *WEEK, "--format", "html,pdf", "--out", str(tmp_path / "none")) == 2
    assert "E520" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("kind", ["svg", "png"])
def test_one_figure(project: Path, tmp_path: Path, kind: str, capsysbinary: pytest.CaptureFixture[bytes]) -> None:
    asked = (*WEEK, "--format", kind, "--figure", "when", "--out")
    assert vsd(project, *asked, str(tmp_path)) == 0
    capsysbinary.readouterr()
    assert vsd(project, *asked, "-") == 0
    data = (tmp_path / f"2026-W46-when.{kind}").read_bytes()
    assert capsysbinary.readouterr().out == data
    assert data[:4] in (b"<svg", b"\x89PNG")


@pytest.mark.parametrize(
    "arguments",
    [
        ("--format", "png"),
        ("--figure", "when"),
        ("--format", "html", "--figure", "when"),
        ("--format", "docx"),
        ("--format", "html,json", "--out", "-"),
        ("--to", "a@example.org"),
        ("--again",),
        ("--mail", "--out", "-"),
        ("--mail", "--json"),
        ("--mail", "--to", "nobody"),
        ("--mail", "--from", "a@example.org\r\nBcc: b@example.org"),
        ("--send",),
    ],
)
def test_what_does_not_go_together_is_reported_before_anything_is_made(
    project: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(project.rglob("*"))
    assert vsd(project, *WEEK, *arguments) == 2
    said = capsys.readouterr()
    assert "fix" in said.err + said.out
    assert sorted(p for p in project.rglob("*") if "facts" not in p.parts) == [
        p for p in before if "facts" not in p.parts
    ]


def test_a_mail_is_written_beside_the_reports_not_among_them(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    configure(project, '[report]\nbase_url = "https://intranet.example.org/d"')
    assert vsd(project, *WEEK, "--mail", "--to", "manager@example.org", "--zip") == 0
    assert "warning[W801]" in capsys.readouterr().err
    data = (project / "mail" / "2026-W46.eml").read_bytes()
    mail = message_from_bytes(data, policy=policy.default)
    assert mail["X-Unsent"] == "1"
    assert b"https://intranet.example.org/d/2026-W46.html" in data
    [attached] = list(mail.iter_attachments())  # type: ignore[attr-defined]
    with zipfile.ZipFile(BytesIO(attached.get_content())) as archive:
        assert archive.namelist() == ["2026-W46.html"]
        assert archive.read("2026-W46.html").startswith(b"<!doctype html>")


def test_sent_once_to_each_and_again_only_when_asked(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        assert vsd(project, *WEEK, "--send") == 0
        assert [to for _, to, _ in inbox.mails] == [BOTH]
        assert vsd(project, *WEEK, "--send") == 0
        assert "has 2026-W46 already" in capsys.readouterr().err
        assert vsd(project, *WEEK, "--send", "--subject", "Another") == 0
        assert "--again sends it again" in capsys.readouterr().err
        assert len(inbox.mails) == 1
        assert vsd(project, *WEEK, "--send", "--to", "chief@example.org") == 0
        assert vsd(project, *WEEK, "--send", "--again", "--to", "chief@example.org") == 0
        assert vsd(project, "report", "--week", "2026-W45", "--send") == 0
    assert [to for _, to, _ in inbox.mails] == [BOTH, ["chief@example.org"], ["chief@example.org"], BOTH]
    eml = (project / "mail" / "2026-W45.eml").read_bytes()
    assert inbox.mails[-1][2].rstrip() == eml.rstrip()
    assert message_from_bytes(eml)["Date"] == "Mon, 16 Nov 2026 06:00:00 +0100"
    assert stat.S_IMODE((project / "mail" / "sent.jsonl").stat().st_mode) == 0o600


def test_the_card_of_a_day_goes_to_each_once(project: Path) -> None:
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        for _ in range(2):
            assert vsd(project, "today", "--exact", "--send") == 0
        assert vsd(project, *WEEK, "--send") == 0
    assert [to for _, to, _ in inbox.mails] == [BOTH, BOTH]
    assert message_from_bytes(inbox.mails[0][2])["Date"] == "Mon, 16 Nov 2026 06:00:00 +0100"


def test_only_who_was_refused_is_tried_again(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inbox = Inbox({BOTH[1]: "550 no such user"})
    with server(inbox) as port:
        configure(project, MAIL, port)
        assert vsd(project, *WEEK, "--send") == 2
        said = capsys.readouterr().err
        assert "error[E806]" in said
        assert "analyst@example.org: 550 no such user" in said
        inbox.refused.clear()
        assert vsd(project, *WEEK, "--send") == 0
    assert [to for _, to, _ in inbox.mails] == [[BOTH[0]], [BOTH[1]]]


def test_a_server_that_is_away_gets_it_later(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    configure(project, MAIL, free_port())
    assert vsd(project, *WEEK, "--format", "json", "--send") == 2
    assert "error[E803]" in capsys.readouterr().err
    assert (project / "mail" / "2026-W46.eml").exists()
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        assert vsd(project, *WEEK, "--send") == 0
    assert [to for _, to, _ in inbox.mails] == [BOTH]
    assert [step for _, step in steps(project)] == ["begun"] * 2 + ["not sent"] * 2 + ["begun"] * 2 + ["sent"] * 2


def test_what_may_have_arrived_waits_for_a_human(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = Scripted("end", hangs=False)
    try:
        configure(project, MAIL, there.port)
        assert vsd(project, *WEEK, "--send") == 2
        assert "error[E807]" in capsys.readouterr().err
        assert vsd(project, *WEEK, "--send") == 2
        assert "not known whether" in capsys.readouterr().err
    finally:
        there.close()
    assert there.heard == 1
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        assert vsd(project, *WEEK, "--send") == 2
        assert vsd(project, *WEEK, "--send", "--again") == 0
    assert [to for _, to, _ in inbox.mails] == [BOTH]


def test_a_command_killed_while_it_wrote_leaves_a_line_that_is_passed_over(project: Path) -> None:
    log = project / "mail" / "sent.jsonl"
    log.parent.mkdir(exist_ok=True)
    log.write_bytes(b'{"week": "2026-W46", "floor": "ground", "to": "manager@exam')
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        assert vsd(project, *WEEK, "--send") == 0
        assert vsd(project, *WEEK, "--send") == 0
    assert [to for _, to, _ in inbox.mails] == [BOTH]


def test_a_machine_without_a_browser_mails_all_the_same_and_says_what_is_missing(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        for _ in range(2):
            assert vsd(project, *WEEK, "--format", "html,pdf,json", "--send") == 2
            assert "error[E520]" in capsys.readouterr().err
    assert [to for _, to, _ in inbox.mails] == [BOTH]
    assert (project / "reports" / "2026-W46.json").exists()


def test_two_commands_at_once_do_not_both_send(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from vsd_analytics.report.send.sent_mails import SentLog

    (project / "mail").mkdir(exist_ok=True)
    configure(project, MAIL, free_port())
    with SentLog(project / "mail" / "sent.jsonl"):
        assert vsd(project, *WEEK, "--send") == 2
    assert "error[E809]" in capsys.readouterr().err


def test_late_data_are_reported_and_an_old_week_is_not_sent_twice(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inbox = Inbox()
    with server(inbox) as port:
        configure(project, MAIL, port)
        monday = ["-C", str(project), "--now", "2026-11-16T06:00+01:00", "report", "--week", "last", "--send"]
        assert run(cli, monday) == 0
        monday[3] = "2026-11-23T06:00+01:00"
        assert run(cli, monday) == 1
        assert "warning[W800]: week 2026-W47 has no data yet" in capsys.readouterr().err
    assert [to for _, to, _ in inbox.mails] == [BOTH]
