"""The demo's twelve weeks as every weekly page and `vsd compare` report them, beside what was planted.

The mean of people grows by 0.9 % a week, and violations by about twice as much; days differ by chance. The display
leaves the door before week 42; stickers without an effect are logged before week 45. What the pages say is set beside
truth.json: what the simulator counted of true positions in all open hours. Makes the demo (some minutes), or reads one
made by

    vsd demo twelve --weeks 12 --reports all
    python tests/report/story/prove_twelve_weeks.py --project twelve
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from datetime import datetime
from pathlib import Path
from typing import Any, Final

VSD: Final = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
ENDS: Final = {"": "value", "_lo": "lo", "_hi": "hi"}
SPANS: Final = (
    ("five weeks of the slow rise", "2026-W36", "2026-W41"),
    ("over the redesign", "2026-W41", "2026-W42"),
    ("four weeks of the slow rise", "2026-W42", "2026-W46"),
)


def truth_by_week(truth: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return true violations per open hour by week and place, and people in view as place `people`."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for row in truth["areas"]:
        found[row["week"]][row["area_id"]] = row["violations"] / row["open_h"]
    people = defaultdict(list)
    for hour in truth["hours"]:
        year, week, _ = datetime.fromisoformat(hour["start"]).isocalendar()
        people[f"{year}-W{week:02}"].append(hour["mean_people"])
    for name, values in people.items():
        found[name]["people"] = sum(values) / len(values)
    return found


def percent(share: float) -> str:
    """Return a change in percent."""
    return f"{100 * share:+.0f} %"


def said(change: dict[str, Any] | None) -> str:
    """Return a change as the page's data have it: its range and verdict."""
    if change is None or change.get("change") is None:
        return "no change given"
    value, lo, hi = (change[k] for k in ("change", "change_lo", "change_hi"))
    verdict = str(change["verdict"]).replace("_", " ")
    if lo is None:
        return f"{percent(value)}, no range, {verdict}"
    return f"{percent(value)} ({100 * lo:+.0f} to {100 * hi:+.0f}), {verdict}"


def weeks_table(reports: dict[str, dict[str, Any]], true: dict[str, dict[str, float]], planted: dict[str, str]) -> None:
    print("| week | planted | true change of violations, of people | rate | share of time | headline |")
    print("|---|---|--:|---|---|---|")
    n, held, clear, before = 0, 0, 0, ""
    for week, report in reports.items():
        happened, level = "", report["level"]
        if before:
            ratio, people = (true[week][k] / true[before][k] - 1 for k in ("floor", "people"))
            happened = f"{percent(ratio)}, {percent(people)}"
            if level["violation_rate"]["change_lo"] is not None:
                n += 1
                held += level["violation_rate"]["change_lo"] <= ratio <= level["violation_rate"]["change_hi"]
                clear += sum(
                    str(level[k]["verdict"]).startswith("clear") for k in ("violation_rate", "close_time_share")
                )
        cells = [
            week,
            planted.get(week, ""),
            happened,
            *(said(level[k]) for k in ("violation_rate", "close_time_share")),
        ]
        print(f"| {' | '.join(cells)} | {report['story']['headline']} |")
        before = week
    print(f"\nThe range of the rate holds the true change in {held} of {n} weeks.")
    print(f"{clear} clear verdicts on the floor.\n")


def areas_table(reports: dict[str, dict[str, Any]], true: dict[str, dict[str, float]], moved: str) -> None:
    """Print what is clear of the areas, and count verdicts and ranges of those of which nothing was planted."""
    n, held, before = 0, 0, ""
    clear: list[str] = []
    for week, report in reports.items():
        for area in report["areas"] if before else ():
            name, violation_rate = area["area_id"], area["violation_rate"]
            if name not in true[week] or violation_rate["change_lo"] is None:
                continue
            ratio = true[week][name] / true[before][name] - 1
            n += 1
            held += violation_rate["change_lo"] <= ratio <= violation_rate["change_hi"]
            for what in ("violation_rate", "close_time_share"):
                if str(area[what]["verdict"]).startswith("clear"):
                    is_planted = name == "entrance" and week == moved
                    note = "planted" if is_planted else "not planted"
                    clear.append(f"| {week} | {name} | {what} | {said(area[what])} | {percent(ratio)} | {note} |")
        before = week
    print("| week | area | of | clear on the page | true change of violations | |\n|---|---|---|---|--:|---|")
    print("\n".join(clear))
    print(f"\nRanges of areas hold the true change in {held} of {n}.\n")


def compared(project: Path, a: str, b: str) -> list[str]:
    """Return what `vsd compare` says of person-time too close per open hour, and of its share of the time (M6)."""
    command = [*VSD, "-C", str(project), "compare", a, b, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr)
    floor = json.loads(done.stdout)["answers"]["compared_places"]["rows"][0]
    return [
        said(
            {f"change{end}": floor[f"{name}_change"][part] for end, part in ENDS.items()}
            | {"verdict": floor[f"{name}_verdict"]}
        )
        for name in ("close_min_per_open_h", "close_time_share")
    ]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--project", type=Path, help="a demo of twelve weeks with all reports; default: make one")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        project = given.project or Path(folder) / "twelve"
        if given.project is None:
            made = [*VSD, "demo", str(project), "--weeks", "12", "--reports", "all"]
            subprocess.run(made, check=True, capture_output=True)
        print_all(project)


def print_all(project: Path) -> None:
    """Print the tables of one demo."""
    truth = json.loads((project / "truth.json").read_text(encoding="utf-8"))
    true = truth_by_week(truth)
    reports = {
        week: json.loads((project / "reports" / f"{week}.json").read_text(encoding="utf-8")) for week in truth["weeks"]
    }

    def week_of(instant: str) -> str:
        year, week, _ = datetime.fromisoformat(instant).isocalendar()
        return f"{year}-W{week:02}"

    moved, idle = week_of(truth["redesign"]["at"]), week_of(truth["idle"]["at"])
    planted = {week_of(gap["start"]): "mostly lost" for gap in truth["lost"]}
    planted |= {week_of(day): "a holiday" for day in truth["closed"]}
    planted |= {moved: "redesign of the entrance", idle: "a change without effect"}
    weeks_table(reports, true, planted)
    areas_table(reports, true, moved)
    print("| compared | true change of violations, of people | person-time too close an hour | share of time |")
    print("|---|--:|---|---|")
    for name, a, b in SPANS:
        ratio, people = (true[b][k] / true[a][k] - 1 for k in ("floor", "people"))
        cells = [f"{name}, {a} and {b}", f"{percent(ratio)}, {percent(people)}", *compared(project, a, b)]
        print(f"| {' | '.join(cells)} |")
    last = reports[truth["weeks"][-1]]
    print(
        "\nusual ranges on the last page:",
        json.dumps({k: last["trend"][k] for k in ("usual_violation_rate", "usual_close")}),
    )
    for change in last["change_effects"]:
        print(change["text"], *(f"{k}: {said(change[k])}" for k in ("burden", "running", "net")), sep=" | ")


if __name__ == "__main__":
    main()
