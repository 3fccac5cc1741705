"""The desk: who may write, what is written, once, with a name; nothing through a page of somebody else."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import DESK_TOKEN, HERE, NOW, QUESTION, READ_TOKEN, DeskBrowser, desk_app, desk_site

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.change_log import read_answers, read_log
from vsd_analytics.config.floor_targets import read_target_changes
from vsd_analytics.config.log_records import read_records
from vsd_analytics.config.project import load_site
from vsd_analytics.service import desk_sessions
from vsd_analytics.service.desk_jobs import JOBS
from vsd_analytics.service.desk_sessions import SESSION_S, DeskSessions
from vsd_analytics.site.model import Site

HOSTILE = '"><script>alert(1)</script>{{ 7 * 7 }}&#39;\u202e'


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return desk_site(tmp_path / "shop")


@pytest.fixture
def anna(site: Site) -> DeskBrowser:
    return DeskBrowser(desk_app(site.root))


def log_of(site: Site) -> list[dict[str, Any]]:
    path = site.root / "log.jsonl"
    return [json.loads(line) for line in path.read_bytes().splitlines()] if path.exists() else []


def test_an_answer_is_stored_as_by_the_command_with_who_and_when(site: Site, anna: DeskBrowser) -> None:
    sent = anna.send("answer", question=QUESTION, answer="tried", at="2026-11-16T07:00", text="Mat moved")
    assert (sent.status_code, sent.headers["location"]) == (303, "/desk")
    (answer,), (entry,) = read_answers(site), read_log(site)
    assert (answer.kind, answer.by, answer.text, answer.area_id) == ("tried", "Anna", "Mat moved", "entrance")
    assert str(answer.at) == "2026-11-16 07:00:00+01:00"
    assert (entry.question, entry.by) == (QUESTION, "Anna")
    page = anna.page()
    assert "Saved. The next pages compare before and after." in page
    assert 'value="not-possible"' not in page  # it is answered: nothing is asked
    assert "Saved." not in anna.page()


def test_a_change_is_logged_and_taken_back_once_by_each_name(site: Site, anna: DeskBrowser) -> None:
    anna.send("log", text="Painted", at="2026-11-16T07:00", area="entrance")
    anna.send("log", text="Painted", at="2026-11-16T07:00", area="entrance")
    assert [(e.text, e.area_id, e.by) for e in read_log(site)] == [("Painted", "entrance", "Anna")]
    assert "The log has this change already" in anna.page()
    bea = DeskBrowser(desk_app(site.root), writer="Bea")
    for browser, said in ((bea, "Taken back."), (anna, "Nothing to take back: somebody did it already.")):
        assert browser.send("undo", line="1").status_code == 303
        assert said in browser.page()
    assert read_log(site) == ()
    assert [(r.withdrawn_by, r.withdrawn_at) for r in read_records(site)][-1] == ("Bea", NOW)
    assert len(log_of(site)) == 2


@pytest.mark.parametrize("kind", ["later", "not-possible"])
def test_an_answer_that_changes_nothing_is_taken_back_too(site: Site, anna: DeskBrowser, kind: str) -> None:
    anna.send("answer", question=QUESTION, answer=kind)
    assert [a.kind for a in read_answers(site)] == [kind]
    assert 'name="answer"' not in anna.page()
    anna.send("undo", line="1")
    assert read_answers(site) == ()
    assert 'name="answer"' in anna.page()


def test_a_target_is_set_drawn_and_taken_back(site: Site, anna: DeskBrowser) -> None:
    before = (site.root / "vsd.toml").read_bytes()
    for given, said in (("120,5", "The target is saved."), ("120.5", "This is the target already.")):
        assert anna.send("target", floor="ground", value=given).status_code == 303
        assert said in anna.page()
    assert load_site(site.root).floors[0].target_per_open_h == 120.5
    assert "Anna, Tue 17 Nov, 10:30. Before: none." in anna.page()
    for said in ("Taken back.", "Nothing to take back"):
        anna.send("undo-target", line="0")
        assert said in anna.page()
    assert (site.root / "vsd.toml").read_bytes() == before
    assert [(c.after, c.by) for c in read_target_changes(site)] == [(120.5, "Anna"), (None, "Anna")]


def test_opening_hours_are_changed_from_a_day_on_and_taken_back(site: Site, anna: DeskBrowser) -> None:
    before = (site.root / "vsd.toml").read_bytes()
    days = dict.fromkeys(("mon", "tue", "wed", "thu", "fri"), "8:00 – 13:00, 15:00-19:00")
    assert anna.send("hours", **{"from": "2026-11-30"}, **days, sat="09:00-12:00", sun="").status_code == 303
    assert "The opening hours are saved" in anna.page()
    (change,) = load_site(site.root).opening_changes
    assert (str(change.first), change.by) == ("2026-11-30", "Anna")
    assert change.opening == (*(((480, 780), (900, 1140)),) * 5, ((540, 720),), ())
    page = anna.page()
    assert 'value="08:00-13:00 15:00-19:00"' in page
    assert "Hours from Mon 30 Nov, Anna" in page
    anna.send("hours", **{"from": "2026-12-07"}, **days, sat="09:00-12:00", sun="")
    assert "These are the opening hours already." in anna.page()
    anna.send("undo-hours", line="2026-11-30")
    assert "Taken back." in anna.page()
    anna.send("undo-hours", line="2026-11-30")
    assert "Nothing to take back" in anna.page()
    assert (site.root / "vsd.toml").read_bytes() == before


def test_a_target_that_cannot_be_saved_is_said_in_words(tmp_path: Path) -> None:
    site = desk_site(tmp_path / "shop")
    path = site.root / "vsd.toml"
    path.write_text(path.read_text().replace('[[floor]]\nid = "ground"\nname = "Ground"\n', ""))
    path.write_text('floor = [{ id = "ground", name = "Ground" }]\n' + path.read_text())
    anna = DeskBrowser(desk_app(site.root))
    before = path.read_bytes()
    sent = anna.send("target", floor="ground", value="120")
    assert sent.status_code == 422
    assert "The target cannot be saved here" in sent.text
    assert path.read_bytes() == before


def test_nothing_of_the_desk_is_there_unless_it_is_asked_for(site: Site) -> None:
    app = desk_app(site.root, has_desk=False)
    stranger = DeskBrowser(app, writer=None)
    for path in ("/desk", "/desk/sign-in", "/desk/log"):
        assert stranger.client.get(path).status_code == 401
        reader = stranger.client.get(path, headers={"Authorization": f"Bearer {READ_TOKEN}"})
        assert reader.status_code == 404


def test_the_token_of_readers_writes_nothing_and_that_of_the_desk_is_in_no_answer(site: Site) -> None:
    browser = DeskBrowser(desk_app(site.root), writer=None)
    for token in (READ_TOKEN, "", DESK_TOKEN[:-1], DESK_TOKEN + "x", "é" * 20):
        refused = browser.sign_in("Anna", token)
        assert refused.status_code == 403
        assert "set-cookie" not in refused.headers
        assert "The token is not right" in refused.text
        if token:
            assert token not in refused.text
    assert browser.sign_in("   ").status_code == 403
    bearer = {"Authorization": f"Bearer {READ_TOKEN}"}
    assert browser.client.post("/desk/log", data={"text": "x"}, headers=bearer).headers["location"] == "/desk/sign-in"
    signed = browser.sign_in("Anna")
    cookie = signed.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=lax" in cookie
    assert "Path=/desk" in cookie
    for text in (cookie, signed.headers["location"], browser.page()):
        assert DESK_TOKEN not in text
    assert log_of(site) == []


def test_a_cookie_of_an_encrypted_address_is_sent_to_no_other(site: Site) -> None:
    browser = DeskBrowser(desk_app(site.root), writer=None)
    sent = {"writer": "Anna", "token": DESK_TOKEN}
    secure = browser.client.post("/desk/sign-in", data=sent, headers={"Origin": "https://testserver"})
    assert "Secure" in secure.headers["set-cookie"]


def test_the_token_is_compared_in_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[bytes, bytes]] = []

    def noting(given: bytes, wanted: bytes) -> bool:
        compared.append((given, wanted))
        return given == wanted

    monkeypatch.setattr(desk_sessions.hmac, "compare_digest", noting)
    sessions = DeskSessions(DESK_TOKEN)
    cookie = sessions.sign_in(DESK_TOKEN, "Anna")
    assert cookie is not None
    session = sessions.of(cookie)
    assert session is not None
    assert session.is_own_form(session.form_token)
    assert [wanted for _, wanted in compared] == [DESK_TOKEN.encode(), session.form_token.encode()]


def test_a_session_ends_by_itself_and_by_signing_out(site: Site) -> None:
    seconds = [0.0]
    sessions = DeskSessions(DESK_TOKEN, clock=lambda: seconds[0])
    cookie = sessions.sign_in(DESK_TOKEN, "Anna")
    assert cookie is not None
    assert sessions.of(cookie) is not None
    seconds[0] = SESSION_S
    assert sessions.of(cookie) is None
    anna = DeskBrowser(desk_app(site.root))
    anna.client.post("/desk/sign-out", data=anna.hidden())
    assert anna.client.get("/desk").headers["location"] == "/desk/sign-in"


@pytest.mark.parametrize(
    ("headers", "fields"),
    [
        ({"Origin": "http://elsewhere.example"}, {}),
        ({"Origin": "null"}, {}),
        ({"Origin": ""}, {}),
        ({"Origin": HERE, "Sec-Fetch-Site": "cross-site"}, {}),
        ({"Origin": HERE, "Sec-Fetch-Site": "same-site"}, {}),
        ({}, {"form": ""}),
        ({}, {"form": "x" * 43}),
        ({}, {"request": ""}),
        ({}, {"request": "short"}),
        ({}, {"text": "x" * 2001}),
        ({"Content-Type": "text/plain"}, {}),
        ({"Content-Type": "multipart/form-data"}, {}),
    ],
)
@pytest.mark.parametrize("job", [*JOBS, "sign-out"])
def test_a_form_of_another_page_is_refused(
    site: Site, anna: DeskBrowser, job: str, headers: dict[str, str], fields: dict[str, str]
) -> None:
    if job == "sign-out" and "request" in fields:
        return  # to sign out twice does no harm
    whole = {"text": "Forged", "question": QUESTION, "answer": "later", "line": "1", "floor": "ground", "value": "9"}
    sent = anna.send(job, headers=headers, **(whole | fields))
    assert sent.status_code == 403
    assert "This form cannot be taken" in sent.text
    assert log_of(site) == []
    assert load_site(site.root).floors[0].target_per_open_h is None
    assert anna.client.get("/desk").status_code == 200


def test_a_form_token_of_one_session_is_none_of_another(site: Site) -> None:
    app = desk_app(site.root)
    anna, bea = DeskBrowser(app), DeskBrowser(app, writer="Bea")
    assert anna.send("log", text="x", form=bea.hidden()["form"]).status_code == 403
    assert log_of(site) == []


def test_a_request_that_is_sent_again_does_nothing_twice(site: Site, anna: DeskBrowser) -> None:
    fields = anna.hidden() | {"text": "Painted", "at": "2026-11-16T07:00"}
    with ThreadPoolExecutor(8) as pool:
        sent = list(pool.map(lambda _: anna.client.post("/desk/log", data=fields), range(16)))
    assert {s.status_code for s in sent} == {303}
    assert len(log_of(site)) == 1
    anna.client.post("/desk/log", data=fields | {"text": "Something else under the same id"})
    assert len(log_of(site)) == 1
    anna.send("undo", line="1")
    anna.client.post("/desk/log", data=fields)  # what was taken back does not come again
    assert read_log(site) == ()


def test_two_writers_at_once_lose_nothing(site: Site) -> None:
    """Two desks, as of two programs, and the command's function, on one log."""
    browsers = [DeskBrowser(desk_app(site.root), writer=name) for name in ("Anna", "Bea")]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda k: browsers[k % 2].send("log", text=f"Change {k}"), range(24)))
    assert sorted(e.text for e in read_log(site)) == sorted(f"Change {k}" for k in range(24))
    assert {e.by for e in read_log(site)} == {"Anna", "Bea"}


