"""`vsd site build` as a user meets it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from site_index import many_reports as many

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site_index.read_reports import OPERATORS

TOML = """\
[site]
id = "riverside"
name = "Riverside Store"
timezone = "Europe/Rome"

[[floor]]
id = "ground"
name = "Ground floor"

[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
"""


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    folder = tmp_path / "shop"
    folder.mkdir()
    (folder / "vsd.toml").write_text(TOML)
    for back in range(3):
        many.write(folder, many.report(back=back, value=100.0, change=0.01))
    return folder


def build(*arguments: str | Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = run(cli, [str(a) for a in arguments])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_one_project_has_its_index_among_its_reports(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = build("-C", shop, "site", "build", capsys=capsys)
    assert (code, err) == (0, "")
    assert out.startswith(f"{shop}/reports/index.html   ")
    assert out.endswith(" KB   1 floor, 3 weeks, 3 reports\n")
    text = (shop / "reports" / "index.html").read_text()
    assert text.count('href="2026-W46.html"') == 2
    assert build("-C", shop, "site", "build", capsys=capsys)[0] == 0
    assert (shop / "reports" / "index.html").read_text() == text, "nothing changed, nor does the page"


def test_several_projects_need_a_folder(tmp_path: Path, shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / "office"
    many.write(other, many.report(address=many.CANTEEN))
    code, _, err = build("site", "build", shop, other, capsys=capsys)
    assert code == 2
    assert "fix: --out public" in err
    code, out, _ = build("site", "build", shop, other, "--out", tmp_path / "public", capsys=capsys)
    assert code == 0
    assert "2 floors, 3 weeks, 4 reports" in out
    assert 'href="office/2026-W46.html"' in (tmp_path / "public" / "index.html").read_text()


def test_root_takes_every_project_in_a_folder(tmp_path: Path, shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, _ = build("site", "build", "--root", tmp_path, "--out", tmp_path, capsys=capsys)
    assert code == 0
    assert 'href="shop/reports/2026-W46.html"' in (tmp_path / "index.html").read_text()


def test_what_cannot_be_listed_is_named_with_a_fix_and_exit_code_1(
    shop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (shop / "reports" / "2026-W45.json").unlink()
    (shop / "reports" / "points.json").write_text("{}")
    (shop / "reports" / "2026-W44.json").write_text("{")
    code, out, err = build("-C", shop, "site", "build", capsys=capsys)
    assert code == 1
    assert "1 floor, 3 weeks, 3 reports" in out
    for named in ("warning[W510]", "warning[W511]", "warning[W513]", "2026-W45.html", "points.json", "2026-W44.json"):
        assert named in err
    assert err.count("  why: ") == err.count("  fix: ") == 3
    code, out, _ = build("-C", shop, "site", "build", "--json", capsys=capsys)
    told = json.loads(out)
    assert code == 1
    assert [p["code"] for p in told["problems"]] == ["W510", "W511", "W513"]
    assert (told["floors"], told["weeks"]) == (1, 3)


def test_nothing_to_list_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(TOML)
    code, _, err = build("-C", tmp_path, "site", "build", capsys=capsys)
    assert code == 2
    assert "error[E510]: there is no report to list" in err
    assert not (tmp_path / "reports").exists()


def test_make_with_an_empty_store_makes_nothing_and_touches_nothing(
    shop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {p: p.read_bytes() for p in (shop / "reports").iterdir()}
    assert build("-C", shop, "site", "build", "--make", capsys=capsys)[0] == 0
    assert {p: p.read_bytes() for p in before} == before


def test_help_has_examples() -> None:
    said = CliRunner().invoke(cli, ["site", "build", "--help"]).output
    assert "vsd site build riverside harbour --out public" in said


@pytest.mark.parametrize("kind", ["page", "figures", "planner", "alarms"])
def test_what_is_the_operators_is_neither_listed_nor_copied(
    shop: Path, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    reports, public = shop / "reports", tmp_path / "public"
    exact = many.report(back=0, value=100.0, change=0.01)
    exact = replace(exact, rules=replace(exact.rules, mask_below=0))
    marked = "<!doctype html>\n<head>\n<meta name='x'>\n" + OPERATORS.decode()
    name, text = {
        "page": ("2026-W46.html", render_html(exact)),
        "figures": ("2026-W46.json", to_json(exact).decode()),
        "planner": ("2026-W46-planner.html", marked),
        "alarms": ("2026-W46-alarms.html", marked),
    }[kind]
    (reports / name).write_text(text, encoding="utf-8")
    (reports / "2026-W46.pdf").write_bytes(b"%PDF-1.7")
    for out in ((), ("--out", public)):
        code, _, err = build("-C", shop, "site", "build", *out, capsys=capsys)
        assert code == 1
        assert err.count("W516") == 2, "named once, with its command to learn more"
        assert name in err
    assert not (public / "shop" / name).exists()
    assert (public / "shop" / "2026-W45.html").exists()
    is_of_the_week = kind in ("page", "figures")
    assert (public / "shop" / "2026-W46.pdf").exists() is not is_of_the_week, "a PDF does not say whom it is for"
    assert f'href="{name}"' not in (reports / "index.html").read_text()


def test_a_site_that_hides_nothing_lists_its_pages(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (shop / "vsd.toml").write_text(f"{TOML}\n[report]\nmask_below = 0\n")
    exact = many.report(back=0, value=100.0, change=0.01)
    many.write(shop, replace(exact, rules=replace(exact.rules, mask_below=0)))
    code, _, err = build("-C", shop, "site", "build", capsys=capsys)
    assert (code, err) == (0, "")
    assert 'href="2026-W46.html"' in (shop / "reports" / "index.html").read_text()
