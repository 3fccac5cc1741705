"""`vsd serve`: the bytes of the report's files over HTTP, for who has the token; errors in words; read only."""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from datetime import date
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from starlette.testclient import TestClient

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.access_token import is_loopback
from vsd_analytics.errors import UsageError
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.service.access import RateLimit, token_of
from vsd_analytics.service.answers import TABLES, ReportAnswers
from vsd_analytics.service.app import make_app
from vsd_analytics.service.openapi import ADDRESSES
from vsd_analytics.site.model import Site

TOKEN = "a-token-of-the-tests"
WEEK = "/v1/weeks/2026-W46/floors/ground"
MONDAY = date(2026, 11, 9)


def client_of(root: Path, *, per_min: float = 1e6, burst: int = 10**6) -> TestClient:
    limit = RateLimit(per_min=per_min, burst=burst)
    app = make_app(ReportAnswers(root), token=TOKEN, limit=limit, title="Shop")
    return TestClient(app, raise_server_exceptions=False, headers={"Authorization": f"Bearer {TOKEN}"})


@pytest.fixture(scope="module")
def client(demo_project: Path) -> TestClient:
    return client_of(demo_project)


@pytest.fixture(scope="module")
def stranger(demo_project: Path) -> TestClient:
    """Return a client that sends no token of its own."""
    client = client_of(demo_project)
    del client.headers["Authorization"]
    return client


def test_report_page_and_tables_have_the_bytes_of_the_command(
    demo_project: Path, client: TestClient, tmp_path: Path
) -> None:
    words = ["report", "--week", "2026-W46", "--format", "html,json,csv", "--out", str(tmp_path)]
    assert run(cli, ["-C", str(demo_project), *words]) == 0
    (report,), (page,) = tmp_path.glob("*.json"), tmp_path.glob("*.html")
    assert client.get(f"{WEEK}/report").content == report.read_bytes()
    assert client.get(f"{WEEK}/page").content == page.read_bytes()
    for name in TABLES:
        (table,) = tmp_path.glob(f"*{name}.csv")
        assert client.get(f"{WEEK}/tables/{name}.csv").content == table.read_bytes()


