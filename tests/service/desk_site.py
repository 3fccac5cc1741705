"""A small site with a question that was asked, and a browser that signed in at its desk."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from vsd_analytics.config.asked_questions import remember
from vsd_analytics.config.project import load_site
from vsd_analytics.service.access import RateLimit
from vsd_analytics.service.answers import ReportAnswers
from vsd_analytics.service.app import make_app
from vsd_analytics.service.desk import Desk
from vsd_analytics.service.index_files import IndexFiles
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AskedQuestion

READ_TOKEN, DESK_TOKEN = "a-token-of-readers", "a-token-of-the-desk"
NOW = datetime(2026, 11, 17, 9, 30, tzinfo=UTC)
HERE = "http://testserver"
TOML = """
[site]
id = "shop"
name = "Shop <b>"
timezone = "Europe/Rome"
{more}
[[floor]]
id = "ground"
name = "Ground"

[[camera]]
id = "cam-1"
name = "Camera"
floor = "ground"

[[area]]
id = "entrance"
name = "Door & <i>mat</i>"
floor = "ground"
polygon = [[0, 0], [4, 0], [4, 4], [0, 4]]
"""
QUESTION = "Q46-entrance-clear"


def desk_site(root: Path, *, more: str = "") -> Site:
    """Make the project."""
    root.mkdir(parents=True, exist_ok=True)
    (root / "vsd.toml").write_text(TOML.format(more=more), encoding="utf-8")
    site = load_site(root)
    monday = date(2026, 11, 9)
    asked = AskedQuestion(monday, "ground", QUESTION, "entrance", "clear", "Could <u>Door</u> be free?", "entrance")
    remember(site, [asked])
    return site


def desk_app(root: Path, *, has_desk: bool = True, present: Callable[[], datetime] = lambda: NOW) -> Any:
    """Return the service of a project."""
    answers = ReportAnswers(root)
    desk = (
        Desk(answers, token=DESK_TOKEN, index=IndexFiles(root / "reports", project=root), present=present)
        if has_desk
        else None
    )
    return make_app(answers, token=READ_TOKEN, limit=RateLimit(per_min=1e6, burst=10**6), title="Shop", desk=desk)


class DeskBrowser:
    """A browser at the desk.

    Args:
        app: The service.
        writer: Name to sign in with; None = not signed in.
    """

    def __init__(self, app: Any, *, writer: str | None = "Anna") -> None:
        self.client = TestClient(app, raise_server_exceptions=False, follow_redirects=False, headers={"Origin": HERE})
        if writer is not None:
            assert self.sign_in(writer).headers["location"] == "/desk"

    def sign_in(self, writer: str, token: str = DESK_TOKEN, **more: str) -> Any:
        return self.client.post("/desk/sign-in", data={"writer": writer, "token": token, **more})

    def page(self) -> str:
        return str(self.client.get("/desk").text)

    def hidden(self) -> dict[str, str]:
        """Return the hidden fields of a new form."""
        page = self.page()
        return {name: hidden_value(page, name) for name in ("form", "request")}

    def send(self, job: str, headers: dict[str, str] | None = None, **fields: str) -> Any:
        """Fill in a form and send it; fields given win over hidden ones."""
        return self.client.post(f"/desk/{job}", data=self.hidden() | fields, headers=headers)


def hidden_value(page: str, name: str) -> str:
    found = re.search(rf'name="{name}" value="([^"]*)"', page)
    assert found is not None
    return found[1]
