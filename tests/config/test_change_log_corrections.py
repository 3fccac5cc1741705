"""Corrections, withdrawals and answers of the change log: the file only grows, the list shows what holds."""

from __future__ import annotations

import os
from datetime import date, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import pytest
from click.testing import CliRunner

from vsd_analytics.cli import cli
from vsd_analytics.config.asked_questions import asked_question, read_asked, remember
from vsd_analytics.config.change_log import (
    add_answer,
    add_entry,
    edit_entry,
    entry_ids,
    read_answers,
    read_log,
    remove_entry,
)
from vsd_analytics.config.log_records import read_records
from vsd_analytics.errors import DiskError, InputError, UsageError
from vsd_analytics.site.model import Area, Site
from vsd_analytics.site.questions import AskedQuestion

ROME = ZoneInfo("Europe/Rome")
ASKED = AskedQuestion(
    date(2026, 11, 9), "floor", "Q46-entrance-clear", "entrance", "clear", "Could Entrance be free?", "entrance"
)
CAMERA = AskedQuestion(
    date(2026, 11, 16), "floor", "Q47-cam-1-record", "cam-1", "record", "How can it record?", None, is_change=False
)


@pytest.fixture
def site(tmp_path: Path) -> Site:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    made = Site("s", "S", "Europe/Rome", tmp_path, areas=(Area("entrance", "Entrance", "floor", square),))
    add_entry(made, text="moved", at="2026-11-11T12:00", area="entrance")
    add_entry(made, text="painted", at="2026-11-12T12:00")
    return made


def id_of(site: Site, text: str) -> str:
    return next(name for entry, name in entry_ids(site).items() if entry.text == text)


def test_an_entry_is_removed_once_however_often_it_is_removed(site: Site) -> None:
    name = id_of(site, "moved")
    assert [remove_entry(site, name, at="2026-11-14").is_new for _ in range(2)] == [True, False]
    assert [e.text for e in read_log(site)] == ["painted"]
    assert len(read_records(site)) == 3


@pytest.mark.parametrize("asked", [ASKED, CAMERA])
def test_the_last_answer_is_taken_back_and_the_one_before_holds_again(site: Site, asked: AskedQuestion) -> None:
    remember(site, [asked])
    question = asked.question_id
    add_answer(site, question, "later", at="2026-11-18", by="Anna")
    add_answer(site, question, "tried", at="2026-11-19", text="Done.", by="Bea")
    assert [a.kind for a in read_answers(site)] == ["later", "tried"]
    assert remove_entry(site, question, at="2026-11-20T09:00", by="Carla").is_new
    assert [(a.kind, a.by) for a in read_answers(site)] == [("later", "Anna")]
    last = read_records(site)[-1]
    assert (last.withdrawn_by, str(last.withdrawn_at)) == ("Carla", "2026-11-20 09:00:00+01:00")
    assert [e.text for e in read_log(site)] == ["moved", "painted"]
    remove_entry(site, question, at="2026-11-20")
    assert read_answers(site) == ()
    with pytest.raises(UsageError, match="neither an id nor a number"):
        remove_entry(site, question, at="2026-11-20")


def test_who_logged_an_entry_is_stored_with_it(site: Site) -> None:
    add_entry(site, text="swept", at="2026-11-13", by="Anna")
    assert [e.by for e in read_log(site)] == [None, None, "Anna"]
    with pytest.raises(UsageError, match="--by"):
        add_entry(site, text="swept again", at="2026-11-13", by="a\u202eb\n")


def test_a_number_is_refused_where_it_would_mean_another_entry_next_time(site: Site) -> None:
    with pytest.raises(UsageError, match="by its id") as refused:
        remove_entry(site, "1", at="2026-11-14")
    assert refused.value.fix == f"vsd log remove {id_of(site, 'moved')}"
    with pytest.raises(UsageError, match="by its id") as refused:
        edit_entry(site, "1", at="2026-11-13T07:00")
    name = id_of(site, "moved")
    assert refused.value.fix == f"vsd log edit {name} --at 2026-11-13T07:00+01:00"
    assert len(read_records(site)) == 2
    edit_entry(site, "1", at="2026-11-10T07:00", text="moved away")
    assert id_of(site, "moved away") == name, "an id stays when its entry is corrected"


def test_an_entry_added_again_has_an_id_of_its_own(site: Site) -> None:
    first = id_of(site, "moved")
    remove_entry(site, first, at="2026-11-14")
    add_entry(site, text="moved", at="2026-11-11T12:00", area="entrance")
    second = id_of(site, "moved")
    assert second != first
    assert not remove_entry(site, first, at="2026-11-15").is_new
    assert "moved" in [e.text for e in read_log(site)]


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_only_its_owner_reads_a_new_log_and_a_shared_one_stays_shared(tmp_path: Path, umask: int) -> None:
    old = os.umask(umask)
    try:
        made = Site("s", "S", "Europe/Rome", tmp_path)
        add_entry(made, text="moved by Anna", at="2026-11-11")
        assert (tmp_path / "log.jsonl").stat().st_mode & 0o777 == 0o600
        (tmp_path / "log.jsonl").chmod(0o644)
        add_entry(made, text="painted", at="2026-11-12")
        assert (tmp_path / "log.jsonl").stat().st_mode & 0o777 == 0o666 & ~umask
    finally:
        os.umask(old)


