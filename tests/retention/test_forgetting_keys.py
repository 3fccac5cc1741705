"""Keys of pseudonyms destroyed: no day ever gets a second one, and records of such days are refused."""

from __future__ import annotations

import json
import shutil
from datetime import date
from pathlib import Path

import pytest
from aged_projects import DAYS, TERMS, TOML, audit, day, make_project, messages, three_days, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError
from vsd_analytics.retention.purge import forget_keys
from vsd_analytics.store import secrets
from vsd_analytics.store.secrets import DayKeys


@pytest.fixture(scope="module")
def stored_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_project(tmp_path_factory.mktemp("kept") / "p", toml=TOML.replace("pseudonyms = false", ""))
    vsd(root, "ingest", str(three_days(root)))
    return root


@pytest.fixture
def project(stored_once: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored_once, tmp_path / "p"))


def keys(root: Path) -> list[str]:
    return [d.isoformat() for d in DayKeys(root / "secrets").days()]


def test_keys_of_purged_days_go_and_those_of_days_with_records_stay(project: Path) -> None:
    """Site days start at 4:00 in Rome, so that the UTC hours 0 to 2 belong to the day before."""
    assert keys(project) == ["2026-11-08", *DAYS]
    assert "nothing to remove" in vsd(project, "purge", "--forget-keys")
    told = json.loads(vsd(project, "purge", "--older-than", DAYS[2], "--force", "--forget-keys", "--json"))
    assert told["keys"]["forgotten_days"] == ["2026-11-08", DAYS[0]]
    assert keys(project) == [DAYS[1], DAYS[2]], "of 10 November the hours after midnight are still there"
    assert [e.get("forgotten_days") for e in audit(project)] == [None, ["2026-11-08", DAYS[0]]]


@pytest.mark.parametrize("is_separate", [False, True])
def test_the_key_of_the_last_purged_day_goes_where_no_record_of_it_is_left(tmp_path: Path, is_separate: bool) -> None:
    """A site day ends at 4:00 of the next date: until then records would be left, and there are none."""
    root = make_project(tmp_path / "p", toml=TOML.replace("pseudonyms = false", ""))
    found = [m for d in DAYS for m in messages(camera="cam-1", day=d, hours=(9,))]
    vsd(root, "ingest", str(write(root / "f.jsonl", found)))
    assert keys(root) == [*DAYS]
    age = ("purge", "--older-than", DAYS[2], "--force")
    told = json.loads(vsd(root, *age, "--forget-keys", "--dry-run", "--json"))
    assert told["keys"]["forgotten_days"] == [DAYS[0], DAYS[1]]
    if is_separate:
        vsd(root, *age)
        vsd(root, "purge", "--forget-keys")
    else:
        vsd(root, *age, "--forget-keys")
    assert keys(root) == [DAYS[2]]


def test_a_purge_of_everything_leaves_no_key(project: Path) -> None:
    vsd(project, "purge", "--older-than", "2026-11-12", "--force", "--forget-keys")
    assert keys(project) == []


def test_records_of_a_forgotten_day_are_refused_and_others_stored(project: Path) -> None:
    forget_keys(load_site(project), before=day(DAYS[1]), terms=TERMS)
    early = messages(camera="cam-1", day=DAYS[0], hours=(0,))
    late = messages(camera="cam-1", day=DAYS[2], hours=(15,))
    told = json.loads(vsd(project, "ingest", str(write(project / "f.jsonl", [*early, *late])), "--json", code=1))
    assert told["sources"][0]["quarantined"] == {"forgotten-day": 90 + 120}
    assert told["stored"]["frames"]["new"] == 90
    assert "2026-11-08" not in keys(project)


def test_a_forgotten_day_never_gets_another_key(tmp_path: Path) -> None:
    first = DayKeys(tmp_path / "secrets")
    old = first.key(day(DAYS[0]))
    busy = DayKeys(tmp_path / "secrets")
    first.forget([day(DAYS[0])])
    assert DayKeys(tmp_path / "secrets").forgotten() == {day(DAYS[0])}
    for some in (first, busy):
        with pytest.raises(StoreError) as caught:
            some.key(day(DAYS[0]))
        assert caught.value.code == "E303"
    assert first.key(day(DAYS[1])) != old


@pytest.mark.parametrize("crash_in", ["publish", "remove"])
def test_a_crash_while_forgetting_never_lets_a_day_count_twice(
    tmp_path: Path, crash_in: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys_of = DayKeys(tmp_path)
    keys_of.key(day(DAYS[0]))

    def crash(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(secrets, crash_in, crash)
        with pytest.raises(KeyboardInterrupt):
            keys_of.forget([day(DAYS[0])])
    is_listed = day(DAYS[0]) in DayKeys(tmp_path).forgotten()
    assert is_listed == (crash_in == "remove")
    assert DayKeys(tmp_path).days() == [day(DAYS[0])]
    DayKeys(tmp_path).forget([day(DAYS[0])])
    assert DayKeys(tmp_path).days() == []


@pytest.mark.parametrize("line", ["", "{}", '{"day": "yesterday"}', "[1]", "\xff"])
def test_a_damaged_list_of_forgotten_days_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / "forgotten.jsonl").write_bytes(line.encode("latin-1") + b"\n")
    with pytest.raises(StoreError) as caught:
        DayKeys(tmp_path).forgotten()
    assert caught.value.code == "E303"


def test_dry_run_says_which_and_destroys_none(project: Path) -> None:
    told = json.loads(vsd(project, "purge", "--older-than", DAYS[2], "--forget-keys", "--dry-run", "--json"))
    assert told["keys"]["forgotten_days"] == ["2026-11-08", DAYS[0]]
    assert len(keys(project)) == 4
    assert DayKeys(project / "secrets").forgotten() == frozenset[date]()
