"""What `vsd check` proposes for tables whose columns have other names, and where it finds their header."""

from __future__ import annotations

from pathlib import Path

import pytest
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run


def said_of(file: Path, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    run(cli, ["-C", str(project(file.parent / "p")), "--now", "2025-12-01", "check", str(file), *options])
    return "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("header", "proposed"),
    [
        ("timestamp_us,object_id,X,Y", "ts=timestamp_us,track_id=object_id,x_m=X,y_m=Y"),
        ("Zeit,Person-Nr.,X [yd],Y [yd]", "ts=Zeit,track_id=Person-Nr.,x_m=X [yd],y_m=Y [yd]"),
        ("Data;Ora;ID persona;Posizione X (m);Posizione Y (m)", "ts=Data+Ora"),
        ("time,tag,pos_x_dm,pos_y_dm", "ts=time,track_id=tag,x_m=pos_x_dm,y_m=pos_y_dm"),
        ("ts,dossard,x_m,y_m", "columns that are not read holds them: dossard"),
        ("frame,timestamp,id,x_m,y_m", "ts=timestamp,track_id=id"),
        ("time,id1,id2,distance", "ts=time,track_a=id1,track_b=id2,distance_m=distance"),
        ("时间,目标编号,x,y", "ts=时间,track_id=目标编号,x_m=x,y_m=y"),
        ("czas,osoba,x,y", "ts=czas,track_id=osoba,x_m=x,y_m=y"),
        ("result,table,_time,person,x,y", "ts=_time,track_id=person,x_m=x,y_m=y"),
        ("Datum,Zeit,Person,X,Y", "ts=Datum+Zeit,track_id=Person"),
        ("trackId,time,width,length,xCenter,yCenter", "track_id=trackId,x_m=xCenter,y_m=yCenter"),
        ("ts,x1,y1,x2,y2,x3,y3", "a row seems to hold several people"),
        ("ts,id,bbox", "'bbox' seems to hold a whole box"),
        ("token,size,person,x,y", "ts=THEIR_NAME,track_id=person"),
        ("Zeit,Person A,Person B,Abstand [m]", "ts=Zeit,track_a=Person A,track_b=Person B,distance_m=Abstand [m]"),
    ],
)
def test_names_in_the_terms_of_their_writers_are_recognised(
    header: str, proposed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(f"{header}\n2025-11-25T09:00:00Z,7,1.5,2.5\n")
    assert proposed in said_of(tmp_path / "a.csv", capsys)


def test_a_column_is_not_proposed_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("ts,track_id,across x,along y\n2025-11-25T09:00:00Z,7,1.5,2.5\n")
    said = said_of(tmp_path / "a.csv", capsys, "--map", "x_m=across x")
    assert "y_m=along y" in said


@pytest.mark.parametrize(
    ("name", "above"),
    [("a.csv", "sep=;\n"), ("a.csv", "# made by a tracker 3.1\n# hall A\n"), ("a.txt", "")],
)
def test_a_header_is_found_by_names_of_others_too(
    name: str, above: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text(f"{above}time;person;x;y\n2025-11-25T09:00:00Z;7;1,5;2,5\n")
    assert "ts=time,track_id=person,x_m=x,y_m=y" in said_of(tmp_path / name, capsys)


def test_a_box_that_may_be_given_by_its_centre_is_proposed_in_both_ways(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    message = '{"timestamp": 1764061200, "objects": [{"id": 7, "x": 10, "y": 20, "w": 5, "h": 9}]}\n'
    (tmp_path / "a.jsonl").write_text(message)
    assert "if it is the centre: center_x=x,center_y=y" in said_of(tmp_path / "a.jsonl", capsys)


def test_names_of_columns_in_windows_encoding_are_as_they_are_typed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = "".join(f"2025-11-25T09:00:{k:02d}Z;7;{k},5;2,5\n" for k in range(5))
    (tmp_path / "a.csv").write_bytes(f"Zeit;Kunden-Nr;Länge (m);Breite (m)\n{rows}".encode("cp1252"))
    mapping = "ts=Zeit,track_id=Kunden-Nr,x_m=Länge (m),y_m=Breite (m)"
    assert "[table]  5 person records" in said_of(tmp_path / "a.csv", capsys, "--map", mapping)