def test_a_corrected_entry_takes_its_new_place_in_the_list_and_keeps_its_history(site: Site) -> None:
    before = (site.root / "log.jsonl").read_bytes()
    edit_entry(site, id_of(site, "moved"), at="2026-11-13T07:00", text="moved away")
    assert [(e.text, e.area_id, e.at.day) for e in read_log(site)] == [
        ("painted", None, 12),
        ("moved away", "entrance", 13),
    ]
    assert (site.root / "log.jsonl").read_bytes().startswith(before)
    assert [r.supersedes.text if r.supersedes else None for r in read_records(site)] == [None, None, "moved"]


def test_an_entry_that_was_taken_back_can_be_added_again(site: Site) -> None:
    remove_entry(site, id_of(site, "moved"), at="2026-11-14")
    assert [e.text for e in read_log(site)] == ["painted"]
    assert add_entry(site, text="moved", at="2026-11-11T12:00", area="entrance").is_new
    assert [e.text for e in read_log(site)] == ["moved", "painted"]


def test_a_correction_of_nothing_or_into_another_entry_is_refused(site: Site) -> None:
    with pytest.raises(UsageError, match="says this already"):
        edit_entry(site, "1", text="moved")
    with pytest.raises(UsageError, match="another entry"):
        edit_entry(site, id_of(site, "painted"), text="moved", at="2026-11-11T12:00", area="entrance")
    with pytest.raises(UsageError, match="no entry 3"):
        remove_entry(site, "3", at="2026-11-14")
    assert len(read_records(site)) == 2


def test_a_full_disk_leaves_the_entry_as_it_was(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_args: object, **_more: object) -> None:
        raise DiskError("the disk is full", code="E304")

    monkeypatch.setattr("vsd_analytics.store.durable.publish", full)
    before = (site.root / "log.jsonl").read_bytes()
    with pytest.raises(DiskError):
        remove_entry(site, id_of(site, "moved"), at="2026-11-14")
    assert (site.root / "log.jsonl").read_bytes() == before


def test_what_was_tried_is_a_change_of_the_questions_area(site: Site) -> None:
    remember(site, [ASKED])
    add_answer(site, "q46-ENTRANCE-clear", "tried", at="2026-11-18T07:00", by="Anna")
    entry = read_log(site)[-1]
    assert (entry.text, entry.area_id, entry.question, entry.by) == (ASKED.text, "entrance", ASKED.question_id, "Anna")
    assert entry.at == datetime(2026, 11, 18, 7, tzinfo=ROME)
    remove_entry(site, id_of(site, ASKED.text), at="2026-11-19")
    assert read_answers(site) == ()


@pytest.mark.parametrize("kind", ["not-possible", "later"])
def test_what_was_not_tried_is_an_answer_and_no_change(site: Site, kind: str) -> None:
    remember(site, [ASKED])
    add_answer(site, ASKED.question_id, kind, at="2026-11-18", text="the fire door")  # type: ignore[arg-type]
    assert len(read_log(site)) == 2
    assert [(a.question, a.kind, a.text) for a in read_answers(site)] == [(ASKED.question_id, kind, "the fire door")]


def test_a_repaired_camera_is_no_change_of_the_site(site: Site) -> None:
    remember(site, [CAMERA])
    add_answer(site, CAMERA.question_id, "tried", at="2026-11-18")
    assert len(read_log(site)) == 2
    assert [a.kind for a in read_answers(site)] == ["tried"]


def test_an_unknown_question_is_answered_with_the_nearest(site: Site) -> None:
    remember(site, [ASKED])
    with pytest.raises(UsageError, match="Q46-entrance-claer") as caught:
        add_answer(site, "Q46-entrance-claer", "later", at="2026-11-18")
    assert ASKED.question_id in str(caught.value.fix)


def test_of_a_week_that_was_made_twice_the_last_question_counts_and_both_can_be_answered(site: Site) -> None:
    other = AskedQuestion(ASKED.monday, "floor", "Q46-queue-wait", "queue", "wait", "Could they wait?")
    assert [remember(site, [one]) for one in (ASKED, ASKED, other, other)] == [1, 0, 1, 0]
    assert read_asked(site) == (other,)
    assert asked_question(site, ASKED.question_id) == ASKED


def test_a_question_of_a_line_that_broke_off_is_left_out_and_a_bad_line_is_named(site: Site) -> None:
    remember(site, [ASKED])
    path = site.root / "questions.jsonl"
    path.write_bytes(path.read_bytes() + b'{"week": "2026-W4')
    assert read_asked(site) == (ASKED,)
    path.write_text('{"week": 3}\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"line 1 of questions\.jsonl"):
        read_asked(site)


def test_the_list_shows_what_holds_and_the_history_what_was(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "s"\nname = "S"\ntimezone = "Europe/Rome"\n[[camera]]\nid = "cam-1"\nname = "Door"\n',
        encoding="utf-8",
    )

    def run(*words: str) -> str:
        result = CliRunner().invoke(cli, ["-C", str(tmp_path), "--now", "2026-11-20T12:00Z", "log", *words])
        assert result.exit_code == 0, result.output
        return result.output

    run("add", "moved", "--at", "2026-11-11T12:00")
    run("edit", "1", "--text", "moved away")
    number, name, *said = run("list").split()
    assert (number, said) == ("1", ["2026-11-11T12:00+01:00", "whole", "site", "moved", "away"])
    run("remove", name)
    assert "was removed before" in run("remove", name)
    assert "moved away" not in run("list")
    history = run("list", "--all")
    kinds = [line.split()[1] for line in history.splitlines() if line.split()[0] != "before"]
    assert kinds == ["added", "corrected", "removed"]
