"""What `vsd doctor` and messages say of owners of files, of the weekly mail, and of files that were read."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics import owners
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.doctor.checks import examine
from vsd_analytics.doctor.finding import Finding
from vsd_analytics.ingest.intake.watched_folders import note_watched

NOW = datetime(2026, 11, 20, 12, tzinfo=UTC)
MAIL = '[mail]\nsmtp = "localhost"\ntls = "none"\nfrom = "vsd@example.org"\nto = ["Anna@example.org"]\n'


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "vsd.toml").write_text(site_text(more=MAIL), encoding="utf-8")
    return tmp_path


def found(root: Path, subject: str, *, now: datetime = NOW) -> list[Finding]:
    return [f for f in examine(root, now=now, environ={}) if f.subject == subject]


def mailed(root: Path, *lines: tuple[str, str, str]) -> None:
    (root / "mail").mkdir(exist_ok=True)
    rows = [{"floor": "ground", "week": w, "to": to, "step": step, "message_id": "<1>"} for w, to, step in lines]
    (root / "mail" / "sent.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")


def page(root: Path, week: str) -> None:
    (root / "reports").mkdir(exist_ok=True)
    (root / "reports" / f"{week}.html").touch()


@pytest.mark.parametrize("step", ["begun", "not sent"])
def test_a_week_that_did_not_reach_somebody_needs_you(root: Path, step: str) -> None:
    mailed(root, ("2026-W45", "anna@example.org", "sent"), ("2026-W46", "anna@example.org", step))
    (finding,) = found(root, "mail")
    assert finding.state == "needs you"
    assert "2026-W46" in finding.detail
    assert "anna@example.org" in finding.detail
    assert finding.fix is not None
    assert finding.fix.startswith("vsd report --week 2026-W46 --mail --send")


def test_a_week_that_was_sent_at_last_is_well_and_an_address_that_was_corrected_is_not_asked_for(root: Path) -> None:
    mailed(
        root,
        ("2026-W46", "anna@example.org", "not sent"),
        ("2026-W46", "old@example.org", "not sent"),
        ("2026-W46", "anna@example.org", "sent"),
        ("2026-11-20", "anna@example.org", "not sent"),  # the card of a day
    )
    (finding,) = found(root, "mail")
    assert finding.state == "ok"


def test_a_page_that_nobody_was_sent_is_noted_with_what_a_timer_needs(root: Path) -> None:
    assert found(root, "mail") == []
    page(root, "2026-W46")
    (finding,) = found(root, "mail")
    assert finding.state == "note"
    assert finding.fix is not None
    assert "VSD_REPORT" in finding.fix
    mailed(root, ("2026-W46", "anna@example.org", "sent"))
    assert [f.state for f in found(root, "mail")] == ["ok"]


def test_read_files_older_than_the_records_may_be_need_you(root: Path) -> None:
    done = root / "inbox" / "done"
    done.mkdir(parents=True)
    (done / "a.csv").touch()
    note_watched(root, root / "inbox")
    now = datetime.now(tz=UTC)
    assert found(root, "read files", now=now) == []
    (finding,) = found(root, "read files", now=now + timedelta(days=31))
    assert finding.state == "needs you"
    assert (finding.fix, str(done) in finding.detail) == ("vsd purge --older-than retention", True)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_files_of_another_user_than_the_project_need_you(root: Path) -> None:
    (root / "facts").mkdir()
    (root / "facts" / "a").touch()
    assert found(root, "owner") == []
    os.chown(root / "facts" / "a", 12345, -1)
    (finding,) = found(root, "owner")
    assert finding.detail == "1 file belongs to another user than the project: facts/a"
    assert finding.fix is not None
    assert finding.fix.endswith(f": {root}")


def test_a_file_that_cannot_be_read_is_a_finding_and_not_the_end(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise PermissionError(13, "Permission denied", str(root / "log.jsonl"))

    monkeypatch.setattr("vsd_analytics.config.change_log.read_log", refuse)
    (finding,) = found(root, "files")
    assert finding.state == "needs you"
    assert "log.jsonl" in finding.detail
    assert found(root, "vsd.toml")


def test_a_refused_file_says_whose_it_is_and_who_asks(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = root / "log.jsonl"
    log.touch()
    me = os.geteuid()

    def refuse(_: object) -> None:
        raise PermissionError(13, "Permission denied", str(log))

    monkeypatch.setattr("vsd_analytics.config.change_log.read_log", refuse)
    monkeypatch.setattr("os.geteuid", lambda: me + 12345)
    assert run(cli, ["-C", str(root), "log", "list"]) == 2
    said = capsys.readouterr().err
    assert "E120" in said
    assert f"belongs to {owners.user_name(me)}, and this runs as {me + 12345}" in said
    assert f"chown {me + 12345}: {log}" in said


def test_what_a_folder_refuses_is_not_given_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    me = os.geteuid()
    monkeypatch.setattr("os.geteuid", lambda: me + 1)
    for path in (tmp_path, tmp_path / "none"):
        why, fix = owners.denied(PermissionError(13, "Permission denied", str(path)))
        assert why is not None
        assert f"the folder {tmp_path} belongs to" in why
        assert "chown" not in fix


def test_root_is_warned_in_the_project_of_another_user(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vsd_analytics.cli.project.other_owner", lambda _: "vsd")
    monkeypatch.setattr("os.geteuid", lambda: 0)
    assert run(cli, ["-C", str(root), "log", "list"]) == 0
    said = capsys.readouterr().err
    assert said.count("W111") == 2  # the warning, and where to read more
    assert "runuser -u vsd -- vsd" in said
    assert f"chown -R vsd: {root}" in said
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    run(cli, ["-C", str(root), "log", "list"])
    assert "W111" not in capsys.readouterr().err
