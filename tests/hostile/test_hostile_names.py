"""Hostile names, files, drawings and queries: nothing escapes its place, and docs/security.md tells each outcome."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hostile_lab import CONFIG, Lab, new_lab
from hostile_tries import DOCS, PLACES, STRINGS, TABLES, documented_outcomes, outcomes, place_line, try_line
from simulate.small_scenes import START_MS, make_empty, make_pair, merge

from vsd_analytics.cli.output import emit_json, plain
from vsd_analytics.errors import CONTROL
from vsd_analytics.ingest.formats.frames import MessageRows
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.simulate.frame_messages import write_messages
from vsd_analytics.store.part_files import ENGINES_MAX, engines_of
from vsd_analytics.store.spreadsheet import safe_cell
from vsd_analytics.store.store import Store


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    made = new_lab(tmp_path_factory.mktemp("hostile"))
    yield made
    made.check_places()


@pytest.fixture(scope="module")
def documented() -> list[str]:
    return DOCS.read_text(encoding="utf-8").split("\n")


@pytest.mark.parametrize("place", PLACES)
def test_a_hostile_string_stays_in_its_place(lab: Lab, documented: list[str], place: str) -> None:
    """Every string in at least one place; `hostile_tries.py --check` tries all in all."""
    [line] = [line for line in documented if line.startswith(f"| {place} | ")]
    expected = documented_outcomes(line)
    names = list(STRINGS)[list(PLACES).index(place) % 12 :: 12]
    assert outcomes(lab, place, names) == {name: expected[name] for name in names}
    lab.check_places()


def test_lines_of_the_documentation_are_read_as_they_are_written(documented: list[str]) -> None:
    for place in PLACES:
        [line] = [line for line in documented if line.startswith(f"| {place} | ")]
        assert place_line(place, documented_outcomes(line)) == line


@pytest.mark.parametrize(("table", "name"), [(table, name) for table, tries in TABLES.items() for name in tries])
def test_a_hostile_try_ends_as_documented(lab: Lab, documented: list[str], table: str, name: str) -> None:
    assert try_line(name, TABLES[table][name](lab)) in documented
    lab.check_places()


class Tree(HTMLParser):
    """The elements and attributes of a page, its addresses, and its texts apart."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, tuple[str, ...]]] = []
        self.addresses: set[str] = set()
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, tuple(name for name, _ in attrs)))
        self.addresses |= {value or "" for name, value in attrs if name in ("href", "src", "action", "style")}

    def handle_endtag(self, tag: str) -> None:
        self.elements.append((f"/{tag}", ()))

    def handle_data(self, data: str) -> None:
        self.text += data

    def handle_comment(self, data: str) -> None:
        self.elements.append(("!--", ()))


SHOWN = [s for s in STRINGS.values() if len(s) <= 60 and not CONTROL.search(s) and s.strip()]


def named_project(root: Path, names: list[str]) -> Lab:
    """Return a project whose site, floor, areas, cameras and log bear the names."""
    lab = new_lab(root)
    quoted = [json.dumps(n, ensure_ascii=False) for n in names]
    text = CONFIG.partition("[[floor]]")[0].replace('"Shop"', quoted[0])
    text += f'[[floor]]\nid = "ground"\nname = {quoted[1]}\n'
    text += "".join(f'[[camera]]\nid = "cam-{i}"\nname = {name}\n' for i, name in enumerate(quoted))
    text += "".join(
        f'[[area]]\nid = "area-{i}"\nname = {name}\nvisits = true\nqueue = true\ncapacity = 1\n'
        f"polygon = [[{i}, 0], [{i + 1}, 0], [{i + 1}, 9], [{i}, 9]]\n"
        for i, name in enumerate(quoted)
    )
    (lab.project / "vsd.toml").write_text(text, encoding="utf-8")
    for name in names:
        assert lab.vsd("log", "add", "--at=2026-11-10T12:00", "--", name)[0] == 0
    cameras = [f"cam-{i}" for i in range(len(names))]
    starts = [START_MS + 90_000 * k for k in range(len(names))]
    pairs = [
        make_pair(1.0, 60, start_ms=ms, at=(k + 0.52, 5 + k % 2), camera=f"cam-{k}") for k, ms in enumerate(starts)
    ]
    beats = [make_empty(3600, interval_s=10, camera=c) for c in cameras[:-2]]
    path = write_messages(lab.root / "in" / "a.jsonl", merge(*pairs, *beats))
    assert lab.vsd("ingest", path)[0] == 0
    return lab


