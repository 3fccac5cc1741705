"""Whether two projects have the same facts: count, sum and exclusive or of hashes of all rows, and types, by fact.

    python tests/benchmarks/compare_facts.py PROJECT OTHER

Compares what two versions computed of one store. Files are compared by fact and week, Monday to Sunday UTC: their names
hold fingerprints, and a week that is over may have one file of a small fact. Exits with 1 where anything differs.
"""

from __future__ import annotations

import sys
from datetime import date, timedelta
from pathlib import Path

from vsd_analytics.store.duck import connect, literal_list
from vsd_analytics.warehouse.sqlfiles import relations

DIGEST = "select count(*), sum(hash(f)), bit_xor(hash(f)) from read_parquet({}, hive_partitioning = false) as f"
TYPES = "describe select * from read_parquet({}, hive_partitioning = false)"


def files(project: Path) -> dict[str, list[Path]]:
    """Return the files of each fact and week, without those of marts and the facts of other settings."""
    facts, found = relations("facts"), dict[str, list[Path]]()
    for path in sorted((project / "facts").rglob("*.parquet")):
        first, *between, folder, _ = path.relative_to(project / "facts").parts
        fact = between[0] if first == "weeks" else first
        if first not in ("days", "beside") and (first != "weeks" or fact in facts):
            day = date.fromisoformat(folder.removeprefix("date="))
            found.setdefault(f"{fact} week of {day - timedelta(days=day.weekday())}", []).append(path)
    return found


def main(project: Path, other: Path) -> int:
    """Print what differs, and return the exit code."""
    ours, theirs = files(project), files(other)
    differing = sorted(ours.keys() ^ theirs.keys())
    with connect() as con:
        for name in sorted(ours.keys() & theirs.keys()):
            lists = [literal_list(paths[name]) for paths in (ours, theirs)]
            if any(len({str(con.execute(q.format(of)).fetchall()) for of in lists}) > 1 for q in (DIGEST, TYPES)):
                differing.append(name)
    print("\n".join(differing) or f"{len(ours)} weeks of facts have the same rows and types")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:3])))
