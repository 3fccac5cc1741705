"""Which adapter reads a source, and what a file is that none can read, with how to turn it into one that can."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from typing import Final

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.adapters import adapter, formats
from vsd_analytics.ingest.formats.jupedsim import opened_database
from vsd_analytics.ingest.reading.adapter import Adapter, IngestOptions, Source, empty, not_a_file
from vsd_analytics.owners import is_there


def find_adapter(source: Source, options: IngestOptions) -> Adapter:
    """Return the adapter the user named, or the first that recognises the source.

    Raises:
        InputError: E201 no such file, E202 empty file, E204 no format recognises it, E205 damaged from its first line.
    """
    where = Where(source.name)
    if not is_there(source.path):
        raise InputError(
            f"there is no file {source.name}",
            code="E201",
            where=where,
            why="that path is neither a file nor a folder",
            fix="check the path and the spelling",
        )
    if not (source.path.is_file() or source.path.is_dir()):
        raise not_a_file(source)
    if source.size_bytes == 0:
        raise empty(source)
    if options.format is not None:
        return adapter(options.format)
    if options.columns is not None:
        return adapter("table")
    if options.persons is not None:
        return adapter("json")
    for name in formats():
        candidate = adapter(name)
        if candidate.detects(source):
            return candidate
    if source.path.is_file() and not source.head(1):
        raise empty(source)
    if options.map and source.path.is_file():
        return adapter("table")
    raise not_recognised(source, formats())


_CSV: Final = "export the table as CSV or Parquet"
_UNPACK: Final = "unpack it, and name the files inside; gzip, bzip2, zstd, zip and tar are read as they are"
_PICTURE: Final = "vsd engine run finds people in pictures with --detector MODEL.onnx (docs/detectors.md)"
_DRAWING: Final = "vsd check makes a floor plan of it: vsd check FILE --picture plan.svg"
_SQLITE: Final = b"SQLite format 3"
_KINDS: Final[tuple[tuple[bytes, str, str], ...]] = (
    (b"\xd0\xcf\x11\xe0", "an Excel workbook of before 2007 (xls)", "save it as xlsx or CSV UTF-8"),
    (
        b"FEA1",
        "a Feather file of version 1",
        "write it again with pyarrow.feather.write_feather, or as Parquet",
    ),
    (_SQLITE, "a SQLite database", "export the table as CSV"),
    (
        b"%PDF",
        "a PDF",
        "export the table as CSV; of a floor plan, make a picture: pdftoppm -png -r 150 -singlefile FILE plan "
        "(plan_m_per_px = 0.0169 where it is drawn 1:100)",
    ),
    (b"AC10", "a drawing of AutoCAD (DWG)", "save it as DXF; then: vsd check FILE.dxf --picture plan.svg"),
    (b"AutoCAD Binary DXF", "an architect's drawing (DXF)", _DRAWING),
    (b"\xfd7zXZ", "compressed with xz", "unpack it: unxz FILE; gzip, bzip2 and zstd are read as they are"),
    (b"7z\xbc\xaf", "a 7z archive", _UNPACK),
    (b"Rar!", "a RAR archive", _UNPACK),
    (b"\x04\x22\x4d\x18", "compressed with lz4", "unpack it: lz4 -d FILE; gzip, bzip2 and zstd are read as they are"),
    (b"\x89HDF", "an HDF5 file", _CSV),
    (b"II*\0", "a picture (TIFF; GeoTIFF too)", "name the file with the positions"),
    (b"MM\0*", "a picture (TIFF; GeoTIFF too)", "name the file with the positions"),
    (b"\x93NUMPY", "a NumPy array", _CSV),
    (b"\x80\x04", "a Python pickle", _CSV),
    (b"\x80\x05", "a Python pickle", _CSV),
    (b"\x80\x02", "a Python pickle", _CSV),
    (b"<stata_dta", "a Stata file", _CSV),
    (b"$FL2", "an SPSS file", _CSV),
    (b"\xd4\xc3\xb2\xa1", "a recording of network packets", "write the messages in it as JSON lines"),
    (b"\x89MCAP", "a recording of a robot (MCAP)", "export the topic of positions as CSV, or as JSON lines"),
    (b"\0\1\0\0Standard ", "an Access database", _CSV),
    (b"version https://git-lfs", "a pointer of Git LFS, and not the file itself", "git lfs pull"),
    (b"MATLAB", "a MATLAB file", _CSV),
    (b"ORC", "an ORC file", "write it as Parquet"),
    (b"Obj\x01", "an Avro file", "write it as Parquet"),
    (b"\xff\xff\xff\xff", "a stream of Arrow", "write it as an Arrow file, Feather or Parquet"),
    (b"#ROSBAG", "a ROS bag", "export the topic of positions as CSV, or as JSON lines"),
    (b"\x89PNG", "a picture", _PICTURE),
    (b"\xff\xd8\xff", "a picture", _PICTURE),
    (b"{\\rtf", "a text document (RTF)", "save it as plain text, or as CSV UTF-8"),
)
"""First bytes, what such a file is, and what to do."""
_DXF: Final = re.compile(rb"\s*(?:999\s*\r?\n.*\r?\n\s*)*0\s*\r?\n\s*SECTION\s")
_STREAMS: Final = {"rtsp", "rtsps", "rtmp", "rtmps", "http", "https", "rtp", "udp", "srt"}
_ROWS: Final = "write a row for each person and frame: frame, id, left, top, right, bottom"
_XML: Final[tuple[tuple[re.Pattern[bytes], str, str], ...]] = (
    (re.compile(rb"<viper\b|lamp\.cfar\.umd\.edu"), "annotations of ViPER (XML)", _ROWS),
    (
        re.compile(rb"<annotations>[\s\S]*<(?:track|image|meta)\b"),
        "annotations of CVAT (XML)",
        f"export them from CVAT as MOT 1.1, or {_ROWS}",
    ),
    (re.compile(rb"<annotation>[\s\S]*<object>"), "annotations of Pascal VOC (XML)", _ROWS),
    (
        re.compile(rb"<fcd-export\b"),
        "trajectories of SUMO (FCD)",
        "make a CSV file of it with xml2csv.py of SUMO; then: --map ts=timestep_time,track_id=person_id,x_m=person_x,"
        "y_m=person_y --start INSTANT",
    ),
)
"""What the first elements of XML say it is, and what to do."""
_VADERE: Final = re.compile(rb"^pedestrianId\s+simTime\b")
_TRACKED: Final = re.compile(rb"\d+(?:\.0+)?,-?\d+(?:\.0+)?(?:,-?\d+(?:\.\d+)?(?:e[+-]\d+)?){5,8}")
_SQL: Final = re.compile(rb"(?m)^(?:INSERT INTO|COPY|CREATE TABLE)\s+[\w.`\"\[]")
_SPREADSHEET: Final = b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet"


def kind_of_no_table(source: Source) -> tuple[str, str] | None:
    """Return what a file is that nothing here reads, and what to do about it; None when its first bytes do not say."""
    head = source.head(128) if source.path.is_file() else b""
    if _is_video(head):
        file = shlex.quote(source.name)
        return "a video", f"vsd engine run {file} --camera ID --detector MODEL.onnx --start INSTANT (docs/detectors.md)"
    if head.lstrip().lower().startswith((b"<!doctype html", b"<html", b"<table")):
        return "a web page (HTML)", "open it in a spreadsheet, and save it as xlsx or CSV UTF-8"
    if (encoding := _wide_encoding(head)) is not None:
        file = shlex.quote(source.file_name)
        return f"text in {encoding}", f"save it as CSV UTF-8, or: iconv -f {encoding} -t UTF-8 {file} > utf8.csv"
    if _SPREADSHEET in head:
        return "an OpenDocument spreadsheet (ods)", "save it as xlsx or CSV UTF-8"
    if _DXF.match(head):
        return "an architect's drawing (DXF)", _named(_DRAWING, source)
    if head.startswith(_SQLITE) and (table := _table_of(source)) is not None:
        query = f"sqlite3 -header -csv {shlex.quote(source.file_name)} 'select * from \"{table}\"' > table.csv"
        return "a SQLite database", f"export the table: {query}"
    known = next(((what, _named(fix, source)) for start, what, fix in _KINDS if head.startswith(start)), None)
    start = source.head(4096)
    if known is None and b"\0" not in start and b"\n" not in start and start.count(b"\r") > 2:
        return "text whose lines end with CR alone", f"tr '\\r' '\\n' < {shlex.quote(source.file_name)} > lines.csv"
    return known


def _table_of(source: Source) -> str | None:
    """Return the table of a SQLite database that has most columns; None where none has a plain name."""
    import sqlite3
    from contextlib import closing

    try:
        with closing(opened_database(source.path)) as database:
            tables = [
                name for (name,) in database.execute("select name from sqlite_schema where type = 'table' limit 100")
            ]
            plain = [t for t in tables if isinstance(t, str) and re.fullmatch(r"\w{1,100}", t, re.ASCII)]
            widths = {t: len(database.execute(f"pragma table_info({t})").fetchall()) for t in plain}
    except sqlite3.Error:
        return None
    return max(widths, key=lambda table: widths[table], default=None)


def _named(fix: str, source: Source) -> str:
    """Return a fix with the name of the file in place of FILE."""
    return re.sub(r"\bFILE\b(?!\.)", lambda _: shlex.quote(source.file_name), fix)


def _wide_encoding(head: bytes) -> str | None:
    """Return the encoding of text whose letters take two or four bytes each, as iconv calls it; None for others."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return "UTF-32"
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "UTF-16"
    if head[:1] == b"\0" and head[2:3] == b"\0" and head[1:2].isalnum():
        return "UTF-16BE"
    return (
        "UTF-16LE" if head[1:2] == b"\0" and head[3:4] == b"\0" and head[:1].isalnum() and head[2:3].isalnum() else None
    )