@pytest.mark.parametrize("text", [HOSTILE, "'; drop table violations; --", "=cmd|' /C calc'!A0", "x" * 500])
def test_hostile_texts_are_stored_as_they_are_and_shown_as_text(site: Site, text: str) -> None:
    anna = DeskBrowser(desk_app(site.root), writer='<img src=x onerror="alert(1)">')
    sent = anna.send("log", text=text)
    page = anna.page()
    if sent.status_code == 303:
        assert [e.text for e in read_log(site)] == [text]
    else:
        assert log_of(site) == []
    for part in ("<script", "<img", "<u>", "<b>\n", "<i>mat", 'onerror="'):
        assert part not in page
    assert "49" not in page.replace("2026", "")[page.index("<main") :] or "{{" not in text


@pytest.mark.parametrize(
    ("job", "fields", "said"),
    [
        ("log", {"text": ""}, "Please write what was changed."),
        ("log", {"text": "x" * 501}, "Use at most 500 characters"),
        ("log", {"text": "a\x07b"}, "Use at most 500 characters"),
        ("log", {"text": "a", "at": "yesterday"}, "This is no date"),
        ("log", {"text": "a", "at": "0001-01-01T00:00"}, "This is no date"),
        ("log", {"text": "a", "area": "../secrets"}, "no such area"),
        ("target", {"floor": "ground", "value": "-3"}, "A target is a number above 0"),
        ("target", {"floor": "ground", "value": "nan"}, "A target is a number above 0"),
        ("target", {"floor": "ground", "value": "1e3"}, "A target is a number above 0"),
        ("target", {"floor": "attic", "value": "3"}, "no such floor"),
        ("hours", {"from": "2026-11-02", "mon": "08:00-20:00"}, "Choose a day of this week or later"),
        ("hours", {"from": "soon", "mon": "08:00-20:00"}, "This is no day."),
        ("hours", {"from": "2026-11-30", "mon": "8 to 9"}, "Write hours as 08:00-20:00"),
        ("hours", {"from": "2026-11-30", "sun": "08:10-20:00"}, "Write hours as 08:00-20:00"),
        ("answer", {"question": "Q1-nothing", "answer": "later"}, "not open any more"),
        ("answer", {"question": QUESTION, "answer": "perhaps"}, "Choose one of the three answers."),
    ],
)
def test_what_cannot_be_taken_is_said_in_words_and_what_was_filled_in_stays(
    site: Site, anna: DeskBrowser, job: str, fields: dict[str, str], said: str
) -> None:
    sent = anna.send(job, **fields)
    assert sent.status_code == 422
    assert said in sent.text
    assert "vsd log" not in sent.text
    if job == "log" and len(fields["text"]) == 1:
        assert 'value="a"' in sent.text
    assert log_of(site) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a disk needs root")
