"""Small inputs of people who do this job, each by its command: what comes out is right, or refused with what to do.

The inputs lie in `cases`, beside the folder of `VSD_REALDATA`; the numbers are those of their folders.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

pytestmark = pytest.mark.realdata
INIT = "init --no-input --name Hall --timezone Europe/Berlin --camera cam-1=Hall"
MOT = "--format motchallenge --camera cam-1 --start 2025-11-10T09:00:00+01:00 --fps 10"
NEST = "ingest nest.jsonl --persons people --map ts=t,track_id=tid,x_m=x,y_m=y --camera cam-1"
CONF = "--persons people --map ts=t,track_id=id,x_m=x,y_m=y --camera cam-1"
DLS = "check dls_sys.jsonl --persons objects --map ts=system_timestamp,track_id=id,left=x,top=y,width=w,height=h"
REL = "track_id=id,x_m=x,y_m=y --camera cam-1 --start 2025-11-10T09:00:00+01:00"
TMOT = "check {} --map frame=frame_number,{} --fps 25 --camera cam-1 --start 2025-11-10T09:00:00+01:00"


class Case(NamedTuple):
    """An input: its number, a command, the exit code, and what is printed, as regular expressions."""

    number: int
    command: list[str]
    code: int
    says: tuple[str, ...]


def case(number: int, command: str, code: int, *says: str, **options: str) -> Case:
    """Return a case; `options` are those of the command whose values hold spaces."""
    words = [word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", value)]
    return Case(number, [*command.split(), *words], code, says)


ELEVEN = r"times +2025-07-10 11:00:00\+02:00"
CASES = [
    case(1, "check tzz_z.csv --camera cam-1 --zone Europe/Berlin", 0, ELEVEN, time_format="%Y-%m-%dT%H:%M:%SZ"),
    case(
        1, f"check json_z.jsonl {CONF} --zone Europe/Berlin", 0, ELEVEN, time_format="%d/%m/%Y %H:%M:%S GMT"
    ),
    case(3, "check hdr_off.csv --camera cam-1 --zone Europe/Berlin", 0, r"times +2025-07-10 10:00:00\+02:00",
         map="ts=Seen at (UTC+01:00)"),
    case(3, "check hdr_off.csv --camera cam-1 --zone UTC", 0, r"times +2025-07-10 10:00:00\+02:00",
         map="ts=Seen at (UTC+01:00)"),
    case(5, NEST, 2, r"""fix: --where "kind = 'person'\""""),
    case(5, NEST, 0, r"4 person records", "left out: 1 by --where", where="kind = 'person'"),
    case(7, "check cls_ped.csv --camera cam-1", 0, "90 person records"),
    case(7, "check cls_pedveh.csv --camera cam-1", 1, "W222", r"""fix: --where "label = 'ped'\""""),
    case(9, f"check mot_xyxy.txt {MOT}", 1, "W226"),
    case(9, f"check mot_ok.txt {MOT}", 0, "400 person records"),
    case(11, f"check mot_space.txt {MOT}", 0, "400 person records, 100 frames"),
    case(11, f"check mot_frame0.txt {MOT}", 1, "4 bad", "--first-frame 0"),
    case(11, f"check mot_frame0.txt {MOT} --first-frame 0", 0, "400 person records, 100 frames"),
    case(12, f"check rel_s.csv --map ts=time,{REL}", 0, "720 person records", r"09:00:00\+01:00 to .* 09:01:59"),
    case(12, f"check rel_ms.csv --map ts=time_ms,{REL}", 0, "720 person records", r"09:00:00\+01:00 to .* 09:01:59"),
    case(14, "check fr.jsonl", 2, "--persons objects --map frame=frame_id,left=x,top=y,width=w,height=h --fps 25"),
    case(14, "check fr_arr.json", 2, "--persons objects --map frame=frame_id,center_x=relative_coordinates.center_x"),
    case(14, "check fr.jsonl --persons objects --map frame=frame_id,left=x,top=y,width=w,height=h --fps 25 "
         "--camera cam-1 --start 2025-11-10T09:00:00+01:00", 1, "2 person records, 2 frames", "W225"),
    case(16, "check nest3.json", 2, r"--persons 'a\.b\.frames\.\*\.objs' --map ts=time,track_id=id,x_m=x,y_m=y"),
    case(16, "check nest3.json --persons a.b.frames.*.objs --map ts=time,track_id=id,x_m=x,y_m=y --camera cam-1", 0,
         "person records"),
    case(18, "ingest per_obj.jsonl --format json --map ts=t,track_id=id,x_m=x,y_m=y --camera cam-1", 0,
         "4 person records$", "^4 new records stored", where="cls = 'person'"),
    case(19, "check people.sqlite", 2, "is a SQLite database", "fix: export the table: sqlite3 -header -csv"),
    case(20, "check hive_b --camera cam-1", 0, "2,160 person records", r"cameras +cam-1 \(2,160\)"),
    case(22, "check sums.csv", 2, "has counts of people and no places"),
    case(23, f"{DLS} --camera cam-1", 1, "5 bad", "--no-list-is-nobody", where="roi_type = 'person'"),
    case(23, f"{DLS} --camera cam-1 --no-list-is-nobody", 0, "70 person records, 40 frames",
         where="roi_type = 'person'"),
    case(24, "check influx_piv.csv --map ts=_time,track_id=track,x_m=x,y_m=y --camera cam-1", 0, "120 person records"),
    case(25, "engine run ap_byimg.json --camera cam-1 --start 2025-11-10T09:00:00+01:00 --hz 25 --size 1280x720 "
         "--out f.jsonl --method paper", 0, "20 frames, 20 persons"),
    case(26, TMOT.format("swapped.json", "left=xmin,top=ymin,right=xmax,bottom=ymax"), 1,
         "'xmax' is left of 'xmin' in 20 of 20 boxes", "fix: --map left=xmax,right=xmin"),
    case(26, TMOT.format("swapped.json", "left=xmax,top=ymin,right=xmin,bottom=ymax"), 1, "20 person records"),
    *(case(27, f"ingest {file}", 2, "E203", "compare cls instead", where=where)
      for file, where in ((f"conf.jsonl {CONF}", "clas = 'Person'"), (f"conf.jsonl {CONF}", "people.cls = 'Person'"),
                          ("conf.csv --camera cam-1", "clas = 'Person'"))),
    *(case(29, "check ds_small.jsonl", 2, "E101", f"--{name} is not used to read", **{name: value})
      for name, value in (("where", "event.type != 'entry'"), ("where", "nosuch = 'x'"), ("unit", "mm"),
                          ("map", "x_m=nosuch"))),
    case(32, "check start_zone_people.csv --camera cam-1 --start 2026-11-23T10:00 --hz 25", 0,
         r"times +2026-11-23 10:00:00\+01:00"),
    case(33, "check own_messages.jsonl", 2, "--persons objs --map ts=when,track_id=n,camera_id=device"),
    case(35, "check plan.dxf --unit m", 0, "plan"),
    case(35, "check plan.pdf", 2, "make a picture: pdftoppm"),
]  # fmt: skip
"""Commands of the folders, and the fixes that their messages print."""


