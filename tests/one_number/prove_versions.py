"""What an earlier version's outputs say of a week and what today's say, column by column of every output.

    python tests/one_number/prove_versions.py OLD_CHECKOUT PROJECT [--week 2026-W46] [--checkout HERE]

OLD_CHECKOUT is a folder of another commit (`git worktree add`); PROJECT is one that it made. Both versions answer the
same questions of a copy of it. A column is compared as a whole: the numbers of one name in all rows of a document, with
five digits. It is

* equal: the same name has all of them;
* renamed: another column of that output has all of them, or has .8 as -.2 (as a change), or several have (split);
* fewer: the same name has some of them and no other ones: the rest is hidden;
* plain: its name is gone, and its few small numbers are in other columns, too, so that they do not tell which it is;
* gone: no column has them, and none has its name;
* changed: its name has other numbers.

Changed columns and those that are gone are printed: each has a reason in CHANGELOG.md or docs/upgrade.md, or is a bug.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[2]
COMMAND = "from vsd_analytics.cli import main; main()"
FRAMES = """
import json, sys
import vsd_analytics as vsd
site = vsd.open(sys.argv[1])
week = site.week(sys.argv[2])
names = "hours violations cells coverage areas visits flow flow_links queues queue_hours capacity hotspots".split()
names = [name for name in names if hasattr(type(week), name)]
frames = {name: getattr(week, name).df() for name in names}
frames["compare"] = site.compare(sys.argv[3], sys.argv[2]).df()
print(json.dumps({n: json.loads(f.to_json(orient="records", date_format="iso")) for n, f in frames.items()}))
"""
TABLES = """
import json, sys
import duckdb
db = duckdb.connect(sys.argv[1], read_only=True)
names = [n for (n,) in db.execute("select table_name from information_schema.tables order by 1").fetchall()]
tables = {name: db.execute(f'select * from "{name}"').df() for name in names}
print(json.dumps({n: json.loads(t.to_json(orient="records", date_format="iso")) for n, t in tables.items()}))
"""
QUERIES = {
    "hours": "select * from {0}hours",
    "violations": "select * from {0}violations",
    "episodes": "select * from {0}episodes",
    "areas": "select * from {0}area_hours",
    "recording": "select * from {0}camera_hours",
    "visits": "select * from {0}visits",
    "queues": "select * from {0}waits",
    "flow": "select * from {0}moves",
    "maps": "select * from {0}heatmap",
    "groups": "select * from {0}together_days",
    "gatherings": "select * from {0}gatherings",
    "distances": "select * from {0}distances",
    "crowding": "select * from {0}crowding_hours",
    "outages": "select * from {0}outages",
}
"""Marts of both versions; 2.0 calls them `internal.NAME`."""
VERDICTS = ("equal", "renamed", "as a change", "split", "fewer", "plain", "gone", "changed")
Columns = dict[str, list[float]]


@dataclass(frozen=True, slots=True)
class Version:
    """A checkout, and its own copy of the project."""

    checkout: Path
    project: Path

    def run(self, code: str, *arguments: str) -> str:
        """Return what a process with this version prints."""
        environment = {**os.environ, "PYTHONPATH": str(self.checkout)}
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            cwd=self.checkout,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode > 1 or (done.returncode == 1 and not done.stdout.strip()):
            print(f"  {self.checkout.name}: {' '.join(arguments[2:])}: {done.stderr.strip()[:300]}", file=sys.stderr)
        return done.stdout

    def vsd(self, *arguments: str, now: str | None = None) -> str:
        """Return what a command prints."""
        clock = [] if now is None else ["--now", now]
        return self.run(COMMAND, *clock, "-C", str(self.project), *arguments)

    @property
    def is_old(self) -> bool:
        """Whether this version has no `--exact`."""
        return not (self.checkout / "sql" / "tables").is_dir() and "--exact" not in self.vsd("report", "--help")


def documents(version: Version, week: str, folder: Path) -> Iterator[tuple[str, str, Columns]]:
    """Yield (output, family, columns) of everything that a version says of a week."""
    year, number = map(int, week.split("-W"))
    monday = date.fromisocalendar(year, number, 1)
    before, now = f"{monday - timedelta(days=7):%G-W%V}", f"{monday + timedelta(days=7)}T12:00:00+00:00"
    friday = f"{monday + timedelta(days=4)}T22:00:00+00:00"
    old = version.is_old
    exact = [] if old else ["--exact"]
    commands: dict[str, list[str]] = {
        "hours": ["hours", "--week", week],
        "areas": ["hours", "--by", "area", "--week", week],
        "recording": ["coverage", "--week", week],
        "groups": ["groups", "--week", week],
        "hotspots": ["hotspots", "--week", week],
        "visits": ["visits", "--week", week, *exact],
        "queue": ["queue", "--week", week, "--forecast", *exact],
        "capacity": ["capacity", "--week", week, *exact],
        "compare": ["compare", before, week],
        "changes": ["compare", "--change", "1"],
        "plan": ["plan", "--area", area_of(version), "--effect", "-15" if old else "-0.15"],
        "self-check": ["selfcheck"],
        "forecast": ["forecast", "--week", week],
    }
    for family, command in commands.items():
        yield "JSON", family, of_json(version.vsd(*command, "--json", now=now))
        yield "text", family, {"numbers": tokens(version.vsd(*command, now=now))}
    yield "JSON", "flow", of_json(version.vsd("flow", "--week", week, "--format", "json", *exact, now=now))
    yield "CSV", "heatmap", of_csv(version.vsd("heatmap", "--week", week, "--format", "csv"))
    yield "today", "today", of_json(version.vsd("today", "--json", now=friday))
    version.vsd("report", "--week", week, "--format", "json,csv", "--out", str(folder), now=now)
    yield from of_report(json.loads((folder / f"{week}.json").read_text(encoding="utf-8")))
    for path in sorted(folder.glob(f"{week}-*.csv")):
        yield "CSV", path.stem.rpartition("-")[2], of_csv(path.read_text(encoding="utf-8-sig"))
    for name, document in json.loads(version.vsd("planner", "--week", week, "--json", "--out", str(folder), now=now))[
        "planners"
    ][0].items():
        yield "planner", name, of_json(json.dumps({name: document}))
    version.vsd("site", "build", "--out", str(folder / "site"))
    for path in sorted((folder / "site").glob("index*.html")):
        yield (
            "index",
            "index",
            {"numbers": tokens(re.sub(r"(?s)<(style|script|svg).*?</\1>|<[^>]+>", " ", path.read_text()))},
        )
    days = f"{monday}..{monday + timedelta(days=6)}"
    version.vsd("export", "--duckdb", str(folder / "week.duckdb"), "--range", days, *exact)
    for name, rows in json.loads(version.run(TABLES, str(folder / "week.duckdb"))).items():
        yield "DuckDB", name, of_json(json.dumps({name: rows}))
    for name, rows in json.loads(version.run(FRAMES, str(version.project), week, before)).items():
        yield "Python", name, of_json(json.dumps({name: rows}))
    for name, query in QUERIES.items():
        asked = query.format("" if old else "internal.")
        yield "SQL", name, of_csv(version.vsd("sql", asked, "--week", week, "--format", "csv"))


def area_of(version: Version) -> str:
    """Return the area of the first entry of the log, else the first area."""
    log = [json.loads(line) for line in (version.project / "log.jsonl").read_text(encoding="utf-8").splitlines()]
    areas = re.findall(r'\[\[area\]\]\s*id = "([^"]+)"', (version.project / "vsd.toml").read_text(encoding="utf-8"))
    return str(next((entry["area"] for entry in log if entry["area"]), areas[0]))


def of_report(page: Mapping[str, Any]) -> Iterator[tuple[str, str, Columns]]:
    """Yield the sections of a report's JSON file; all answers, and all figures by id, are one document each."""
    for name, section in page.items():
        if isinstance(section, dict | list):
            yield "page", name, of_json(json.dumps({name: section}))


