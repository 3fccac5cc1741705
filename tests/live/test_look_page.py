"""The look page: people on picture and plan, a calibration by eye, and nothing for anybody without the token."""

from __future__ import annotations

import http.client
import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from engine.blob_video import SIZE, Walk
from hypothesis import given
from hypothesis import strategies as st
from live.live_shop import live_shop, stored_instants
from live.test_engine_live import Run, until

from vsd_analytics.config.project import load_site
from vsd_analytics.engine.body import PART_M
from vsd_analytics.engine.people import People
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.live.look_page import look_policy, render_look_page
from vsd_analytics.live.look_server import LookServer
from vsd_analytics.live.look_view import LookView, metric

TOKEN = "a-token-of-the-tests"
HERE = [(-1.0, 8.0), (0.2, 8.0)]
"""Two people 1.2 m apart."""


class Look(Run):
    """The engine in a thread, with its page."""

    def __init__(self, root: Path) -> None:
        super().__init__(root)
        site = load_site(root)
        pages = {c.camera_id: render_look_page(site, c, cameras=site.cameras) for c in site.cameras}
        view = LookView(site, self.cameras)
        self.server = LookServer(view, pages=pages, policy=look_policy(), port=0, language="en", token=TOKEN)

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self.server.close()

    def ask(self, path: str, *, method: str = "GET", body: str | None = None, **headers: str) -> tuple[int, str]:
        """Return status and text of an answer; the headers are as given, and Host as it should be."""
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=10)
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        connection.request(method, path, body=body, headers={"Host": self.server.hosts[0], **named})
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, text

    @property
    def cookie(self) -> str:
        return f"{self.server.cookie}={TOKEN}"


def shop(root: Path, *, is_calibrated: bool = True) -> None:
    walks = [Walk(lambda _: HERE[0]), Walk(lambda _: HERE[1])]
    live_shop(root, walks=walks, seconds=3, hz=5.0)
    if not is_calibrated:
        text = (root / "vsd.toml").read_text()
        (root / "vsd.toml").write_text(text.replace('homography = "cam-1.txt"\n', ""))


@pytest.fixture
def look(tmp_path: Path) -> Iterator[Look]:
    shop(tmp_path)
    with Look(tmp_path) as run:
        until(lambda: all(run.n_processed(c.camera.camera_id) >= 4 for c in run.cameras))
        yield run


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_without_the_token_nothing_is_served(method: str, look: Look) -> None:
    headers = {"Origin": f"http://{look.server.hosts[0]}"} if method == "POST" else {}
    for path in ("/", "/now", "/now?camera=cam-1", "/calibration", "/nothing", "/?token=wrong", "/?token="):
        for more in ({}, {"Cookie": f"{look.server.cookie}=wrong"}, {"Cookie": "other=1"}, {"Authorization": TOKEN}):
            answer = look.ask(path, method=method, body="{}" if method == "POST" else None, **headers, **more)
            assert answer == (401, "open the address that vsd engine live --look printed\n")


def test_other_methods_are_not_served(look: Look) -> None:
    for method in ("PUT", "DELETE", "HEAD", "OPTIONS", "PATCH"):
        assert look.ask("/", method=method, Cookie=look.cookie)[0] == 405


def test_another_host_or_origin_is_refused_even_with_the_token(look: Look) -> None:
    port = look.server.port
    for headers in (
        {"Host": f"rebound.example:{port}"},
        {"Host": "127.0.0.1"},
        {"Origin": "http://other.example"},
        {"Origin": "null"},
        {"Origin": f"http://127.0.0.1:{port + 1}"},
    ):
        assert look.ask("/now", Cookie=look.cookie, **headers)[0] == 403
        assert look.ask(f"/?token={TOKEN}", **headers)[0] == 403
    change = json.dumps({"camera": "cam-1", "horizontal": 0.5, "vertical": 0.5})
    status, _ = look.ask(
        "/calibration", method="POST", body=change, Cookie=look.cookie, Content_Type="application/json"
    )
    assert status == 403  # no origin: no page of ours sends that
    assert not list((look.listener.site.root / "calibration").glob("*"))


def test_with_the_token_a_cookie_replaces_it_and_people_are_where_they_are(look: Look) -> None:
    assert look.ask(f"/?token={TOKEN}")[0] == 303
    status, text = look.ask("/now?camera=cam-1", Cookie=look.cookie)
    now = json.loads(text)
    assert status == 200
    assert sorted(now["persons"]) == [pytest.approx([*xy, True], abs=0.1) for xy in HERE]
    [[_, _, apart_m]] = now["pairs"]
    assert apart_m == pytest.approx(1.2, abs=0.1)
    assert now["picture"].startswith("data:image/jpeg;base64,")
    assert look.ask("/now?camera=none", Cookie=look.cookie)[0] == 404
    for bad in (
        "horizontal=2&vertical=0.5",
        "horizontal=x&vertical=0.5",
        "horizontal=0.5",
        "horizontal=nan&vertical=0",
    ):
        assert look.ask(f"/now?camera=cam-1&{bad}", Cookie=look.cookie)[0] == 400


def test_a_bad_calibration_changes_nothing(look: Look) -> None:
    headers = {"Cookie": look.cookie, "Origin": f"http://{look.server.hosts[1]}", "Content_Type": "application/json"}
    unknown = '{"camera": "cam-9", "horizontal": 0.5, "vertical": 0.5}'
    for body in ("", "{}", "[1]", "null", unknown, unknown.replace("9", "1").replace("0.5}", "1.5}"), "{" * 999):
        assert look.ask("/calibration", method="POST", body=body, **headers)[0] == 400
    assert not list((look.listener.site.root / "calibration").glob("*"))


