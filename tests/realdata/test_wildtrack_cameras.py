"""WILDTRACK's seven views as seven cameras: what several see is counted once."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

pytestmark = pytest.mark.realdata

FUSED = {"persons": 4_785, "violations": 4_093}
"""Person records, and pairs nearer than 2 m, of the positions fused from all views."""

NAIVE = {"persons": 19_824, "violations": 16_185}
"""The same in each view's own pixels through its own calibration, added up."""

FILE = "wildtrack/annotations_positions_0_995.tar.gz"
DAY = "2026-01-05"


def vsd(root: Path, *args: str) -> str:
    with redirect_stdout(io.StringIO()) as said:
        code = run(cli, ["-C", str(root), *args])
    assert code == 0, said.getvalue()
    return said.getvalue()


@pytest.fixture(scope="module")
def matrices(realdata: Callable[[str], Path]) -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = json.loads(realdata("wildtrack/H_image_to_ground_m.json").read_text())
    return found


def project(root: Path, matrices: dict[str, list[list[float]]], *, are_on_one_floor: bool) -> Path:
    """Write a project of seven calibrated cameras: of one floor, or each of its own so that none yields to another."""
    floors = ["square"] * 7 if are_on_one_floor else [f"floor-{number}" for number in range(7)]
    lines = ['[site]\nid = "square"\nname = "Square"\ntimezone = "UTC"\n']
    lines += [f'[[floor]]\nid = "{floor}"\nname = "{floor}"\n' for floor in dict.fromkeys(floors)]
    root.mkdir()
    for number, ((name, h), floor) in enumerate(zip(matrices.items(), floors, strict=True)):
        (root / f"{name}.txt").write_text("\n".join(" ".join(map(repr, row)) for row in h))
        lines.append(
            f'[[camera]]\nid = "view-{number}"\nname = "View {number}"\nengine_ids = ["{name}"]\nfloor = "{floor}"\n'
            f'picture_px = [1920, 1080]\nhomography = "{name}.txt"\n'
        )
    (root / "vsd.toml").write_text("\n".join(lines))
    return root


@pytest.fixture(scope="module")
def counted(
    realdata: Callable[[str], Path], matrices: dict[str, list[list[float]]], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, dict[str, int]]:
    """Return person and violation records: merged, and added up over cameras that know nothing of one another."""
    found = {}
    for how in ("merged", "naive"):
        root = project(tmp_path_factory.mktemp(how) / "p", matrices, are_on_one_floor=how == "merged")
        vsd(root, "ingest", str(realdata(FILE)), "--per-camera", "--start", f"{DAY}T09:00:00Z")
        found[how] = sums_of(root)
    return found


def sums_of(root: Path) -> dict[str, int]:
    """Return person records, violation records and, as "episodes", violations."""
    sums = (
        "select sum(person_records)::int as persons, sum(violation_records)::int as violations, "
        "sum(n_violations)::int as episodes from hours"
    )
    (found,) = json.loads(vsd(root, "sql", sums, "--range", f"{DAY}..{DAY}", "--json"))["rows"]
    return dict(found)


def test_the_sum_of_the_cameras_counts_everybody_four_times(counted: dict[str, dict[str, int]]) -> None:
    print("naive sum of cameras:", counted["naive"])
    assert {name: pytest.approx(n, rel=0.001) for name, n in NAIVE.items()} == records(counted["naive"])


def test_merged_cameras_give_the_fused_truth_within_five_percent(counted: dict[str, dict[str, int]]) -> None:
    merged = records(counted["merged"])
    print("merged:", {name: (n, f"{n / FUSED[name] - 1:+.1%}") for name, n in merged.items()})
    assert {name: pytest.approx(n, rel=0.05) for name, n in FUSED.items()} == merged


def records(sums: dict[str, int]) -> dict[str, int]:
    return {name: sums[name] for name in FUSED}


def test_violations_seen_by_several_cameras_are_one(
    realdata: Callable[[str], Path], counted: dict[str, dict[str, int]], tmp_path: Path
) -> None:
    """Within 10 % of those of the positions fused from all views, of which there are two hundred."""
    (tmp_path / "vsd.toml").write_text(
        '[site]\nid = "square"\nname = "Square"\ntimezone = "UTC"\n[[floor]]\nid = "square"\nname = "Square"\n'
        '[[camera]]\nid = "all"\nname = "All"\nfloor = "square"\n'
    )
    vsd(tmp_path, "ingest", str(realdata(FILE)), "--camera", "all", "--start", f"{DAY}T09:00:00Z")
    fused = sums_of(tmp_path)
    told = {how: sums["episodes"] for how, sums in {**counted, "fused": fused}.items()}
    print("violations:", told)
    assert records(fused) == FUSED
    assert told["naive"] > 3.5 * told["fused"]
    assert told["merged"] == pytest.approx(told["fused"], rel=0.1)
