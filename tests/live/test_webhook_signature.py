"""Signed webhooks: the signature of the published example, one id for all tries of an event, no weak secret."""

from __future__ import annotations

import base64

import pytest
from test_alarm_delivery import QUICK, receiver

from vsd_analytics.errors import UsageError
from vsd_analytics.live.delivery import Webhook, webhook_of
from vsd_analytics.live.webhook_signature import secret_of, signature
from vsd_analytics.site.model import AlarmDelivery

SECRET = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"


def test_the_signature_is_that_of_the_published_example() -> None:
    body = b'{"test": 2432232314}'
    found = signature("msg_p5jXN8AQM9LWM0D4loKWxJek", at_s=1614265330, body=body, key=secret_of(SECRET))
    assert found == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_each_try_of_an_event_has_its_id_and_a_signature_of_its_own_time() -> None:
    seconds = iter([100.0, 160.0, 170.0])
    with receiver(500) as server:
        webhook = Webhook(server.url, key=secret_of(SECRET), clock=lambda: next(seconds), waits_s=QUICK)
        webhook.send({"n": 1})
        webhook.send({"n": 2})
        assert webhook.stop(timeout_s=5)
    first, again, other = [{k.lower(): v for k, v in h.items()} for h in server.headers]
    assert first["webhook-id"] == again["webhook-id"] != other["webhook-id"]
    assert [h["webhook-timestamp"] for h in (first, again, other)] == ["100", "160", "170"]
    expected = signature(again["webhook-id"], at_s=160, body=b'{"n": 1}', key=secret_of(SECRET))
    assert again["webhook-signature"] == expected != first["webhook-signature"]


def test_the_environment_names_the_secret_and_without_one_nothing_is_signed() -> None:
    for environ, is_signed in (({"VSD_WEBHOOK_SECRET": SECRET}, True), ({}, False)):
        with receiver() as server:
            webhook = webhook_of(AlarmDelivery(webhook=server.url), environ=environ)
            assert webhook is not None
            webhook.send({"n": 1})
            assert webhook.stop(timeout_s=5)
        assert any(name.lower() == "webhook-signature" for name in server.headers[0]) is is_signed


@pytest.mark.parametrize("secret", ["short", "whsec_", "whsec_!!!", base64.b64encode(b"x" * 23).decode(), "whsec_é"])
def test_a_secret_that_cannot_sign_is_refused_with_a_command_that_makes_one(secret: str) -> None:
    with pytest.raises(UsageError, match="no secret for signing") as refused:
        webhook_of(AlarmDelivery(webhook="http://127.0.0.1/"), environ={"VSD_WEBHOOK_SECRET": secret})
    assert "openssl rand" in str(refused.value.fix)