def _is_video(head: bytes) -> bool:
    """Return whether a file begins as MP4, QuickTime, AVI, Matroska, WebM, MPEG or Flash video do."""
    is_avi = head.startswith(b"RIFF") and head[8:12] == b"AVI "
    return head[4:8] == b"ftyp" or is_avi or head.startswith((b"\x1aE\xdf\xa3", b"\0\0\1\xba", b"FLV\1"))


def refuse_streams(names: Sequence[str]) -> None:
    """Refuse addresses of cameras in place of files; the message does not repeat a password.

    Raises:
        InputError: E204.
    """
    for name in names:
        scheme, mark, rest = name.partition("://")
        if mark and scheme.lower() in _STREAMS:
            host = re.split(r"[/?#]", rest.rpartition("@")[2], maxsplit=1)[0]
            raise InputError(
                f"{scheme}://{host} is the stream of a camera, no file",
                code="E204",
                fix="write it as source of its [[camera]] in vsd.toml, then: vsd engine live (docs/detectors.md)",
            )


def _likely_kind(source: Source) -> tuple[str, str] | None:
    """Return what a file seems to be that no format recognises, and what to do about it."""
    head = source.head(8192) if source.path.is_file() else b""
    if _VADERE.search(head):
        return (
            "trajectories of Vadere, whose rows are steps from one place to the next",
            "let its output have a row for each time step; then: --map ts=simTime,track_id=pedestrianId,x_m=x,y_m=y "
            "--start INSTANT",
        )
    if head.startswith((b"+--", "┌─".encode())):
        return "a table drawn with lines", "let the database write CSV: mysql -B, sqlite3 -csv, psql --csv, duckdb -csv"
    if _SQL.search(head) is not None:
        return "a dump of a database (SQL)", "load it into that database, and export the table as CSV"
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        if (named := next(((what, fix) for mark, what, fix in _XML if mark.search(head)), None)) is not None:
            return named
        return "XML of a kind that is not known", f"{_CSV}, with time, id, and metres or a box in pixels"
    if head[8:12] == b"DUCK":
        return "a DuckDB database", 'export the table: duckdb -csv FILE "select * from TABLE" > a.csv'
    return ("binary data of a kind that is not known", _CSV) if b"\0" in head else None


