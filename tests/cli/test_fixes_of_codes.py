"""Every code of a message has an input that provokes it, and its printed fix, carried out, ends the message.

`CASES` provokes a code by commands in a small project and carries out what is printed. What files provoke is tried in
`tests/ingest/test_printed_fixes.py`, and vsd.toml in `tests/config/test_config_fixes.py`. `ELSEWHERE` says why no fix
is run of the rest: they are fixed at a disk, a machine, a network or in another program.
"""

from __future__ import annotations

import re
import shlex
import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import pytest
from ingest.printed_fixes import ways
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cli.explain import explanations

TESTS = Path(__file__).resolve().parents[1]
HEAD = "ts,camera_id,track_id,x_m,y_m\n"
NOW = "2026-11-20"
VALUES: Final = {
    '"…"': "moved",
    "…": "2026-11-12T12:00",
    "ID": "cam-1",
    "DAYS": "2020-01-06..2020-01-06",
    "FILES...": "a.csv",
    "PICTURE": "a.png",
}
"""What only the user knows, in the commands that fixes show."""


def walk(day: str = "2026-11-09", hour: int = 9, n: int = 60, camera: str = "cam-1", more_m: float = 0.0) -> str:
    """Return rows of two people who walk."""
    return "".join(
        f"{day}T{hour:02}:00:{i:02}Z,{camera},{t},{1 + t + i / 40 + more_m:.3f},{2 + t * 1.5:.3f}\n"
        for i in range(n)
        for t in (1, 2)
    )


def write(**files: str) -> Callable[[Path], None]:
    """Return what writes files; `__` in a name is a dot."""

    def into(folder: Path) -> None:
        for name, text in files.items():
            (folder / name.replace("__", ".")).write_text(text, encoding="utf-8")

    return into


def database(folder: Path) -> None:
    with sqlite3.connect(folder / "a.sqlite") as connection:
        connection.execute("create table trajectory_data(frame integer, id integer, pos_x real, pos_y real)")
        connection.execute("create table metadata(key text, value text)")
        rows = [(frame, person, 1 + frame / 10, 2.0 + person) for frame in range(50) for person in (1, 2)]
        connection.executemany("insert into trajectory_data values(?, ?, ?, ?)", rows)
    connection.close()


class Case(NamedTuple):
    """How a code is provoked, and how its fix is carried out.

    Attributes:
        code: The code.
        make: Writes the inputs.
        before: Commands that run first.
        command: The command that says it.
        by_hand: Does what the fix says in words; None = options and commands are taken from the fix itself.
    """

    code: str
    make: Callable[[Path], None]
    command: str
    before: Sequence[str] = ()
    by_hand: Callable[[Path], None] | None = None


ONE = write(a__csv=HEAD + walk())
LOG = '{"at": "2026-11-11T12:00:00+01:00", "text": "moved"}\n'
MOT = "".join(f"{k},1,{100 + k},50,40,100,1,-1,-1,-1\n" for k in range(1, 30))
FRAMES = "".join(f'{{"n": {k}, "people": [{{"id": 1, "x": {k / 10}, "y": 2}}]}}\n' for k in range(30))
CASES = [
    Case("E101", ONE, "check a.csv --format positionz"),
    Case("E101", ONE, "check a.csv --zone Europe/Rom"),
    Case("E101", ONE, "check a.csv --map x=x_m"),
    Case("E101", ONE, "hours --week 2026-46", before=["ingest a.csv"]),
    Case("E101", ONE, "report --week last --out week.html", before=["ingest a.csv"]),
    Case("E101", ONE, "planner --week last --out pages/week.html", before=["ingest a.csv"]),
    Case("E102", write(), "hours", by_hand=lambda f: _vsd(f, "init --no-input --camera cam-1") and None),
    Case("E104", write(), "init --no-input", by_hand=lambda f: (f / "vsd.toml").unlink()),
    Case("E105", ONE, "report --range 2026-11-10..2026-11-11 --format json", before=["ingest a.csv"]),
    Case("E110", write(log__jsonl=LOG + "rubbish\n"), "log list", by_hand=write(log__jsonl=LOG)),
    Case("W110", write(log__jsonl=LOG + LOG[:30]), "log list"),
    Case("E201", write(), "check a.csv", by_hand=ONE),
    Case("E207", write(a__txt=MOT), "check a.txt --format motchallenge --camera cam-1"),
    Case("E207", write(a__jsonl=FRAMES), "check a.jsonl --persons people --map frame=n,track_id=id,x_m=x,y_m=y"),
    Case("E207", database, "check a.sqlite"),
    Case(
        "E208",
        write(a__txt=MOT),
        "check a.txt --format motchallenge --hz 25 --start 2026-11-09T09:00 --coordinates floor",
    ),
    Case("E211", write(a__csv=HEAD + walk().replace(".", "")), "ingest a.csv"),
    Case("W210", write(a__csv=HEAD + walk() + "2026-11-09T09:02:00Z,cam-7,1,1,1\n"), "ingest a.csv", by_hand=None),
    Case(
        "W230",
        ONE,
        "ingest a.csv --zone Asia/Tokyo",
        before=["ingest a.csv"],
    ),
    Case("E301", ONE, "hours"),
    Case("E310", ONE, "purge --range 2020-01-01..2026-11-19", before=["ingest a.csv"]),
    Case(
        "W311",
        write(a__csv=HEAD + walk("2020-01-06", 11, 30, more_m=3.33) + walk("2026-11-10", 11, more_m=0.7)),
        "coverage",
        before=["ingest a.csv --yes"],
    ),
    Case("E406", write(), "calibrate cam-1 --points points.csv", by_hand=write(points__csv="u,v,x,y\n0,0,0,0\n")),
    Case("E510", ONE, "site build", before=["ingest a.csv"]),
]