def of_json(text: str) -> Columns:
    """Return the numbers of a document by name: a name is the keys that lead to it, without places in lists."""
    found: defaultdict[str, list[float]] = defaultdict(list)

    def visit(node: Any, name: str) -> None:
        if isinstance(node, dict):
            for key, value in node.items():
                visit(value, name if key in ("value", "theta") and name else f"{name}.{key}" if name else key)
        elif isinstance(node, list):
            for value in node:
                visit(value, name)
        elif isinstance(node, int | float) and not isinstance(node, bool):
            found[name].append(float(f"{node:.5g}"))

    visit(json.loads(text or "{}"), "")
    return dict(found)


def of_csv(text: str) -> Columns:
    """Return the numbers of a table by heading."""
    return of_json(json.dumps([{k: number(v) for k, v in row.items()} for row in csv.DictReader(io.StringIO(text))]))


def number(text: str) -> float | str:
    """Return a cell as a number, where it is one."""
    try:
        return float(text)
    except (TypeError, ValueError):
        return text


def tokens(text: str) -> list[float]:
    """Return the numbers that a text prints, in order."""
    return [float(n.replace(",", "")) for n in re.findall(r"(?<![\w.])\d[\d,]*(?:\.\d+)?", text)]


def left(old: list[float], new: list[float]) -> int:
    """Return how many of the old numbers the new ones lack, as far as five digits tell."""
    rest, n = sorted(new), 0
    for v in sorted(old):
        k = bisect_left(rest, v - 5e-5 * abs(v))
        if k < len(rest) and rest[k] <= v + 5e-5 * abs(v):
            rest.pop(k)
        else:
            n += 1
    return n