def test_a_read_only_disk_gets_a_page_that_says_so_and_loses_nothing(site: Site, anna: DeskBrowser) -> None:
    anna.send("log", text="Before")
    before = (site.root / "log.jsonl").read_bytes()
    anna.page()
    if subprocess.run(["mount", "--bind", site.root, site.root], check=False, capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        subprocess.run(["mount", "-o", "remount,bind,ro", site.root], check=True)
        sent = anna.send("log", text="Painted")
        assert sent.status_code == 503
        assert "The disk of the server cannot be written (E305)." in sent.text
        assert str(site.root) not in sent.text
        assert (site.root / "log.jsonl").read_bytes() == before
        assert "Before" in anna.page()
    finally:
        subprocess.run(["umount", site.root], check=True)
    assert anna.send("log", text="Painted").status_code == 303
    assert [e.text for e in read_log(site)] == ["Before", "Painted"]


def test_a_disk_that_refuses_once_takes_the_same_form_later(
    site: Site, anna: DeskBrowser, monkeypatch: pytest.MonkeyPatch
) -> None:
    fields = anna.hidden() | {"text": "Painted"}

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "no space")

    with monkeypatch.context() as patched:
        patched.setattr("vsd_analytics.store.durable.os.fsync", full)
        assert anna.client.post("/desk/log", data=fields).status_code == 503
    assert log_of(site) == []
    assert anna.client.post("/desk/log", data=fields).status_code == 303
    assert [e.text for e in read_log(site)] == ["Painted"]