@pytest.fixture
def vsd(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[[list[str]], tuple[int, str]]:
    monkeypatch.chdir(tmp_path)

    def call(words: list[str]) -> tuple[int, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-28", *words])
        return code, "".join(capsys.readouterr())

    return call


def bring(realdata: Callable[[str], Path], number: int, into: Path) -> None:
    """Copy the input of a case."""
    (folder,) = realdata("../cases").glob(f"{number:02}-*")
    shutil.copytree(folder, into, dirs_exist_ok=True)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.number:02}: {' '.join(case.command)}"[:90])
def test_the_command_of_a_case_reads_it_or_says_how(
    case: Case,
    vsd: Callable[[list[str]], tuple[int, str]],
    realdata: Callable[[str], Path],
    tmp_path: Path,
) -> None:
    vsd(INIT.split())
    bring(realdata, case.number, tmp_path)
    code, said = vsd(case.command)
    assert code == case.code, said
    for pattern in case.says:
        assert re.search(pattern, said, re.M), said


def test_31_two_cameras_of_one_hall_are_asked_about_and_neither_can_vanish(
    vsd: Callable[[list[str]], tuple[int, str]], realdata: Callable[[str], Path], tmp_path: Path
) -> None:
    vsd(["init", "--no-input", "--name", "Hall", "--timezone", "Europe/Rome", "--camera", "a=A", "--camera", "b=B"])
    bring(realdata, 31, tmp_path)
    code, said = vsd(["ingest", "two_cameras_one_hall.csv.gz"])
    assert (code, "36,000 new records stored" in said) == (1, True), said
    lines = dict(re.findall(r'under \[\[camera\]\] id = "(\w)": (view = \[\[.+?\]\])', said))
    site = tmp_path / "vsd.toml"
    plain = site.read_text()
    hour = r"^2026-11-09T10:00:00\+01:00 +[\d,]+ +[\d,.]+ +(\d+) "
    assert re.findall(hour, vsd(["hours"])[1], re.M) == ["60"]
    viewed = plain
    for camera, line in lines.items():
        viewed = viewed.replace(f'id = "{camera}"\n', f'id = "{camera}"\n{line}\n')
    site.write_text(viewed)
    assert re.findall(hour, vsd(["hours"])[1], re.M) == ["30"]
    start = plain.index('[[camera]]\nid = "b"')
    site.write_text(plain[:start] + plain[start:].replace("[[camera]]", "# gone").replace("\n", "\n# "))
    for command in ("hours", "coverage", "doctor", "verify", "report"):
        code, said = vsd([command])
        assert code != 0
        assert "records of camera 'b' are stored, and no [[camera]] describes it" in said, command
        assert 'to = "2026-11-14"' in said


def test_34_an_area_in_centimetres_is_named_where_figures_are_made(
    vsd: Callable[[list[str]], tuple[int, str]], realdata: Callable[[str], Path], tmp_path: Path
) -> None:
    bring(realdata, 34, tmp_path)
    (tmp_path / "area_in_centimetres.toml").rename(tmp_path / "vsd.toml")
    rows = [
        f"2026-11-09 10:{s // 60:02}:{s % 60:02},Eingang,{p + 10 * (s // 60)},{1100 + 5 * (s % 60) + 40 * p},{90 * p}"
        for s in range(1800)
        for p in range(3)
    ]
    (tmp_path / "export_kw46.csv").write_text("\n".join(["Datum+Uhrzeit,Kamera,Person,X cm,Y cm", *rows]) + "\n")
    assert vsd(["ingest", "export_kw46.csv"])[0] == 0
    for command in ("doctor", "report"):
        code, said = vsd([command])
        assert code != 0
        assert "area 'kasse' lies off floor 'ground'" in said, command
        assert "has x from 11 to 14.8 m" in said