def test_the_planner_is_that_of_the_week(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[PlannerData] = []

    def noting(site: Site, monday: date, **given: Any) -> list[PlannerData]:
        assert (monday, given["floor_id"]) == (MONDAY, "ground")
        made.extend(planner_pages(site, monday, **given))
        return made

    monkeypatch.setattr("vsd_analytics.planner.planner_data.planner_pages", noting)
    assert client.get(f"{WEEK}/planner").text == render_planner(*made)


def test_each_figure_is_that_of_the_report(client: TestClient) -> None:
    report = client.get(f"{WEEK}/report").json()
    figures = client.get(f"{WEEK}/figures").json()["figures"]
    assert figures["M0"]["value"] == report["answers"]["violations"]["rows"][0]["violation_rate"]["value"] > 0
    assert figures["M17"] == report["figures"]["M17"]
    for metric, figure in figures.items():
        assert client.get(f"{WEEK}/figures/{metric}").json() == figure


def test_last_is_the_last_stored_week(client: TestClient) -> None:
    assert client.get("/v1/site").json()["weeks"] == ["2026-W46"]
    assert client.get(f"{WEEK}/report").content == client.get("/v1/weeks/last/floors/ground/report").content


def test_small_counts_are_hidden_as_in_the_report(demo_project: Path, tmp_path: Path) -> None:
    root = tmp_path / "vsd-demo"
    shutil.copytree(demo_project, root)
    text = (root / "vsd.toml").read_text()
    (root / "vsd.toml").write_text(text.replace("[report]", "[report]\nmask_below = 200"))
    found = client_of(root).get(f"{WEEK}/report").json()
    counts = [c["violations"] for c in found["when"]["cells"] if c["violations"] is not None]
    assert not [n for n in counts if 0 < n < 200]
    assert any(c["is_masked"] for c in found["when"]["cells"])


@pytest.mark.parametrize("address", [*(a.path for a in ADDRESSES), "/openapi.json"])
@pytest.mark.parametrize(
    "header",
    [
        None,
        "Bearer wrong-token-of-the-tests",
        "Bearer",
        TOKEN,
        f"Digest {TOKEN}",
        "Basic !!!",
        "Basic " + base64.b64encode(b"a:b").decode(),
    ],
)
def test_nothing_is_answered_without_the_token(stranger: TestClient, address: str, header: str | None) -> None:
    address = address.format(week="last", floor_id="ground", metric="M0", table="hours")
    answer = stranger.get(address, headers={} if header is None else {"Authorization": header})
    assert answer.status_code == 401
    assert answer.headers["content-type"] == "application/problem+json"
    assert "Bearer" in answer.headers["www-authenticate"]
    assert answer.json()["fix"]
    assert "ground" not in answer.text


def test_a_browser_may_send_the_token_as_a_password(client: TestClient) -> None:
    basic = base64.b64encode(f"anybody:{TOKEN}".encode()).decode()
    assert client.get("/v1/site", headers={"Authorization": f"Basic {basic}"}).status_code == 200


def test_an_unchanged_answer_is_not_sent_again(client: TestClient) -> None:
    first = client.get(f"{WEEK}/figures/M0")
    again = client.get(f"{WEEK}/figures/M0", headers={"If-None-Match": f'"other", {first.headers["etag"]}'})
    assert (again.status_code, again.content) == (304, b"")
    assert client.get(f"{WEEK}/figures/M0", headers={"If-None-Match": '"other"'}).content == first.content
    assert client.get(f"{WEEK}/figures/M1").headers["etag"] != first.headers["etag"]


def test_a_changed_project_is_answered_anew(demo_project: Path, tmp_path: Path) -> None:
    root = tmp_path / "vsd-demo"
    shutil.copytree(demo_project, root)
    seconds = [0.0]
    answers = ReportAnswers(root, clock=lambda: seconds[0])
    before = json.loads(answers.site())
    assert before["name"] == "Quayside Market"
    text = (root / "vsd.toml").read_text()
    (root / "vsd.toml").write_text(text.replace('"Quayside Market"', '"Renamed"'))
    assert json.loads(answers.site())["name"] == "Quayside Market", "files are not looked at for each request"
    seconds[0] += 10
    assert json.loads(answers.site())["name"] == "Renamed"


def test_a_project_with_a_mistake_is_not_answered_from_before_until_it_is_corrected(
    demo_project: Path, tmp_path: Path
) -> None:
    root = tmp_path / "vsd-demo"
    shutil.copytree(demo_project, root)
    seconds = [0.0]
    answers = ReportAnswers(root, clock=lambda: seconds[0])
    limit = RateLimit(per_min=1e6, burst=10**6)
    app = make_app(answers, token=TOKEN, limit=limit, title="Shop")
    client = TestClient(app, raise_server_exceptions=False, headers={"Authorization": f"Bearer {TOKEN}"})
    assert client.get("/v1/site").status_code == 200
    text = (root / "vsd.toml").read_text()
    (root / "vsd.toml").write_text(text + "\nnonsense = [\n")
    told = []
    for _ in range(6):
        seconds[0] += 1
        told.append(client.get("/v1/site").status_code)
    assert told == [200, *[503] * 5], "changes are noticed within two seconds"
    (root / "vsd.toml").write_text(text)
    seconds[0] += 3
    assert client.get("/v1/site").status_code == 200


@pytest.mark.parametrize(
    ("path", "word"),
    [
        ("/v1/weeks/2026-W99/floors/ground/report", "is not a week"),
        ("/v1/weeks/2019-W01/floors/ground/report", "nothing is stored of 2019-W01"),
        ("/v1/weeks/last-300/floors/ground/report", "nothing is stored of"),
        ("/v1/weeks/last/floors/%2e%2e%2f/report", "no such address"),
        ("/v1/weeks/last/floors/attic/report", "no floor 'attic'"),
        ("/v1/weeks/last/floors/ground/figures/M999", "no figure 'M999'"),
        ("/v1/weeks/last/floors/ground/tables/secrets.csv", "no table 'secrets'"),
        ("/v1/nothing", "no such address"),
        ("/v1/weeks/last/floors/<script>alert(1)</script>/report", "no such address"),
        ("/v1/weeks/last/floors/<script>/report", "no floor '<script>'"),
    ],
)
def test_what_is_not_there_is_refused_in_words(client: TestClient, path: str, word: str) -> None:
    answer = client.get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert word in problem["title"]
    assert problem["status"] == 404


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH"])
def test_nothing_can_be_changed(client: TestClient, method: str) -> None:
    answer = client.request(method, f"{WEEK}/report")
    assert answer.status_code == 405
    assert answer.json()["title"] == "the service is read-only"


def test_a_client_that_asks_too_often_is_asked_to_wait(demo_project: Path) -> None:
    client = client_of(demo_project, per_min=60, burst=3)
    codes = [client.get("/health").status_code for _ in range(5)]
    assert codes == [200, 200, 200, 429, 429]
    assert client.get("/health").headers["retry-after"] == "1"


def test_the_rate_recovers_and_clients_do_not_slow_each_other() -> None:
    seconds = [0.0]
    limit = RateLimit(per_min=60, burst=2, clock=lambda: seconds[0])
    assert [limit.wait_s("a") for _ in range(3)] == [0, 0, 1]
    assert limit.wait_s("b") == 0
    seconds[0] = 1.0
    assert limit.wait_s("a") == 0


def test_an_internal_error_says_nothing_about_the_machine(demo_project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: ReportAnswers) -> bytes:
        raise RuntimeError("/secret/path")

    monkeypatch.setattr(ReportAnswers, "site", broken)
    answer = client_of(demo_project).get("/v1/site")
    assert answer.status_code == 500
    assert "secret" not in answer.text
    assert answer.json()["title"] == "the answer could not be made"


def test_every_answer_forbids_what_a_page_does_not_need(client: TestClient) -> None:
    for path in (f"{WEEK}/page", "/v1/site", "/v1/nothing-here", "/health"):
        headers = client.get(path).headers
        if path == "/v1/nothing-here":
            assert headers["x-content-type-options"] == "nosniff"
            continue
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["cache-control"] == "private, no-cache"


def test_a_token_is_made_once_for_the_owner_alone(tmp_path: Path) -> None:
    token, where = token_of(tmp_path, environ={})
    assert len(token) >= 32
    assert Path(where).stat().st_mode & 0o777 == 0o600
    assert token_of(tmp_path, environ={}) == (token, where)
    assert token_of(tmp_path, environ={"VSD_SERVE_TOKEN": "x" * 20})[0] == "x" * 20
    with pytest.raises(UsageError, match="not safe"):
        token_of(tmp_path, environ={"VSD_SERVE_TOKEN": "short"})


@pytest.mark.parametrize(
    ("host", "is_own"),
    [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("shop.example", False)],
)
def test_only_loopback_is_this_machine(host: str, is_own: bool) -> None:
    assert is_loopback(host) is is_own


@pytest.fixture
def port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        number: int = found.getsockname()[1]
    return number


def test_the_command_serves_on_loopback(demo_project: Path, port: int) -> None:
    pytest.importorskip("uvicorn")
    command = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
    command += ["-C", str(demo_project), "serve", "--port", str(port)]
    environ = {**os.environ, "VSD_SERVE_TOKEN": TOKEN}
    started = subprocess.Popen(command, env=environ, stderr=subprocess.PIPE)
    try:
        site = _ask(f"http://127.0.0.1:{port}/v1/site", started)
    finally:
        started.terminate()
        started.wait(20)
    assert site["site_id"] == "quayside"


def _ask(url: str, started: subprocess.Popen[bytes]) -> Any:
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {TOKEN}"})
    for _ in range(300):
        assert started.poll() is None, started.stderr.read() if started.stderr else ""
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return json.load(answer)
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.1)
    raise AssertionError("the service did not start")