def telling(values: list[float]) -> bool:
    """Whether numbers cannot be those of another column by chance: several that differ, or one with four digits."""
    return len({v for v in values if v not in (0.0, 1.0)}) >= 3 or any(abs(v) >= 1e3 or v % 1 > 0 for v in values)


def tail(name: str) -> str:
    """Return the last name of a path, with that of the value that it bounds."""
    *_, parent, leaf = ("", *name.split("."))
    return f"{parent}.{leaf}" if leaf in ("lo", "hi") else leaf


def judged(name: str, old: list[float], new: Columns, output: Columns) -> tuple[str, str]:
    """Return what became of a column, and the column that has it now."""
    same = [n for n in (name, *new) if n in new and (n == name or tail(n) == tail(name))]
    if (at := holder(old, {n: new[n] for n in same})) is not None:
        return "equal", at
    if telling(old):
        for columns in (new, output):
            if (at := holder(old, columns)) is not None:
                return "renamed", at
            if (at := next((n for n, values in columns.items() if are_changes(old, values)), None)) is not None:
                return "as a change", at
        n_old = Counter(old)
        if not left(old, [v for values in output.values() for v in set(values) for _ in range(n_old[v])]):
            return "split", "-"
    if same and new[same[0]]:
        at = min(same, key=lambda n: left(old, new[n]))
        return "fewer" if not left(new[at], old) else "changed", at
    return "gone" if holder(old, output) is None else "plain", "-"


def are_changes(ratios: list[float], values: list[float]) -> bool:
    """Whether each value is a ratio less 1, as far as five digits tell."""
    pairs = zip(sorted(ratios), sorted(values), strict=False)
    return len(ratios) == len(values) and all(abs(ratio - 1 - v) <= 2e-5 * max(1, ratio) for ratio, v in pairs)


def printed(old: list[float], numbers: set[float]) -> tuple[str, str]:
    """Return whether each number of a text is one of the new answers, rounded as the text rounds it, or in percent."""
    known = {round(v * scale, digits) for v in numbers for scale in (1, 100) for digits in range(4)}
    return ("fewer" if any(v not in known for v in old) else "equal"), "numbers"


def holder(old: list[float], columns: Columns) -> str | None:
    """Return the first column that has all of the numbers."""
    return next((at for at, values in columns.items() if len(values) >= len(old) and not left(old, values)), None)


def main() -> None:
    """Print the table, and every column that changed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--week", default="2026-W46")
    parser.add_argument("--checkout", type=Path, default=HERE, help="the later version (default: this one)")
    given = parser.parse_args()
    said: list[list[tuple[str, str, Columns]]] = []
    for checkout in (given.old_checkout, given.checkout):
        with tempfile.TemporaryDirectory() as folder:
            project, out = Path(folder) / "project", Path(folder) / "out"
            shutil.copytree(given.project, project)
            out.mkdir()
            said.append(list(documents(Version(checkout.resolve(), project), given.week, out)))
    by_family: defaultdict[str, Columns] = defaultdict(dict)
    now: defaultdict[tuple[str, str], Columns] = defaultdict(dict)
    for output, family, columns in said[1]:
        now[output, family].update(columns)
        by_family[output].update({f"{family}.{n}": v for n, v in columns.items()})
    said_of: defaultdict[str, set[float]] = defaultdict(set)
    for _, family, columns in said[1]:
        said_of[family] |= {abs(v) for values in columns.values() for v in values}
    table: dict[tuple[str, str], Counter[str]] = {}
    for output, family, columns in said[0]:
        verdicts = table.setdefault((output, family), Counter())
        for name, values in columns.items():
            asked = now[output, family], by_family[output]
            verdict, at = printed(values, said_of[family]) if output == "text" else judged(name, values, *asked)
            verdicts[verdict] += 1
            if verdict in ("changed", "gone"):
                new = now[output, family].get(at, [])
                print(
                    f"{output} {family}: {name} -> {at}: {left(values, new)} of {len(values)}: {values[:3]} {new[:3]}"
                )
    print(f"\n| output | family | {' | '.join(VERDICTS)} |\n|---|---|{'--:|' * len(VERDICTS)}")
    for (output, family), n in table.items():
        print(f"| {output} | {family} | {' | '.join(str(n[verdict]) for verdict in VERDICTS)} |")


if __name__ == "__main__":
    main()
