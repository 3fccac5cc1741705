"""vsd.toml: what loads, and that all mistakes are reported at once, with line and fix."""

from __future__ import annotations

import string
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from site_text import site_text

from vsd_analytics.config.project import find_project, load_site
from vsd_analytics.errors import ConfigError, UsageError, VsdError
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.site.model import Site

SMALLEST = site_text()
MATRIX = "0.01 0.001 -2\n0.0005 -0.012 9\n0.00001 0.002 1\n"


def load(folder: Path, text: str, *, environ: dict[str, str] | None = None) -> Site:
    (folder / "vsd.toml").write_text(text, encoding="utf-8")
    return load_site(folder, environ=environ)


def problems(folder: Path, text: str, *, environ: dict[str, str] | None = None) -> tuple[VsdError, ...]:
    with pytest.raises(ConfigError) as caught:
        load(folder, text, environ=environ)
    assert caught.value.code == "E103"
    return caught.value.problems


def the_problem(folder: Path, text: str) -> VsdError:
    (problem,) = problems(folder, text)
    return problem


def write(folder: Path, name: str, data: str | bytes) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)


def png(width: int, height: int) -> bytes:
    import cv2

    return bytes(cv2.imencode(".png", np.zeros((height, width, 3), np.uint8))[1])


# what loads -----------------------------------------------------------------------------------------------------------


def test_smallest_site_loads_with_defaults(tmp_path: Path) -> None:
    site = load(tmp_path, SMALLEST)
    assert (site.site_id, site.name, site.timezone, site.root) == ("shop", "Riverside Store", "Europe/Rome", tmp_path)
    assert (site.opening, site.closed, site.day_starts_min) == (None, frozenset(), 240)
    assert site.settings == DEFAULTS
    (camera,) = site.cameras
    assert (camera.floor_id, camera.calibrations, camera.clock, camera.engine_ids) == ("ground", (), "UTC", ())


def test_site_without_floor_table_has_one_floor(tmp_path: Path) -> None:
    site = load(tmp_path, SMALLEST.replace('[[floor]]\nid = "ground"\nname = "Ground floor"\n', ""))
    assert [floor.floor_id for floor in site.floors] == ["floor"]
    assert site.cameras[0].floor_id == "floor"


def test_every_key_of_the_house_plan_loads(tmp_path: Path) -> None:
    write(tmp_path, "plans/ground.png", png(400, 200))
    write(tmp_path, "pictures/cam-1.png", png(64, 48))
    write(tmp_path, "calibration/cam-1.txt", MATRIX)
    site = load(
        tmp_path,
        """
[site]
id = "shop"
name = "Riverside Store"
timezone = "Europe/Rome"
opening = { mon-sat = "08:00-21:00", sun = ["10:00-13:00", "15:00-24:00"] }
closed = ["2026-12-25", 2026-12-26]
day_starts = "05:00"
distance_m = 1.5
[rule]
episode_min_s = 2
[report]
heat_steps = [1, 2, 3, 4, 5]
min_days = 6
[privacy]
pseudonyms = false
[ingest]
earliest_year = 2000
[ingest.map]
camera = "cam"
[[floor]]
id = "ground"
name = "Ground floor"
plan = "plans/ground.png"
plan_m_per_px = 0.05
plan_origin_m = [-60.0, -40]
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
homography = "calibration/cam-1.txt"
calibrated_from = 2026-11-01T00:00:00+01:00
picture = "pictures/cam-1.png"
hz = 1.0
clock = "Asia/Tokyo"
engine_ids = ["entrance-left"]
view = [[0, 0], [5, 0], [5, 5]]
[[area]]
id = "checkout-queue"
name = "Checkout queue"
floor = "ground"
polygon = [
  [12, 4.2], # the till
  [20, 4.2],
  [20, 7.2],
  [12, 7.2],
]
""",
    )
    assert site.opening is not None
    assert site.opening[0] == ((480, 1260),)
    assert site.opening[6] == ((600, 780), (900, 1440))
    assert site.closed == {date(2026, 12, 25), date(2026, 12, 26)}
    assert site.day_starts_min == 300
    assert site.settings.non_default() == {
        "distance_m": 1.5, "episode_min_s": 2.0, "heat_steps": (1.0, 2.0, 3.0, 4.0, 5.0),
        "min_days": 6, "earliest_year": 2000, "pseudonyms": False,
    }  # fmt: skip
    assert site.setting_sources["distance_m"] == "vsd.toml line 9"
    assert site.ingest_map == {"camera": "cam"}
    assert site.floors[0].plan == tmp_path / "plans/ground.png"
    assert site.floors[0].plan_origin_m == (-60.0, -40.0)
    camera = site.camera("cam-1")
    assert camera.picture_px == (64, 48)  # read from the picture
    assert camera.calibrations[0].valid_from == datetime(2026, 10, 31, 23, tzinfo=UTC)
    assert np.allclose(camera.calibrations[0].homography, np.fromstring(MATRIX, sep=" ").reshape(3, 3))
    assert len(camera.calibrations[0].calibration_id) == 8
    assert site.areas[0].polygon[1] == (20.0, 4.2)


