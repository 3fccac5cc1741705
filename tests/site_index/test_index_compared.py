"""The comparison on the page: from JSON files to the sentence, the funnel, the table by name, and `--json`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from forbidden_words import forbidden_in
from report.pages.test_report_page import Tree
from site_index import many_reports as many
from site_index.compared_sites import NAMES, write_sites

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.site_index.collect_reports import gather, sources_of
from vsd_analytics.site_index.floor_weeks import catalogue
from vsd_analytics.site_index.page import make_index, render_index
from vsd_analytics.site_index.read_reports import read_report_json
from vsd_analytics.wording.languages import speaking


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_sites(tmp_path_factory.mktemp("sites"))


def index_of(folders: list[Path], out: Path):  # type: ignore[no-untyped-def]
    return catalogue(gather(sources_of(folders), out).entries)


def test_the_page_names_who_differs_and_by_how_much_in_both_languages(folders: list[Path], tmp_path: Path) -> None:
    found = index_of(folders, tmp_path)
    section = make_index(found).compare
    assert section is not None
    assert re.fullmatch(
        r"Two floors really differ from the others: Harbour Office, \d\d% less time too close than usual at the same "
        r"crowding \(likely between \d\d% and \d\d% less\); Riverside Store, \d\d% more time too close than usual "
        r"at the same crowding \(likely between \d\d% and \d+% more\)\.",
        section.sentence,
    )
    text = render_index(found)
    assert "Castle Shop (23% not recorded)" in text
    assert "as an older version made the reports: North Gate." in text
    assert forbidden_in(re.sub(r"<(style|svg).*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)) == []
    with speaking("it"):
        italian = make_index(found).compare
        assert italian is not None
        assert italian.sentence.startswith("Due piani sono davvero diversi dagli altri: Harbour Office, tempo troppo")
        assert "Castle Shop (23% non registrato)" in " ".join(italian.notes)


def test_floors_stand_by_name_and_only_the_two_are_named_in_the_funnel(folders: list[Path], tmp_path: Path) -> None:
    section = make_index(index_of(folders, tmp_path)).compare
    assert section is not None
    assert [r.name for r in section.rows] == sorted(NAMES, key=str.casefold)
    for drawn in (section.wide, section.narrow):
        texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn)
        assert [t for t in texts if t in NAMES] == ["Riverside Store", "Harbour Office"]
        assert "23% not recorded" in texts
        assert drawn.count('class="fu"') == 8
        assert len(Tree(str(drawn)).elements) > 20
    notes = {r.name: r.note for r in section.rows}
    assert notes["Castle Shop"] == "Not judged: cameras were silent"
    assert notes["North Gate"] == "Made by an older version: make the report again"
    assert notes["Kingsway"] == ""


def test_json_has_the_comparison_by_name(
    folders: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(cli, ["site", "build", *map(str, folders), "--out", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["comparison"]
    assert [f["name"] for f in told["floors"] if f["differs"]] == ["Harbour Office", "Riverside Store"]
    assert [f["name"] for f in told["floors"]] == sorted(NAMES, key=str.casefold)
    gone = next(f for f in told["floors"] if f["name"] == "Castle Shop")
    assert (gone["status"], gone["differs"], gone["said"]) == ("gaps", None, None)
    assert gone["not_recorded"] == pytest.approx(7 / 30, rel=1e-3)


def test_files_of_an_older_version_are_named_and_nothing_is_drawn(tmp_path: Path) -> None:
    section = make_index(index_of(many.company(tmp_path), tmp_path / "out")).compare
    assert section is not None
    assert section.wide == ""
    assert section.sentence.startswith("No floor is said to differ: fewer than four can be compared")
    assert {r.note for r in section.rows} == {"Made by an older version: make the report again"}


def test_a_file_whose_classes_do_not_fit_together_is_damaged(folders: list[Path], tmp_path: Path) -> None:
    path = next(iter(sorted((folders[0] / "reports").glob("*.json"))))
    made = json.loads(path.read_text())
    made["close_by_crowding"]["days"][0]["person_h"].pop()
    copy = tmp_path / path.name
    copy.write_text(json.dumps(made))
    with pytest.raises(Exception, match="damaged") as caught:
        read_report_json(copy)
    assert "does not fit together" in str(caught.value.why)  # type: ignore[attr-defined]
