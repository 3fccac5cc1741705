"""`vsd calibrate --draw`: the page, the same bytes again, safe text, and every word in the catalogue."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from engine.vsd_in_a_shop import Vsd
from site_text import site_text

from vsd_analytics.calibration_page.page import SCRIPTS, sentences
from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.planner.script import one_script
from vsd_analytics.resources import shipped
from vsd_analytics.wording import catalogue
from vsd_analytics.wording.languages import speaking

STATIC = shipped("reports") / "static"
HOSTILE = '</script><img src=x onerror="alert(1)">'


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    cv2.imwrite(str(tmp_path / "scene.png"), np.full((720, 1280, 3), 120, dtype=np.uint8))
    (tmp_path / "vsd.toml").write_text(site_text(more='picture = "scene.png"\n'))

    def command(*words: str) -> tuple[int, str, str]:
        return run(cli, ["-C", str(tmp_path), *words]), *capsys.readouterr()

    return command


def page_of(folder: Path) -> str:
    return (folder / "calibration" / "cam-1-draw.html").read_text(encoding="utf-8")


def meta(page: str) -> dict[str, object]:
    found = re.search(r'<script type="application/json" id="meta">(.*?)</script>', page)
    assert found
    return dict(json.loads(found[1]))


def test_page_is_written_beside_the_calibrations_and_has_the_same_bytes_again(tmp_path: Path, vsd: Vsd) -> None:
    code, printed, err = vsd("calibrate", "cam-1", "--draw")
    assert (code, err) == (0, "")
    assert "cam-1-draw.html" in printed
    first = page_of(tmp_path)
    vsd("calibrate", "cam-1", "--draw", "--json")
    assert page_of(tmp_path) == first
    assert meta(first)["picture"] == {"size": [1280, 720]}
    assert "data:image/webp;base64," in first
    assert "http://" not in first.replace("http://www.w3.org", "")


def test_points_of_the_calibration_in_force_are_there_to_correct(tmp_path: Path, vsd: Vsd) -> None:
    (tmp_path / "p.csv").write_text("u,v,x,y\n100,700,0,0\n1200,700,5,0\n900,300,5,9\n300,300,0,9\n640,500,2.5,4\n")
    (tmp_path / "vsd.toml").write_text(site_text(more='picture = "scene.png"\npoints = "p.csv"\n'))
    vsd("calibrate", "cam-1", "--draw")
    known = meta(page_of(tmp_path))
    assert known["points"][0] == [100, 700, 0, 0]  # type: ignore[index]
    assert len(known["homography"]) == 9  # type: ignore[arg-type]


def test_names_from_vsd_toml_cannot_leave_their_text(tmp_path: Path, vsd: Vsd) -> None:
    text = site_text(more='picture = "scene.png"\n').replace('name = "Entrance"', f"name = '{HOSTILE}'")
    area = f"\n[[area]]\nid = \"a\"\nname = '{HOSTILE}'\npolygon = [[0, 0], [1, 0], [1, 1]]\n"
    (tmp_path / "vsd.toml").write_text(text + area)
    code, _, err = vsd("calibrate", "cam-1", "--draw")
    assert (code, err) == (0, "")
    assert "<img src=x" not in page_of(tmp_path)
    assert page_of(tmp_path).count("</script>") == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--draw", "--points", "p.csv"], "exclude each other"),
        (["--picture", "scene.png"], "belong to --draw"),
        (["--draw", "--picture", "nowhere.png"], "cannot be shown"),
        (["--draw", "--picture", "square.png"], "600x600"),
    ],
)
def test_options_that_cannot_be_are_errors_for_people(
    words: list[str], says: str, tmp_path: Path, vsd: Vsd, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("square.png", np.zeros((600, 600, 3), dtype=np.uint8))
    code, _, err = vsd("calibrate", "cam-1", *words)
    assert code == 2
    assert says in err


def test_camera_without_picture_and_floor_without_plan_have_a_page_that_says_so(tmp_path: Path, vsd: Vsd) -> None:
    (tmp_path / "vsd.toml").write_text(site_text())
    assert vsd("calibrate", "cam-1", "--draw")[0] == 0
    page = page_of(tmp_path)
    assert "--picture FILE" in page
    assert "the squares are a metre wide" in page


def literals(text: str) -> list[str]:
    bare = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = re.findall(r"'((?:[^'\\\n]|\\.)*)'", bare)
    return found + [re.sub(r"\$\{[^{}]*\}", "", each) for each in re.findall(r"`((?:[^`\\]|\\.)*)`", bare)]


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_script_holds_no_sentence(name: str) -> None:
    for text in literals((STATIC / name).read_text(encoding="utf-8")):
        if re.search(r"^(known|drawn|label|grid|circle|under|corner|point|data:)", text):
            continue  # classes of the drawing
        assert not re.search(r"[A-Za-z]{2,}\s+[A-Za-z]{2,}", text), text


def test_the_script_says_what_is_there_and_all_of_it() -> None:
    code = one_script(SCRIPTS)
    asked = set(re.findall(r"word\('(\w+)'", code)) | set(re.findall(r"why: '(\w+)'", code))
    asked |= {key for pair in re.findall(r"\? '(\w+)' : '(\w+)'", code) for key in pair} & set(sentences())
    asked |= {f"field_{key}" for key in "uvxy"} | set("uvxy")
    asked |= {f"shape_{kind}" for kind in ("area", "fixture", "view")}
    asked |= {f"kind_{kind}" for kind in ("shelf", "wall", "till", "other")}
    asked |= set(re.findall(r"text\('\w+', '(\w+)'\)", code))
    assert asked == set(sentences())


def test_a_page_in_italian_has_the_italian_sentences(tmp_path: Path, vsd: Vsd) -> None:
    assert vsd("calibrate", "cam-1", "--draw", "--language", "it")[0] == 0
    page = page_of(tmp_path)
    assert '<html lang="it-IT">' in page
    with speaking("it"):
        assert meta(page)["words"] == sentences()
    english = {text for key, text in catalogue.catalogue().items() if key.startswith("calibrate_page.")}
    shown = re.sub(r"<style>.*?</style>|<script>.*?</script>", "", page, flags=re.DOTALL)
    assert [text for text in english if len(str(text)) > 12 and str(text) in shown] == []
