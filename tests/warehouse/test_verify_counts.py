"""`vsd verify` on files of door counters: every damage is found, and its printed fix works."""

from __future__ import annotations

import io
import json
import shlex
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from figures.test_counted_doors import DAYS, SIDES, add, site

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.door_counts import SCHEMA, door_counts
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError
from vsd_analytics.store.own_digest import DIGEST, NO_DIGEST, with_digest
from vsd_analytics.store.verify_files import Check
from vsd_analytics.warehouse.verify_facts import check_counts, verify

BY_DAY = [f"{day}T08:00,20,12" for day in DAYS]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Return the file of counts of a project."""
    root = site(tmp_path)
    add(root, BY_DAY, *SIDES)
    return root / "counts" / "door.parquet"


def checked(file: Path) -> Check:
    return check_counts(load_site(file.parent.parent))


def put(file: Path, counts: pa.Table) -> None:
    """Put a file whose digest is right, as a faulty program would."""
    sink = io.BytesIO()
    with pq.ParquetWriter(sink, counts.schema) as writer:
        writer.write_table(counts)
        writer.add_key_value_metadata({DIGEST: NO_DIGEST})
    file.write_bytes(with_digest(sink.getvalue()))


def test_every_flipped_bit_and_every_missing_byte_is_found(file: Path) -> None:
    data = file.read_bytes()
    bits = range(0, len(data) * 8, 7)
    missed = []
    for bit in bits:
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        file.write_bytes(flipped)
        missed += [] if [f.path for f in checked(file).damages] == [file] else [bit]
    assert (missed, len(bits) > 1000) == ([], True)
    for n in range(0, len(data), 13):
        file.write_bytes(data[:n])
        assert [f.path for f in checked(file).damages] == [file], n
    file.write_bytes(data)
    assert (checked(file).findings, checked(file).n) == ((), 1)


def test_columns_and_intervals_that_cannot_be_right_are_found_though_the_digest_is(file: Path) -> None:
    counts = door_counts(load_site(file.parent.parent), "door")
    put(file, counts)
    assert checked(file).findings == ()
    late = counts["to_ts"].cast(pa.int64()).to_pylist()
    wrong = {
        "its columns are from_ts": counts.drop(["n_both"]),
        "n_both string": counts.set_column(4, "n_both", counts["n_both"].cast(pa.string())),
        "a_face int64": counts.append_column("a_face", counts["n_both"]),
        "overlap or are not in order": counts.take([0, 0, 1]),
        "not in order of time": counts.take([1, 0]),
        "overlap": counts.set_column(
            1, SCHEMA.field(1), pa.array([late[1], *late[1:]], pa.int64()).cast(SCHEMA.field(1).type)
        ),
        "not in order": counts.set_column(1, SCHEMA.field(1), counts["from_ts"]),
    }
    for why, rows in wrong.items():
        put(file, rows)
        (finding,) = checked(file).damages
        assert why in finding.why
        with pytest.raises(StoreError, match="damaged"):
            door_counts(load_site(file.parent.parent), "door")


def test_files_that_do_not_belong_there_are_named_and_half_written_ones_of_the_dead_are_noted(file: Path) -> None:
    (file.parent / "doors.csv").write_text("time,in,out\n")
    (file.parent / "gate.parquet").mkdir()
    dead = file.with_name(".door.parquet.0123456789abcdef.tmp")
    dead.write_bytes(b"half")
    findings = {f.path.name: (f.code, f.is_note) for f in checked(file).findings}
    assert findings == {
        "doors.csv": ("E307", False),
        "gate.parquet": ("E307", False),
        dead.name: ("E307", True),
    }
    add(file.parent.parent, ["2026-11-16T08:00,20,12"], *SIDES)
    assert not dead.exists(), "the next command that writes there removes it"


def test_the_command_names_the_file_and_its_fix_and_counting_again_ends_as_before(
    file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent.parent)
    whole = file.read_bytes()
    assert run(cli, ["verify"]) == 0
    assert "counts                1 files" in capsys.readouterr().out
    file.write_bytes(whole[:-1])
    assert verify(load_site(Path.cwd())).n_fresh == 0, "facts are checked all the same"
    assert run(cli, ["verify", "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    (finding,) = printed["findings"]
    assert (finding["check"], finding["code"], finding["path"]) == ("counts", "E302", "counts/door.parquet")
    (counts,) = (check for check in printed["checks"] if check["name"] == "counts")
    assert (counts["n"], counts["damaged"]) == (1, 1)
    assert run(cli, shlex.split(finding["fix"])[1:]) == 0
    add(Path.cwd(), BY_DAY, *SIDES)
    assert file.read_bytes() == whole
    assert run(cli, ["verify"]) == 0


def test_counts_that_may_not_be_read_are_named(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read_bytes = Path.read_bytes

    def refuse(path: Path) -> bytes:
        if path == file:
            raise PermissionError(13, "Permission denied", str(path))
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    (finding,) = checked(file).damages
    assert (finding.path, finding.what) == (file, "the counts of a door counter cannot be read: Permission denied")
    assert "counts remove" not in finding.fix, "they may be whole"
    assert finding.fix
