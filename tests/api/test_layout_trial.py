"""A layout tried from Python: the answers of `vsd whatif`, and people who are read once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import vsd_analytics as vsd
from vsd_analytics.api import layout_trial
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.errors import ConfigError

EDIT = '[[fixture]]\nid = "post"\npolygon = [[10, 5], [10.3, 5], [10.3, 5.3], [10, 5.3]]\n'


def test_a_trial_answers_as_the_command_does_and_reads_people_once(
    demo_project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "edit.toml").write_text(EDIT, encoding="utf-8")
    asked = ("--range", "2026-11-14..2026-11-14", "--no-receipt", "--json")
    assert run(cli, ["-C", str(demo_project), "whatif", str(tmp_path / "edit.toml"), *asked]) == 0
    printed = json.loads(capsys.readouterr().out)["answers"]
    n_read = []
    monkeypatch.setattr(
        layout_trial, "everybody", lambda *given, of=layout_trial.everybody: (n_read.append(given), of(*given))[1]
    )
    trial = vsd.open(demo_project).try_layout("2026-11-14")
    tables = trial.answer(EDIT)
    assert set(tables) == set(printed)
    assert tables["whatif"]["n_touched"] == [row["n_touched"]["value"] for row in printed["whatif"]["rows"]]
    ranges = [row["predicted_change"]["lo"] for row in printed["whatif_places"]["rows"]]
    assert tables["whatif_places"]["predicted_change_lo"] == pytest.approx(ranges, abs=1e-5)
    assert "“post” is in the way of" in tables["whatif"].note
    trial.answer(EDIT.replace("10", "12"))
    assert len(n_read) == 1


def test_mistakes_of_typed_edits_are_named(demo_project: Path) -> None:
    trial = vsd.open(demo_project).try_layout("2026-11-14")
    with pytest.raises(ConfigError, match="the text has 1 mistake"):
        trial.answer('[[fixture]]\nid = "post"\n')
    with pytest.raises(ConfigError) as raised:
        trial.answer("[[fixture\n")
    assert raised.value.problems[0].code == "E121"
