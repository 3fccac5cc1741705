"""The index of all sites at the desk: it and what it links to, and nothing else of its folder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import DESK_TOKEN, DeskBrowser, desk_app, desk_site
from site_index import many_reports as many

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.site_index.read_reports import OPERATORS

ADDRESS = "/desk/sites/index.html"


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    """A project with three weeks of its own and one of another site, and their index."""
    root = desk_site(tmp_path / "shop").root
    for back in range(3):
        many.write(root, many.report(back=back, value=100.0, change=0.01))
    other = tmp_path / "canteen"
    many.write(other, many.report(address=many.CANTEEN))
    assert run(cli, ["site", "build", str(root), str(other), "--out", str(root / "reports")]) == 0
    return root


def test_the_desk_shows_the_index_and_every_page_it_links_to(shop: Path) -> None:
    anna = DeskBrowser(desk_app(shop))
    assert f'href="{ADDRESS}"' in anna.page()
    index = anna.client.get(ADDRESS)
    assert (index.status_code, index.content) == (200, (shop / "reports" / "index.html").read_bytes())
    links = set(re.findall(r'href="([^"#:]+)"', index.text))
    assert {"2026-W46.html", "2026-W46.json", "canteen/2026-W46.html"} <= links
    for link in links:
        answer = anna.client.get(f"/desk/sites/{link}")
        assert (answer.status_code, answer.content) == (200, (shop / "reports" / link).read_bytes()), link
        assert answer.headers["cache-control"] == "no-store"
        assert "default-src 'none'" in answer.headers["content-security-policy"]


def test_who_is_not_signed_in_signs_in_first_and_comes_back(shop: Path) -> None:
    anna = DeskBrowser(desk_app(shop), writer=None)
    assert anna.client.get(ADDRESS).headers["location"] == f"/desk/sign-in?after={ADDRESS}"
    assert anna.sign_in("Anna", token=DESK_TOKEN, after=ADDRESS).headers["location"] == ADDRESS


@pytest.mark.parametrize(
    "name",
    [
        "vsd.toml",
        "..%2Fvsd.toml",
        "%2e%2e%2fvsd.toml",
        "notes.html",
        "2026-W30.html",
        "canteen",
        "",
        "%2Fetc%2Fhostname",
    ],
)
def test_nothing_else_of_the_folder_is_shown(shop: Path, name: str) -> None:
    for other in ("notes.html", "2026-W30.html"):
        (shop / "reports" / other).write_text("<p>of nobody's concern")
    assert DeskBrowser(desk_app(shop)).client.get(f"/desk/sites/{name}").status_code == 404


def test_a_page_that_became_the_operators_or_a_link_is_not_shown(shop: Path) -> None:
    anna, page = DeskBrowser(desk_app(shop)), shop / "reports" / "2026-W46.html"
    page.write_bytes(OPERATORS + page.read_bytes())
    assert anna.client.get("/desk/sites/2026-W46.html").status_code == 404
    page.unlink()
    page.symlink_to(shop / "vsd.toml")
    assert anna.client.get("/desk/sites/2026-W46.html").status_code == 404


def test_without_an_index_there_is_no_link_and_no_page(tmp_path: Path) -> None:
    root = desk_site(tmp_path / "shop").root
    anna = DeskBrowser(desk_app(root))
    assert ADDRESS not in anna.page()
    assert anna.client.get(ADDRESS).status_code == 404
    (root / "reports").mkdir()
    (root / "reports" / "index.html").write_text('<a href="2026-W46.html">a page of somebody else</a>')
    assert anna.client.get(ADDRESS).status_code == 404


@pytest.mark.parametrize(
    ("more", "words"),
    [(["--index", "public"], "--index is for the desk"), (["--desk", "--index", "public"], "no index")],
)
def test_a_folder_without_an_index_and_an_index_without_a_desk_are_mistakes(
    tmp_path: Path, more: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    root = desk_site(tmp_path / "shop").root
    assert run(cli, ["-C", str(root), "serve", "--port", "0", *more]) == 2
    assert words in capsys.readouterr().err