WRITER = """
import sys
from service.desk_site import DeskBrowser, desk_app
from pathlib import Path
browser = DeskBrowser(desk_app(Path(sys.argv[1])))
for k in range(10**6):
    if browser.send("log", text=f"{sys.argv[2]}-{k}").status_code == 303:
        print(k, flush=True)
"""


def test_kill_9_in_the_middle_of_writing_loses_nothing_and_tears_no_line(site: Site) -> None:
    tests = Path(__file__).resolve().parent.parent
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    acknowledged = set[str]()
    for turn in range(3):
        command = [sys.executable, "-c", WRITER, str(site.root), f"{turn}"]
        process = subprocess.Popen(command, env=environ, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        for line in process.stdout:
            acknowledged.add(f"{turn}-{line.strip()}")
            if len(acknowledged) >= 5 * (turn + 1):
                time.sleep(0.003 * turn)
                process.send_signal(signal.SIGKILL)
                break
        acknowledged |= {f"{turn}-{line.strip()}" for line in process.stdout if line.endswith("\n")}
        process.wait()
        stored = {e.text for e in read_log(load_site(site.root))}
        assert acknowledged <= stored
        assert len(stored) == len(log_of(site))
    anna = DeskBrowser(desk_app(site.root))
    assert anna.send("log", text="After").status_code == 303
    assert not list(site.root.glob(".*.tmp"))


@pytest.mark.parametrize("path", ["/desk/weeks/last/floors/ground/page", "/desk/weeks/last/floors/ground/planner"])
def test_a_page_without_a_session_leads_to_signing_in_and_back(site: Site, path: str) -> None:
    browser = DeskBrowser(desk_app(site.root), writer=None)
    there = browser.client.get(path).headers["location"]
    assert there == f"/desk/sign-in?after={path}"
    assert f'name="after" value="{path}"' in browser.client.get(there).text
    assert browser.sign_in("Anna", after=path).headers["location"] == path


@pytest.mark.parametrize(
    "after", ["//elsewhere.example", "https://elsewhere.example", "/v1/site", "/desk/../v1", "/desk\r\nA: b"]
)
def test_signing_in_leads_nowhere_else(site: Site, after: str) -> None:
    browser = DeskBrowser(desk_app(site.root), writer=None)
    assert browser.sign_in("Anna", after=after).headers["location"] == "/desk"
    assert 'name="after" value=""' in browser.client.get("/desk/sign-in", params={"after": after}).text


def test_what_is_not_there_or_cannot_be_read_is_a_page_in_words(site: Site, anna: DeskBrowser) -> None:
    missing = anna.client.get("/desk/weeks/2019-W01/floors/attic/page")
    assert missing.headers["content-type"].startswith("text/html")
    assert anna.client.get("/desk/nothing").status_code in (404, 405)
    (site.root / "log.jsonl").write_text("nonsense\n")
    broken = anna.client.get("/desk")
    assert broken.status_code == 500
    assert "The page cannot be made" in broken.text


def test_the_desk_speaks_the_language_of_the_site(tmp_path: Path) -> None:
    anna = DeskBrowser(desk_app(desk_site(tmp_path / "negozio", more='language = "it"').root))
    page = anna.page()
    assert '<html lang="it-IT">' in page
    assert "Annotare un cambiamento" in page
    assert "Log a change" not in page


def test_the_served_page_has_buttons_and_the_desk_takes_its_answer(demo_project: Path, tmp_path: Path) -> None:
    root = tmp_path / "vsd-demo"
    shutil.copytree(demo_project, root)
    (root / "questions.jsonl").unlink(missing_ok=True)
    app = desk_app(root)
    anna = DeskBrowser(app)
    address = "/desk/weeks/2026-W46/floors/ground/page"
    page = anna.client.get(address).text
    assert "mailto:" not in page
    [question] = {part.split("&")[0] for part in page.split('href="/desk?question=')[1:]}
    reader = {"Authorization": f"Bearer {READ_TOKEN}"}
    shared = anna.client.get("/v1/weeks/2026-W46/floors/ground/page", headers=reader).text
    assert "/desk" not in shared
    assert f"mailto:?subject={question}" in shared
    anna.send("answer", question=question, answer="not-possible", text="The fire door needs it")
    again = anna.client.get(address).text
    assert question not in again
    assert "Not possible by Anna. The fire door needs it." in again
    before = (root / "questions.jsonl").read_bytes()
    older = anna.client.get("/desk/weeks/2026-W45/floors/ground/page").text
    assert "/desk?question=" not in older  # to look at an old week asks nothing
    assert (root / "questions.jsonl").read_bytes() == before
    planner = anna.client.get("/desk/weeks/last/floors/ground/planner").text
    assert 'href="/desk/weeks/2026-W46/floors/ground/page"' in planner
    assert "/desk" not in anna.client.get("/v1/weeks/last/floors/ground/planner", headers=reader).text


def test_a_desk_whose_token_is_that_of_readers_does_not_start(
    site: Site, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("VSD_SERVE_TOKEN", "VSD_DESK_TOKEN"):
        monkeypatch.setenv(name, READ_TOKEN)
    assert run(cli, ["-C", str(site.root), "serve", "--desk", "--port", "0"]) == 2
    assert "who may read could write" in capsys.readouterr().err
    monkeypatch.setenv("VSD_DESK_TOKEN", "short")
    assert run(cli, ["-C", str(site.root), "serve", "--desk", "--port", "0"]) == 2
    assert "VSD_DESK_TOKEN" in capsys.readouterr().err