def not_recognised(source: Source, formats: Sequence[str]) -> InputError:
    """Return the error of a source of which no format takes itself to be: E204, with what it is or how to read it."""
    where = Where(source.name)
    known = kind_of_no_table(source)
    if known is not None:
        return InputError(f"{source.file_name} is {known[0]}, no table", code="E204", where=where, fix=known[1])
    what = f"the format of {source.file_name} is not recognised"
    likely = _likely_kind(source)
    if likely is not None:
        return InputError(what, code="E204", where=where, why=f"it seems to be {likely[0]}", fix=likely[1])
    return InputError(
        what,
        code="E204",
        where=where,
        why="it is neither VSD frame messages, nor a table with known column names, nor the output of a known engine",
        fix=_json_fix(source)
        or _numbers_fix(source)
        or f"name it: --format {' | '.join(formats)}; headerless tables need --columns; or write an adapter: "
        "docs/plugins.md",
    )


def _numbers_fix(source: Source) -> str | None:
    """Return how to read lines of numbers such as trackers write: frame, id, left, top, width, height and more."""
    first = source.head(4096).partition(b"\n")[0].strip() if source.path.is_file() else b""
    if _TRACKED.fullmatch(first) is None:
        return None
    return (
        "frame, id, left, top, width, height, as trackers write them: --format motchallenge --camera ID --hz 25 "
        "--start INSTANT; other numbers: --columns with our names in their order"
    )


def _json_fix(source: Source) -> str | None:
    from vsd_analytics.ingest.reading.json_guess import guessed_mapping, paths_of
    from vsd_analytics.ingest.reading.json_messages import json_head

    head = json_head(source)
    if not head:
        return None

    one_a_line = f"jq -c '.{{}}[]' {shlex.quote(source.file_name)} > lines.jsonl"
    if b'"FeatureCollection"' in head:
        places = "x_m=geometry.coordinates.0,y_m=geometry.coordinates.1"
        return (
            f"one feature a line: {one_a_line.format('features')}; then, if its coordinates are metres of the floor: "
            f"--format json --map ts=properties.TIME,track_id=properties.ID,{places}"
        )
    mapping = guessed_mapping(source)
    if mapping is not None:
        return f"say where its values are, probably: {mapping}"
    paths = paths_of(source)
    if paths is None:
        return None
    return (
        "say where its values are: --persons LIST --map ts=PATH,track_id=PATH,x_m=PATH,y_m=PATH (numbers are places in "
        f"lists); the first message has {paths}; of lists beside each other, write an object for each person"
    )
