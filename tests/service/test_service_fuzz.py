"""Whatever is asked, the service answers as its OpenAPI document says, and never fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from vsd_analytics.service.openapi import ADDRESSES

schemathesis = pytest.importorskip("schemathesis", reason="the extra test is not installed")
pytest.importorskip("starlette", reason="the extra serve is not installed")

TOKEN = "a-token-of-the-tests"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
STEADY = settings(
    max_examples=20,
    derandomize=True,
    deadline=None,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)


@pytest.fixture(scope="module")
def app(demo_project: Path) -> Any:
    from vsd_analytics.service.access import RateLimit
    from vsd_analytics.service.answers import ReportAnswers
    from vsd_analytics.service.app import make_app

    limit = RateLimit(per_min=1e6, burst=10**6)
    return make_app(ReportAnswers(demo_project), token=TOKEN, limit=limit, title="Shop")


@pytest.fixture(scope="module")
def described(app: Any) -> Any:
    return schemathesis.openapi.from_asgi("/openapi.json", app, headers=BEARER)


@pytest.mark.parametrize("path", [address.path for address in ADDRESSES])
def test_answers_are_as_documented(path: str, described: Any) -> None:
    @given(case=described[path]["GET"].as_strategy())
    @STEADY
    def check(case: Any) -> None:
        case.call_and_validate(headers=BEARER)

    check()


@given(path=st.text(min_size=1, max_size=60))
@STEADY
def test_any_path_is_answered_with_an_error_in_words(path: str, app: Any) -> None:
    from starlette.testclient import TestClient

    client = TestClient(app, raise_server_exceptions=False, headers=BEARER)
    answer = client.get("/v1/weeks/last/floors/" + quote(path, safe="/") + "/report")
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["title"]