FILES: Final = frozenset(
    [
        "E202",
        "E203",
        "E204",
        "E205",
        "E209",
        "E210",
        "W212",
        "W220",
        "W221",
        "W222",
        "W223",
        "W224",
        "W225",
        "W226",
        "W227",
        "W228",
    ]
)
"""Provoked by the odd files of tests/ingest/test_printed_fixes.py."""
CONFIG: Final = frozenset(["E103", "E121", "E122", "E123", "E124", "E125", "E126", "E127", "E128", "E129"])
"""Provoked by tests/config/test_config_fixes.py; E103 is the sum of the others."""
_GENERAL: Final = "codes of messages without a code of their own"
_DISK: Final = "a disk that is full, read-only or broken, or a file that was changed by hand: a restore fixes it"
_MACHINES: Final = "other machines, a bucket or a broker that do not answer: starting them fixes it"
_MODEL: Final = "the file of a network: only another export fixes it"
_CALIBRATION: Final = "points or people that do not make a calibration: measuring again fixes it"
_REPORT: Final = "files of reports of other versions, a browser or pictures that are missing"
_MAIL: Final = "a mail server, an address or a password"
_NOTE: Final = "says what was done, and needs nothing"
ELSEWHERE: Final[dict[str, tuple[str, str]]] = {
    **dict.fromkeys(("E100", "E200", "E300", "E400", "E500", "E600", "E700", "E800"), (_GENERAL, "")),
    "E106": ("a plug-in that cannot be loaded: its package is upgraded", "ingest/test_plugins.py"),
    "E107": ("a library that is missing: it is installed", "packaging/test_core.py"),
    "E120": ("the operating system refuses a file", "ingest/test_ingest_pipeline.py"),
    "W111": ("root in the project of another user: a machine's users", "doctor/test_machine_findings.py"),
    "E130": ("a platform without file locks", ""),
    "E206": ("a file that unpacks too far: only a setting or another file helps", "fuzz/test_fuzz_limits.py"),
    "E213": ("a name of a file: it is renamed", "ingest/test_camera_from_name.py"),
    **dict.fromkeys(("E215", "E216", "E217"), (_MODEL, "")),
    "W208": (_NOTE, ""),
    "W209": ("settings of another engine that only its owner knows", "ingest/test_smart_social_distancing.py"),
    "W211": ("an hour that clocks have twice: an export with offsets fixes it", "ingest/test_instants.py"),
    "W213": ("as W311, at the import", ""),
    "W231": ("lines for two tables of vsd.toml, which are pasted", "ingest/test_second_deliveries.py"),
    "W229": ("a file that is cut where it changes", "ingest/test_late_look.py"),
    **dict.fromkeys(("E302", "E303", "E304", "W304", "E305", "E306", "E307", "E313"), (_DISK, "")),
    "E308": ("a broker that sends bad records all day", ""),
    "W310": (_NOTE, ""),
    "E311": ("a program that reads the store: it is closed", "store/test_removal.py"),
    "E312": ("a range inside an hour that is sealed", "retention/test_purging_by_range.py"),
    "E321": (
        "a store that vsd.toml does not describe: its lines are pasted",
        "warehouse/test_described_stores.py",
    ),
    "E322": ("a bucket with erased records: they are erased at its site", "cluster/test_record_mirror.py"),
    "W312": (_NOTE, "retention/test_erasures.py"),
    "E314": ("hours that were purged by age", "retention/test_undo_import.py"),
    **dict.fromkeys(("E315", "E316", "E317", "E318", "E319", "E320"), (_MACHINES, "")),
    **dict.fromkeys(("E401", "E402", "E403", "E404", "E405", "E407"), (_CALIBRATION, "")),
    **dict.fromkeys(("E411", "E412", "E413", "W401", "W402", "W403", "W404", "W405", "W406"), (_CALIBRATION, "")),
    "W232": ("a corrected file, added with --replace", "config/test_count_checks.py"),
    "E503": ("a week that left with other counts", "privacy/test_sequences.py"),
    **dict.fromkeys(("E501", "E502", "E515", "E520", "E521", "E522"), (_REPORT, "")),
    **dict.fromkeys(("W510", "W511", "W512", "W513", "W514", "W516"), (_REPORT, "")),
    **dict.fromkeys(("E601", "E602", "E603", "E604"), ("a query that its writer corrects; E603 names the columns", "")),
    **dict.fromkeys((f"E70{n}" for n in range(1, 10)), (_MACHINES, "")),
    "E710": (_MACHINES, "live/test_alarm_commands.py"),
    **dict.fromkeys((f"E80{n}" for n in range(1, 10)), (_MAIL, "")),
    **dict.fromkeys(("W800", "W801"), (_MAIL, "")),
    "E900": ("a mistake of the program itself", ""),
}
"""Codes whose fix is not run here: why, and a test that provokes the code where one file is about it."""