def bodies(heights_px: list[float], row_px: float) -> People:
    n = len(heights_px)
    box = np.array([[10 + 40 * k, row_px - h, 30 + 40 * k, row_px] for k, h in enumerate(heights_px)], dtype=float)
    joints, frames = np.full((n, 25, 2), np.nan), np.array([0])
    return People(np.zeros(n, dtype=np.int64), np.full(n, None, dtype=object), box.reshape(n, 4), joints, frames)


@given(
    horizontal=st.floats(0.0, 0.9),
    vertical=st.floats(0.0, 0.9),
    height_px=st.floats(20, 150),
    row_px=st.floats(160, 239),
)
def test_metres_by_eye_are_those_of_the_bodies_in_their_own_row(
    horizontal: float, vertical: float, height_px: float, row_px: float
) -> None:
    ratios = Ratios(horizontal, vertical)
    homography = metric([bodies([height_px] * 6, row_px)], ratios, SIZE)
    if homography is None:  # the row is above the horizon of these ratios
        assert not np.isfinite(to_floor(ratios.homography(SIZE), np.array([[20.0, row_px]]), picture_px=SIZE)).all()
        return
    feet = np.array([[20.0, row_px], [120.0, row_px]])
    apart_m = float(np.linalg.norm(np.diff(to_floor(homography, feet, picture_px=SIZE), axis=0)))
    assert apart_m == pytest.approx(100 * PART_M["box"] / height_px, rel=1e-6)


def test_too_few_people_give_no_metres() -> None:
    assert metric([], Ratios(0.5, 0.5), SIZE) is None
    assert metric([bodies([60.0] * 4, 200.0)], Ratios(0.5, 0.5), SIZE) is None


def test_a_camera_without_a_calibration_stores_nothing_until_it_is_calibrated_by_eye(tmp_path: Path) -> None:
    shop(tmp_path, is_calibrated=False)
    with Look(tmp_path) as run:
        until(lambda: run.n_processed("cam-1") >= 8)
        assert json.loads(run.ask("/now?camera=cam-1", Cookie=run.cookie)[1])["calibration"] is None
        assert "cam-1" not in run.listener.status.cameras
        headers = {"Cookie": run.cookie, "Origin": f"http://{run.server.hosts[0]}", "Content_Type": "application/json"}
        asked = json.dumps({"camera": "cam-1", "horizontal": 0.45, "vertical": 0.4})
        status, text = run.ask("/calibration", method="POST", body=asked, **headers)
        saved = json.loads(text)["calibration"]
        assert (status, len(saved)) == (200, 8)
        until(lambda: "cam-1" in run.listener.status.cameras)
        now = json.loads(run.ask("/now?camera=cam-1", Cookie=run.cookie)[1])
        assert now["calibration"].endswith(saved)
    [used] = load_site(tmp_path).camera("cam-1").calibrations
    assert used.calibration_id == saved
    assert "cam-1" in stored_instants(tmp_path)


def test_a_calibration_by_eye_holds_from_now_on_and_the_former_one_before(look: Look) -> None:
    root, before = look.listener.site.root, datetime.now(tz=UTC)
    headers = {"Cookie": look.cookie, "Origin": f"http://{look.server.hosts[0]}", "Content_Type": "application/json"}
    asked = json.dumps({"camera": "cam-2", "horizontal": 0.45, "vertical": 0.4})
    saved = json.loads(look.ask("/calibration", method="POST", body=asked, **headers)[1])["calibration"]
    former, new = load_site(root).camera("cam-2").calibrations
    assert former.valid_from is None
    assert new.calibration_id == saved
    assert new.valid_from is not None
    assert abs((new.valid_from - before).total_seconds()) < 10


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_shows_picture_and_plan_and_is_used_by_keyboard(
    scheme: str, look: Look, tab: Callable[..., Any], axe: Callable[..., Any]
) -> None:
    page = tab(f"http://127.0.0.1:{look.server.port}/?token={TOKEN}", color_scheme=scheme)
    page.wait_for_selector("#picture:not([hidden])")
    page.wait_for_selector("#people .close >> nth=1", state="attached")
    assert "token" not in page.url
    assert page.locator("#people line").count() == 1
    assert "2 people, 1 pairs too close" in page.inner_text("#state")
    assert axe(page) == []
    page.focus("#try")
    page.keyboard.press("Space")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "horizontal"
    for _ in range(20):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("Tab")
    for _ in range(10):
        page.keyboard.press("ArrowLeft")
    assert page.inner_text("#horizontal-value") == "0.50"
    assert page.inner_text("#vertical-value") == "0.60"
    page.wait_for_selector("#save:not([disabled])")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "yes"
    assert axe(page) == []
    page.keyboard.press("Escape")
    assert page.evaluate("document.activeElement.id") == "save"
    assert not list((look.listener.site.root / "calibration").glob("*"))
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    page.wait_for_selector("#said:not(:empty)")
    assert "In use from now on: calibration" in page.inner_text("#said")
    assert len(load_site(look.listener.site.root).camera("cam-1").calibrations) == 2
    own = f"127.0.0.1:{look.server.port}"
    assert {urlsplit(url).netloc for url in page.seen if not url.startswith("data:")} == {own}
    assert page.errors == []
    assert page.context.cookies()[0]["httpOnly"]
    page.context.clear_cookies()
    assert page.goto(f"http://{own}/").status == 401
    page.errors.clear()