def test_names_are_free_text_even_when_hostile(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script> ' \\\" Ünï"
    site = load(tmp_path, SMALLEST.replace("Entrance", hostile))
    assert site.cameras[0].name == hostile.replace('\\"', '"')


def test_file_with_byte_order_mark_and_windows_lines_loads(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_bytes(b"\xef\xbb\xbf" + SMALLEST.replace("\n", "\r\n").encode())
    assert load_site(tmp_path).site_id == "shop"


def test_absolute_plan_path_is_allowed(tmp_path: Path) -> None:
    write(tmp_path, "elsewhere/plan.svg", '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 30 20"/>')
    plan = f'plan = "{tmp_path}/elsewhere/plan.svg"\nplan_m_per_px = 1\n'
    folder = tmp_path / "project"
    folder.mkdir()
    site = load(folder, SMALLEST.replace("[[camera]]", plan + "[[camera]]"))
    assert site.floors[0].plan == tmp_path / "elsewhere/plan.svg"


def test_project_is_found_upward(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text(SMALLEST, encoding="utf-8")
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    assert find_project(inner) == tmp_path


def test_no_project_is_e102_with_the_way_out(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        find_project(tmp_path)
    assert caught.value.code == "E102"
    assert "vsd init" in str(caught.value.fix)


# mistakes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera_id", ["../../x", "<script>", "Cam 1", "", "-a", "a" * 64, "a/b", "a\\u0000", ".."])
def test_id_that_could_be_a_path_or_markup_is_refused(tmp_path: Path, camera_id: str) -> None:
    problem = the_problem(tmp_path, SMALLEST.replace('"cam-1"', f'"{camera_id}"'))
    assert problem.code == "E125"
    assert problem.where is not None
    assert problem.where.line == 9
    assert 'id = "' in str(problem.fix)


@pytest.mark.parametrize(
    ("old", "new", "code", "line", "words"),
    [
        ("name = \"Entrance\"", "nam = \"Entrance\"", "E122", 10, "rename it to name"),
        ("[[floor]]", "[[flor]]", "E122", 5, "rename it to floor"),
        ('timezone = "Europe/Rome"', 'timezone = "Europe/Roma"', "E124", 4, "Europe/Rome"),
        ('timezone = "Europe/Rome"', 'timezone = "../../etc/passwd"', "E124", 4, "IANA"),
        ('timezone = "Europe/Rome"', 'timezone = "rome"', "E124", 4, "Europe/Rome"),
        ('timezone = "Europe/Rome"\n', "", "E123", 1, "timezone = "),
        ("timezone =", "distance_m = \"2\"\ntimezone =", "E124", 4, "distance_m = 2.0"),
        ("timezone =", "distance_m = nan\ntimezone =", "E124", 4, "distance_m = 2.0"),
        ("timezone =", "distance_m = true\ntimezone =", "E124", 4, "distance_m = 2.0"),
        ("timezone =", "distance_m = 3.0\ntimezone =", "E124", 4, "[rule] pair_max_m = 3.5"),
        ("timezone =", "closed = [\"2026-02-30\"]\ntimezone =", "E124", 4, "closed = "),
        ("timezone =", "day_starts = \"13:00\"\ntimezone =", "E124", 4, "day_starts = "),
        ("timezone =", 'opening = { mon = "08:00-25:00" }\ntimezone =', "E127", 4, "24:00"),
        ("timezone =", 'opening = { fri = "18:00-02:00" }\ntimezone =', "E127", 4, '"00:00-02:00" on the day after'),
        ("timezone =", 'opening = { mon = ["08:00-12:00", "11:00-13:00"] }\ntimezone =', "E127", 4, "08:00-13:00"),
        ("timezone =", 'opening = { mon-fri = "08:00-12:00", wed = "13:00-14:00" }\ntimezone =', "E127", 4, "once"),
        ("timezone =", 'opening = { monday = "08:00-12:00" }\ntimezone =', "E127", 4, "mon-fri"),
        ("[[camera]]", "[rule]\nepisode_gap_s = -1\n[[camera]]", "E124", 9, "episode_gap_s = 3.0"),
        ("[[camera]]", "[report]\nheat_steps = [1, 2, 2, 4, 5]\n[[camera]]", "E124", 9, "heat_steps = "),
        ("[[camera]]", "[privacy]\npseudonyms = \"no\"\n[[camera]]", "E124", 9, "pseudonyms = true"),
        ("[[camera]]", "[report]\nmin_days = 5.5\n[[camera]]", "E124", 9, "min_days = 5"),
        ("[[camera]]", "plan = \"ground.png\"\nplan_m_per_px = 1\n[[camera]]", "E126", 8, "take the line"),
        ("[[camera]]", '[[floor]]\nid = "ground"\nname = "Twice"\n[[camera]]', "E125", 9, "another id"),
        ("name = \"Entrance\"", "name = \"Entrance\"\nfloor = \"groud\"", "E125", 11, 'floor = "ground"'),
        ("name = \"Entrance\"", "name = \"Entrance\"\nhz = 0", "E124", 11, "hz = 1.0"),
        ("name = \"Entrance\"", "name = \"Entrance\"\nclock = \"Mars\"", "E124", 11, "clock = "),
        ("name = \"Entrance\"", "name = \"Entrance\"\nhomography = \"h.txt\"", "E126", 11, "vsd calibrate cam-1"),
        ("name = \"Entrance\"", "name = \"Entrance\"\npicture_px = [0, 5]", "E124", 11, "[1920, 1080]"),
        ("name = \"Entrance\"", "name = \"Entrance\"\nview = [[0, 0], [1, 1]]", "E128", 11, "view = "),
        ("name = \"Entrance\"", "name = \"Entrance\"\ncalibrated_from = 2026-11-01", "E129", 11, "take this line out"),
        ("[[floor]]", "[floor]", "E124", 5, "two brackets"),
    ],
)  # fmt: skip
def test_mistake_is_reported_with_line_text_and_fix(
    tmp_path: Path, old: str, new: str, code: str, line: int, words: str
) -> None:
    text = SMALLEST.replace(old, new, 1)
    problem = next(p for p in problems(tmp_path, text) if p.code == code)
    assert problem.where is not None
    assert problem.where.line == line
    assert problem.where.text == text.splitlines()[line - 1]
    assert words in str(problem.fix)


def test_all_mistakes_are_reported_at_once_by_line(tmp_path: Path) -> None:
    text = SMALLEST.replace('"shop"', '"Shop"').replace('name = "Ground floor"', "name = 3").replace("Entrance", "")
    found = problems(tmp_path, text)
    assert [(p.where.line, p.code) for p in found if p.where] == [(2, "E125"), (7, "E124"), (10, "E124")]


@pytest.mark.parametrize(
    ("text", "line"),
    [("[site]\nid =\n", 2), ("[site]\nid = 'a'\nid = 'b'\n", 3), ("[site\n", 1), ("[site]\nx = [1,\n2,\n\n", 3)],
)
def test_syntax_mistake_has_its_line(tmp_path: Path, text: str, line: int) -> None:
    problem = the_problem(tmp_path, text)
    assert (problem.code, problem.where and problem.where.line) == ("E121", line)


def test_binary_file_is_a_mistake_not_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_bytes(b'[site]\nname = "\xff\xfe"\n')
    with pytest.raises(ConfigError) as caught:
        load_site(tmp_path)
    assert caught.value.problems[0].code == "E121"
    assert caught.value.problems[0].where is not None
    assert caught.value.problems[0].where.line == 2


def test_empty_file_names_what_is_needed(tmp_path: Path) -> None:
    told = " ".join(f"{p.what} {p.fix}" for p in problems(tmp_path, ""))
    assert "[site]" in told
    assert "[[camera]]" in told


def test_crossing_polygon_is_refused_where_it_begins(tmp_path: Path) -> None:
    area = '[[area]]\nid = "q"\nname = "Q"\npolygon = [\n [0, 0],\n [1, 1],\n [1, 0],\n [0, 1],\n]\n'
    problem = the_problem(tmp_path, SMALLEST + area)
    assert (problem.code, problem.where and problem.where.line) == ("E128", 14)
    assert "0.5 0.5" in str(problem.why)  # where it crosses itself


@pytest.mark.parametrize("size", ["501", "4000", "1e300", "9223372036854775807"])
def test_polygon_far_too_large_is_refused_before_it_is_cut_into_cells(tmp_path: Path, size: str) -> None:
    area = f'[[area]]\nid = "q"\nname = "Q"\npolygon = [[0, 0], [{size}, 0], [{size}, {size}], [0, {size}]]\n'
    problem = the_problem(tmp_path, SMALLEST + area)
    assert problem.code == "E128"
    assert "too large" in problem.what


def test_largest_polygon_is_taken(tmp_path: Path) -> None:
    area = '[[area]]\nid = "q"\nname = "Q"\npolygon = [[0, 0], [500, 0], [500, 500], [0, 500]]\n'
    (tmp_path / "vsd.toml").write_text(SMALLEST + area, encoding="utf-8")
    assert len(load_site(tmp_path).areas) == 1


def test_camera_on_a_site_of_two_floors_needs_its_floor(tmp_path: Path) -> None:
    text = SMALLEST.replace("[[camera]]", '[[floor]]\nid = "upper"\nname = "Upper"\n[[camera]]')
    assert the_problem(tmp_path, text).what == "[[camera]] 'cam-1' has no floor"


@pytest.mark.parametrize("ids", ['["left"]', '["cam-1"]'])
def test_engine_id_belongs_to_one_camera(tmp_path: Path, ids: str) -> None:
    text = SMALLEST + 'engine_ids = ["left"]\n[[camera]]\nid = "cam-2"\nname = "B"\nengine_ids = ' + ids + "\n"
    problem = the_problem(tmp_path, text)
    assert (problem.code, problem.where and problem.where.line) == ("E125", 15)


def test_own_id_as_engine_id_is_fine(tmp_path: Path) -> None:
    assert load(tmp_path, SMALLEST + 'engine_ids = ["cam-1", "x"]\n').cameras[0].engine_ids == ("cam-1", "x")


def test_damaged_plan_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "p.png", png(10, 10)[:20])
    plan = 'plan = "p.png"\nplan_m_per_px = 1\n'
    assert the_problem(tmp_path, SMALLEST.replace("[[camera]]", plan + "[[camera]]")).code == "E126"


def test_plan_needs_its_scale(tmp_path: Path) -> None:
    write(tmp_path, "p.png", png(10, 10))
    problem = the_problem(tmp_path, SMALLEST.replace("[[camera]]", 'plan = "p.png"\n[[camera]]'))
    assert (problem.code, "plan_m_per_px" in problem.what) == ("E123", True)


def test_misspelt_file_is_answered_with_the_nearest_one(tmp_path: Path) -> None:
    write(tmp_path, "plans/ground.png", png(10, 10))
    plan = 'plan = "plans/grund.png"\nplan_m_per_px = 1\n'
    assert "'ground.png'" in str(the_problem(tmp_path, SMALLEST.replace("[[camera]]", plan + "[[camera]]")).fix)


# lines, whatever the layout -------------------------------------------------------------------------------------------

_filler = st.lists(st.sampled_from(["", "# [[camera]]", "   ", "# id = 'x' [ { \"", "\t# ]"]), max_size=3)


@given(data=st.data(), n_cameras=st.integers(1, 4), bad=st.integers(0, 3))
def test_line_of_a_mistake_is_right_in_any_layout(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, n_cameras: int, bad: int
) -> None:
    bad = min(bad, n_cameras - 1)
    lines = ["[site]", 'id = "s"', 'name = "[[camera]]"', 'timezone = "UTC"']
    expected = 0
    for i in range(n_cameras):
        lines += [*data.draw(_filler), "[[camera]]   # one more", f'id = "c{i}"']
        lines += ["view = [[0, 0],", "[1, 0], # [[camera]]", "[1, 1]", "]"]
        lines += ['name = """n = [ # not a comment \\', "hz = 0 [[camera]] \\", '"""']
        if i == bad:
            lines += data.draw(_filler)
            lines.append(data.draw(st.sampled_from(['"hz" = 0', "hz=-1", "  hz   =  0.0 # hz = 1"])))
            expected = len(lines)
    found = problems(tmp_path_factory.mktemp("p"), "\n".join(lines))
    assert [(p.code, p.where and p.where.line) for p in found] == [("E124", expected)]


# settings from the environment ---------------------------------------------------------------------------------------


def test_environment_wins_over_the_file_and_says_so(tmp_path: Path) -> None:
    text = SMALLEST.replace("timezone", "distance_m = 1.5\ntimezone")
    site = load(tmp_path, text, environ={"VSD_DISTANCE_M": "1.8", "VSD_REALDATA": "x"})
    assert site.settings.distance_m == 1.8
    assert site.setting_sources == {"distance_m": "VSD_DISTANCE_M"}


def test_bad_environment_value_names_its_variable(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, SMALLEST, environ={"VSD_DISTANCE_M": "two"})
    assert problem.where is not None
    assert "VSD_DISTANCE_M" in problem.where.file


# calibrations ---------------------------------------------------------------------------------------------------------


def test_calibration_history_is_read_in_order_of_time(tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        write(tmp_path, f"calibration/{name}.txt", MATRIX.replace("9", {"a": "7", "b": "8", "c": "9"}[name]))
    history = (
        '[[calibration]]\nhomography = "calibration/c.txt"\nfrom = 2026-12-01T00:00:00Z\n'
        '[[calibration]]\nhomography = "calibration/b.txt"\nfrom = 2026-11-01\n'
    )
    write(tmp_path, "calibration/cam-1.toml", history)
    found = load(tmp_path, SMALLEST + 'homography = "calibration/a.txt"\n').cameras[0].calibrations
    assert [c.homography[1][2] for c in found] == [7.0, 8.0, 9.0]
    assert found[0].valid_from is None
    assert found[1].valid_from == datetime(2026, 10, 31, 23, tzinfo=UTC)  # midnight in the site's zone
    assert len({c.calibration_id for c in found}) == 3


def test_two_calibrations_of_one_instant_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "calibration/a.txt", MATRIX)
    write(tmp_path, "calibration/cam-1.toml", '[[calibration]]\nhomography = "calibration/a.txt"\n')
    assert the_problem(tmp_path, SMALLEST + 'homography = "calibration/a.txt"\n').code == "E129"


def test_mistake_in_the_history_names_that_file_and_line(tmp_path: Path) -> None:
    write(tmp_path, "calibration/cam-1.toml", '[[calibration]]\nhomography = "nope.txt"\nfron = 2026-12-01\n')
    found = problems(tmp_path, SMALLEST)
    assert [(p.code, p.where.file, p.where.line) for p in found if p.where] == [
        ("E126", "calibration/cam-1.toml", 2),
        ("E122", "calibration/cam-1.toml", 3),
    ]


@pytest.mark.parametrize(
    ("data", "code"),
    [
        ("1 2 3\n4 5 6\n", "E403"),
        ("1 2 3\n4 x 6\n7 8 9\n", "E403"),
        ("1 2 3\n4 nan 6\n7 8 9\n", "E403"),
        ("1 2 3\n2 4 6\n0 0 1\n", "E404"),
        ("0 0 0\n0 1 0\n0 0 1\n", "E404"),
        (b"\xff\xfe\x00", "E406"),
    ],
)
def test_matrix_that_cannot_be_used_is_reported_at_its_line(tmp_path: Path, data: str | bytes, code: str) -> None:
    write(tmp_path, "h.txt", data)
    problem = the_problem(tmp_path, SMALLEST + 'homography = "h.txt"\n')
    assert (problem.code, problem.where and problem.where.line) == (code, 11)


def test_matrix_may_have_commas_and_comments(tmp_path: Path) -> None:
    write(tmp_path, "h.txt", "# px to m\n1e-2, 0, 0\n\n0, 1e-2, 0  # y\n0, 0, 1\n")
    calibration = load(tmp_path, SMALLEST + 'homography = "h.txt"\n').cameras[0].calibrations[0]
    assert calibration.homography == ((0.01, 0, 0), (0, 0.01, 0), (0, 0, 1))


def test_matrix_in_any_unit_is_invertible(tmp_path: Path) -> None:
    for scale in (1e-9, 1.0, 1e9):
        write(
            tmp_path,
            "h.txt",
            "\n".join(" ".join(str(float(x) * scale) for x in r.split()) for r in MATRIX.splitlines()),
        )
        assert load(tmp_path, SMALLEST + 'homography = "h.txt"\n').cameras[0].calibrations


def test_points_become_a_calibration_with_its_error(tmp_path: Path) -> None:
    write(tmp_path, "p.csv", "x,y,u,v,name\n0,0,0,0,a\n4,0,400,0,b\n4,3,400,300,c\n0,3,0,300,d\n2,1.5,200,150,e\n")
    calibration = load(tmp_path, SMALLEST + 'points = "p.csv"\n').cameras[0].calibrations[0]
    h = np.array(calibration.homography)
    assert np.allclose(h / h[2, 2], [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 1]], atol=1e-6)
    assert calibration.error_m == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        ("u,v,x,y\n1,2,3,4\n2,3,4,5\n3,4,5,7\n", "E401"),
        ("u,v,x,y\n0,0,0,0\n1,1,1,1\n2,2,2,2\n3,3,3,3\n", "E402"),
        ("u,v,x\n0,0,0\n", "E405"),
        ("u,v,x,y\n0,0,zero,0\n", "E405"),
        pytest.param("u,v,x,y\n0,0,0," + '"' + "9" * 200_000 + '"\n', "E405", id="a huge field"),
        ("", "E401"),
    ],
)
def test_points_that_cannot_be_used_are_reported(tmp_path: Path, data: str, code: str) -> None:
    write(tmp_path, "p.csv", data)
    assert the_problem(tmp_path, SMALLEST + 'points = "p.csv"\n').code == code


@given(text=st.text(alphabet=string.printable, max_size=300))
def test_any_text_loads_or_is_refused_in_words(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.mktemp("p")
    told: tuple[VsdError, ...] | None = None
    try:
        load(folder, SMALLEST + text)
    except ConfigError as error:
        told = error.problems
    assert told is None or (told and all(problem.where for problem in told))