def test_every_code_is_provoked_or_says_why_not() -> None:
    known = {"CASES": {case.code for case in CASES}, "FILES": FILES, "CONFIG": CONFIG, "ELSEWHERE": {*ELSEWHERE}}
    assert set().union(*known.values()) == {*explanations()}
    twice = [code for code in explanations() if sum(code in codes for codes in known.values()) > 1]
    assert twice == []


@pytest.mark.parametrize("code", [code for code, (_, file) in ELSEWHERE.items() if file])
def test_a_code_that_is_provoked_elsewhere_is_in_that_file(code: str) -> None:
    assert code in (TESTS / ELSEWHERE[code][1]).read_text(encoding="utf-8")


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    monkeypatch.chdir(tmp_path)

    def call(command: str) -> str:
        _vsd(tmp_path, command)
        return "".join(capsys.readouterr())

    return call


def _vsd(folder: Path, command: str) -> int:
    return run(cli, ["-C", str(folder), "--now", NOW, *shlex.split(command)])


def fix_of(said: str, code: str) -> str | None:
    """Return the fix that is printed with a code; "" for a message without one, None where it does not come."""
    block = re.search(rf"\[{code}\]: .*?(?=\n more: vsd explain)", said, re.S)
    if block is None:
        return None
    fix = re.search(r"\n  fix: (.*)", block[0])
    return fix[1] if fix is not None else ""


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.code}: {case.command}")
def test_the_printed_fix_ends_the_message(case: Case, vsd: Callable[[str], str], tmp_path: Path) -> None:
    if case.code != "E102":
        (tmp_path / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    case.make(tmp_path)
    for command in case.before:
        vsd(command)
    fix = fix_of(vsd(case.command), case.code)
    assert fix, "the message must come, with a fix"
    again = case.command
    if case.by_hand is not None:
        case.by_hand(tmp_path)
    else:
        (way, *_) = [w for w in ways(fix, case.command.split()[0]) if w.command or w.options or w.line]
        if way.command:
            vsd(re.sub(r'"…"|…|[A-Z]{2,}(?:\.\.\.)?', lambda m: VALUES.get(m[0], m[0]), way.command))
        elif way.line:
            toml = (tmp_path / "vsd.toml").read_text(encoding="utf-8")
            (tmp_path / "vsd.toml").write_text(
                toml.replace('id = "cam-1"', f'id = "cam-1"\n{way.line}'), encoding="utf-8"
            )
        else:
            if case.code == "E101":  # the right option takes the place of the wrong one
                again = again.partition(f" {way.options[0]} ")[0]
            again += " " + shlex.join(way.options)
    assert fix_of(vsd(again), case.code) is None