def test_a_page_of_hostile_names_has_the_elements_of_a_page_of_tame_ones(tmp_path: Path) -> None:
    hostile = SHOWN
    assert len(hostile) >= 12
    # of the same lengths, though not of the same widths: a name on a map is left out where it has no room
    tame = ["".join(" " if c == " " else chr(97 + i) for c in name) for i, name in enumerate(hostile)]
    trees, labs = [], []
    for folder, names in (("hostile", hostile), ("tame", tame)):
        lab = named_project(tmp_path / folder, names)
        assert lab.vsd("report", "--week", "2026-W46", "--format", "html,csv,json")[0] == 0
        (page,) = (lab.project / "reports").glob("*.html")
        trees.append(Tree(page.read_text(encoding="utf-8")))
        assert 'id="waiting"' in page.read_text(encoding="utf-8"), "names of queues and of places with a capacity too"
        labs.append(lab)
        lab.check_places()
    ours, theirs = trees
    others, plain = ([e for e in tree.elements if e[0] not in {"text", "/text"}] for tree in trees)
    assert len(others) > 300
    assert others == plain
    assert ours.addresses == theirs.addresses
    shown = " ".join(ours.text.split())
    missing = [name for name in hostile if " ".join(name.split()) not in shown]
    assert missing == []
    _twins(labs[0], hostile)


def _twins(lab: Lab, names: list[str]) -> None:
    """The JSON and CSV of the same week: every name exact in JSON, no cell a formula in CSV."""
    (written,) = (lab.project / "reports").glob("*.json")
    areas = {a["name"] for a in json.loads(written.read_text(encoding="utf-8"))["areas"]}
    assert not set(names) - areas
    text = next((lab.project / "reports").glob("*areas.csv")).read_text(encoding="utf-8")
    cells = [row["name"] for row in csv.DictReader(io.StringIO(text))]
    assert set(cells) >= {safe_cell(name) for name in names}
    assert not [c for c in cells if c[:1] in ("=", "+", "-", "@")]
    lab.check_places()


def test_rows_of_a_query_are_no_formulas_in_csv_exact_in_json_and_tame_on_the_terminal(lab: Lab) -> None:
    lab.ingest(lab.file("a.jsonl", b'{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[]}\n'))
    query = "select '=1+1' as \"@x\", '\x1b[31m' || chr(155) || chr(8238) as b, -1 as c"
    out = lab.vsd("sql", query, "--format", "csv", "--range", "2026-11-09")[1]
    assert out == "'@x,b,c\n'=1+1,\ufffd[31m\ufffd\ufffd,-1\n"
    (row,) = json.loads(lab.vsd("sql", query, "--json", "--range", "2026-11-09")[1])["rows"]
    assert row == {"@x": "=1+1", "b": "\x1b[31m\x9b\u202e", "c": -1}


def test_json_escapes_what_steers_a_terminal_and_stays_the_same_value(capsys: pytest.CaptureFixture[str]) -> None:
    value = {"a": "".join(STRINGS[n][:50] for n in STRINGS)}
    emit_json(value)
    out = capsys.readouterr().out
    assert json.loads(out) == value
    assert plain(out) == out
    out.encode()


def test_a_new_engine_name_with_every_message_does_not_fill_the_store(tmp_path: Path) -> None:
    rows = MessageRows(IngestOptions())
    for k in range(100):
        rows.add(k, json.dumps({"v": 1, "camera": "c", "ts": "2026-11-09T09:00:00Z", "engine": f"{k}"}).encode())
    assert len(rows.batch(0).engines) == 100
    import pyarrow as pa

    from vsd_analytics.schema import SCHEMAS

    store = Store(tmp_path / "store", site_id="s")
    for k in range(3):
        row = {"camera_id": "c", "ts": START_MS + k, "n_persons": None, "n_pairs": None, "seq": None}
        store.append("frames", pa.Table.from_pylist([row], SCHEMAS["frames"]), engines=[f"{k}-{i}" for i in range(100)])
    store.fold()
    (part,) = store.parts("frames")
    assert len(engines_of(part.path)) == ENGINES_MAX


def test_a_log_entry_written_by_hand_may_not_turn_the_writing_round(lab: Lab) -> None:
    log = lab.project / "log.jsonl"
    before = log.read_bytes() if log.exists() else b""
    for text in ("a\u202eb", "a\x1bb", "x" * 501):
        log.write_bytes(json.dumps({"at": "2026-11-10", "text": text}).encode() + b"\n")
        code, out, _ = lab.vsd("log", "list", "--json")
        assert (code, json.loads(out)["code"]) == (2, "E110")
    log.write_bytes(before)
