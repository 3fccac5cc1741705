"""[[alarm]] and [alarms] of vsd.toml: what loads, and that every mistake is reported with a fix."""

from __future__ import annotations

from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.config.first_config import FirstAnswers, write_first_config
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.site.model import AlarmDelivery, AlarmRule, Site

SITE = site_text(more='[[area]]\nid = "queue"\nname = "Queue"\npolygon = [[0, 0], [4, 0], [4, 4]]\n')


def load(folder: Path, text: str) -> Site:
    (folder / "vsd.toml").write_text(SITE + text, encoding="utf-8")
    return load_site(folder)


def test_rules_are_read_with_their_defaults(tmp_path: Path) -> None:
    site = load(
        tmp_path,
        """
[[alarm]]
id = "crowd"
kind = "gathering"
people = 4
for_s = 60
area = "queue"
cooldown_s = 0
open_only = false
[[alarm]]
id = "close"
kind = "contact"
for_s = 900.5
cameras = ["cam-1"]
between_groups = false
[[alarm]]
id = "dead"
kind = "silence"
for_s = 120
[alarms]
webhook = "https://example.org/hook?x=1"
lateness_s = 5
""",
    )
    assert site.alarms == (
        AlarmRule("crowd", "gathering", 60, "queue", (), 4, 0.0, is_open_only=False),
        AlarmRule("close", "contact", 900.5, None, ("cam-1",), is_between_groups=False),
        AlarmRule("dead", "silence", 120),
    )
    assert site.alarm_delivery == AlarmDelivery(webhook="https://example.org/hook?x=1")
    assert site.settings.lateness_s == 5.0
    assert load(tmp_path, '[mqtt]\nhost = "h"\n[alarms]\ntopic = "a/b"\n').alarm_delivery.topic == "a/b"


RULE = '[[alarm]]\nid = "a"\nkind = "gathering"\nfor_s = 60\n'

MISTAKES = {
    "no kind": (RULE.replace('kind = "gathering"\n', ""), "E123", "has no kind"),
    "another kind": (RULE.replace("gathering", "gatherings"), "E124", "not one of gathering, contact, silence"),
    "no time": (RULE.replace("for_s = 60\n", ""), "E123", "has no for_s"),
    "a negative time": (RULE.replace("60", "-1"), "E124", "outside 0 to 86,400"),
    "no id": (RULE.replace('id = "a"\n', ""), "E123", "has no id"),
    "an id twice": (RULE + RULE, "E125", "two alarms have the id"),
    "an unknown area": (RULE + 'area = "queu"\n', "E125", "not described"),
    "an unknown camera": (RULE + 'cameras = ["cam-9"]\n', "E125", "not described"),
    "one person": (RULE + "people = 1\n", "E124", "outside 2 to"),
    "an unknown key": (RULE + "peoples = 3\n", "E122", "knows no key"),
    "a silent area": (RULE.replace("gathering", "silence") + 'area = "queue"\n', "E124", "has no area"),
    "groups of a gathering": (RULE + "between_groups = true\n", "E124", "has no between_groups"),
    "many in contact": (RULE.replace("gathering", "contact") + "people = 3\n", "E124", "has no people"),
    "a file as webhook": ('[alarms]\nwebhook = "file:///etc/passwd"\n', "E124", "no http or https"),
    "a webhook without host": ('[alarms]\nwebhook = "https://"\n', "E124", "no http or https"),
    "a webhook with a bad port": ('[alarms]\nwebhook = "http://h:x/"\n', "E124", "no http or https"),
    "a topic without broker": ('[alarms]\ntopic = "a/b"\n', "E124", "needs a broker"),
    "a topic with a wildcard": ('[mqtt]\nhost = "h"\n[alarms]\ntopic = "a/#"\n', "E124", "wildcard"),
    "an unknown key of alarms": ('[alarms]\nhook = "x"\n', "E122", "knows no key"),
    "a setting out of range": ("[alarms]\nlateness_s = -1\n", "E124", "outside 0 to 3,600"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_every_mistake_is_reported_with_its_fix(tmp_path: Path, name: str) -> None:
    text, code, words = MISTAKES[name]
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, text)
    (problem,) = caught.value.problems
    assert problem.code == code
    assert words in problem.what
    assert problem.fix
    assert problem.where is not None
    assert problem.where.line is not None


def test_the_example_of_the_first_config_is_a_rule(tmp_path: Path) -> None:
    write_first_config(tmp_path, answers=FirstAnswers("Shop", "Europe/Rome"))
    path = tmp_path / "vsd.toml"
    text = path.read_text()
    assert load_site(tmp_path).alarms == ()
    example = text[text.index("# [[area]]") :].replace("\n# ", "\n").removeprefix("# ")
    path.write_text(text[: text.index("# [[area]]")] + example)
    assert load_site(tmp_path).alarms == (AlarmRule("queue-too-full", "gathering", 60, "checkout-queue", (), 4),)
