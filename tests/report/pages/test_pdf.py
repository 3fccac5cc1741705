"""The PDF: a browser is found or its absence explained, nothing of it stays, and the clock leaves no byte."""

from __future__ import annotations

import re
import stat
import time
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest
from report import sample_weeks as weeks

from vsd_analytics.errors import ReportError
from vsd_analytics.report.pages import pdf
from vsd_analytics.report.pages.pdf import dated, find_chromium, no_chromium, print_pdf
from vsd_analytics.report.pages.week import render_html

CHROMIUM = find_chromium(environ={})
AT = datetime(2026, 11, 16, 6, 0, tzinfo=timezone(timedelta(hours=1)))
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium, Chrome or Edge on this machine")


def fake(folder: Path, body: str) -> Path:
    file = folder / "browser"
    file.write_text(f"#!/bin/sh\n{body}\n")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return file


WRITES = """for a in "$@"; do case "$a" in --print-to-pdf=*) out="${a#--print-to-pdf=}";; esac; done"""


def test_the_browser_that_is_named_wins_and_is_never_replaced(tmp_path: Path) -> None:
    mine, other = fake(tmp_path, "exit 0"), tmp_path / "other"
    other.symlink_to(mine)
    on_path = {"chromium-browser": "/usr/bin/chromium-browser", str(mine): str(mine), str(other): str(other)}
    find = {"which": on_path.get, "mac_apps": ()}
    assert find_chromium(environ={"VSD_CHROMIUM": str(mine)}, configured=other, **find) == mine  # type: ignore[arg-type]
    assert find_chromium(environ={}, configured=other, **find) == other  # type: ignore[arg-type]
    assert find_chromium(environ={}, **find) == Path("/usr/bin/chromium-browser")  # type: ignore[arg-type]
    assert find_chromium(environ={}, which=lambda _: None, mac_apps=(tmp_path / "none", mine)) == mine
    assert find_chromium(environ={}, which=lambda _: None, mac_apps=()) is None
    with pytest.raises(ReportError, match="VSD_CHROMIUM") as caught:
        find_chromium(environ={"VSD_CHROMIUM": "/no/such"}, configured=other, **find)  # type: ignore[arg-type]
    assert caught.value.code == "E520"
    assert "apt install chromium" in (no_chromium().fix or "")


def test_the_browser_sees_one_file_in_an_empty_home_and_no_secret(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSD_MAIL_PASSWORD", "secret")
    monkeypatch.setenv("TZ", "Asia/Kathmandu")
    monkeypatch.setattr(pdf.os, "geteuid", lambda: 1000)
    body = f'{WRITES}; printf "%s\\n" "$@" > {tmp_path}/said; env > {tmp_path}/env; ls "$HOME" > {tmp_path}/home\n'
    made = print_pdf("<p>page</p>", chromium=fake(tmp_path, body + 'printf "%%PDF-1.4 x %%%%EOF" > "$out"'), made_at=AT)
    assert made == b"%PDF-1.4 x %%EOF"
    said, env = (tmp_path / "said").read_text().split("\n"), (tmp_path / "env").read_text()
    assert "secret" not in env
    assert {"TZ=UTC", "LC_ALL=C.UTF-8"} <= set(env.split("\n"))
    assert "--no-sandbox" not in said
    assert "--host-resolver-rules=MAP * ~NOTFOUND" in said
    [profile] = [a.partition("=")[2] for a in said if a.startswith("--user-data-dir=")]
    assert (tmp_path / "home").read_text().split() == ["page.html"]
    assert not Path(profile).parent.exists()
    monkeypatch.setattr(pdf.os, "geteuid", lambda: 0)
    print_pdf("", chromium=fake(tmp_path, body + 'printf "%%PDF-1.4 x %%%%EOF" > "$out"'), made_at=AT)
    assert "--no-sandbox" in (tmp_path / "said").read_text()


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("echo no display >&2; exit 3", "it ended with 3: no display"),
        ("exit 0", "it wrote no PDF"),
        (f'{WRITES}; printf "%%PDF-1.4 broken off" > "$out"', "it wrote no PDF"),
        ("sleep 30 & echo $! > child; wait", "it did not end within 0.5 s"),
    ],
)
def test_a_browser_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, why: str) -> None:
    browser = fake(tmp_path, f"cd {tmp_path}; {body}")
    with pytest.raises(ReportError) as caught:
        print_pdf("", chromium=browser, made_at=AT, timeout_s=0.5)
    assert caught.value.code == "E521"
    assert why in (caught.value.why or "")
    if (tmp_path / "child").exists():
        status = Path("/proc") / (tmp_path / "child").read_text().strip() / "status"
        assert any(is_gone(status) or time.sleep(0.1) for _ in range(100))  # a killed process may need a moment to die


def is_gone(status: Path) -> bool:
    """Return whether the process of this file of /proc has ended, also if nobody has collected it yet."""
    try:
        return "State:\tZ" in status.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_what_is_no_program_is_a_browser_that_fails(tmp_path: Path) -> None:
    with pytest.raises(ReportError) as caught:
        print_pdf("", chromium=tmp_path / "none", made_at=AT)
    assert caught.value.code == "E521"


def test_dates_are_set_in_place() -> None:
    before = b"<</CreationDate (D:20200102030405+05'45')\n/ModDate (D:20200102030405+05'45')>>(D:20200102030405+00'00')"
    after = dated(before, at=AT)
    assert len(after) == len(before)
    assert after.count(b"(D:20261116050000+00'00')") == 2
    assert after.endswith(b"(D:20200102030405+00'00')")


def test_tags_are_numbered_by_their_own_order() -> None:
    one = b"/ID (node00000274) [(node00000277)(node00000274)] (node0000028) node00000299"
    two = b"/ID (node00000312) [(node00000333)(node00000312)] (node0000028) node00000299"
    assert pdf.renumbered(one) == pdf.renumbered(two)
    assert pdf.renumbered(one).startswith(b"/ID (node00000001) [(node00000002)(node00000001)]")
    assert len(pdf.renumbered(one)) == len(one)


@pytest.mark.browser
@needs_browser
@pytest.mark.parametrize("paper", ["a4", "letter"])
def test_the_page_is_printed_whole_tagged_and_titled(paper: str) -> None:
    assert CHROMIUM is not None
    report = weeks.normal()
    made = print_pdf(render_html(report, paper=paper), chromium=CHROMIUM, made_at=report.generated_at)
    width, height = {"a4": (595, 842), "letter": (612, 792)}[paper]
    boxes = {tuple(round(float(v)) for v in box.split()) for box in re.findall(rb"/MediaBox \[([\d. ]+)\]", made)}
    assert boxes == {(0, 0, width, height)}
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", made)) <= 4
    assert len(made) <= 1_000_000
    for wanted in (b"/StructTreeRoot", b"/MarkInfo", b"/Outlines", b"/Lang (en-GB)", b"/Title ("):
        assert wanted in made, wanted
    stamp = report.generated_at.astimezone(UTC).strftime("(D:%Y%m%d%H%M%S").encode()
    assert made.count(stamp) == 2
    assert made.count(b"/Subtype /Type3") <= 2
    again = print_pdf(render_html(report, paper=paper), chromium=CHROMIUM, made_at=report.generated_at)
    assert again == made
