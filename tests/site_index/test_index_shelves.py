"""Where reports are put so that one page links to all of them, and that nothing published is ever lost."""

from __future__ import annotations

from pathlib import Path

import pytest
from site_index import many_reports as many

from vsd_analytics.errors import UsageError
from vsd_analytics.site_index.collect_reports import MARK, gather, projects_below, sources_of, write_index


def links(out: Path, *folders: Path) -> set[str]:
    found = gather(sources_of(folders), out)
    assert found.problems == ()
    addresses = {a for e in found.entries for a in e.links.values()}
    assert all((out / a).is_file() for a in addresses)
    return addresses


def test_reports_below_the_index_are_linked_where_they_are(tmp_path: Path) -> None:
    shop = tmp_path / "my shop"
    many.write(shop, many.report())
    assert links(shop / "reports", shop) == {"2026-W46.html", "2026-W46.json"}
    assert links(shop, shop) == {"reports/2026-W46.html", "reports/2026-W46.json"}
    found = gather(sources_of([shop]), tmp_path)
    assert found.entries[0].links["report"] == "my%20shop/reports/2026-W46.html"
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["2026-W46.html", "2026-W46.json"]


def test_other_reports_are_copied_into_a_folder_of_their_project(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("My Shop", "office")]
    for folder in folders:
        many.write(folder, many.report(), pdf=b"%PDF")
        (folder / "reports" / "notes.txt").write_text("private")
    out = tmp_path / "public"
    names = ("html", "pdf", "json")
    expected = {f"{site}/2026-W46.{end}" for site in ("my-shop", "office") for end in names}
    assert links(out, *folders) == expected
    assert {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()} == expected
    assert oct((out / "office").stat().st_mode & 0o777) == "0o755", "a web server may read it"


def test_a_published_week_stays_when_its_report_is_gone(tmp_path: Path) -> None:
    shop, out = tmp_path / "shop", tmp_path / "public"
    for back in (0, 1):
        many.write(shop, many.report(back=back))
    before = links(out, shop)
    for path in (shop / "reports").glob("2026-W45*"):
        path.unlink()
    assert links(out, shop) == before


def test_a_new_report_replaces_the_published_one_and_an_equal_one_is_left_alone(tmp_path: Path) -> None:
    shop, out = tmp_path / "shop", tmp_path / "public"
    many.write(shop, many.report(value=100.0))
    links(out, shop)
    published = out / "shop" / "2026-W46.json"
    inode = published.stat().st_ino
    links(out, shop)
    assert published.stat().st_ino == inode
    path = many.write(shop, many.report(value=200.0))
    links(out, shop)
    assert published.read_bytes() == path.read_bytes()


def test_a_damaged_json_file_does_not_replace_a_published_one(tmp_path: Path) -> None:
    shop, out = tmp_path / "shop", tmp_path / "public"
    path = many.write(shop, many.report())
    whole = path.read_bytes()
    links(out, shop)
    path.write_bytes(whole[:1000])
    found = gather(sources_of([shop]), out)
    assert [p.code for p in found.problems] == ["W510"]
    assert found.entries[0].report is not None
    assert (out / "shop" / "2026-W46.json").read_bytes() == whole


def test_nothing_outside_the_reports_is_published(tmp_path: Path) -> None:
    shop, out = tmp_path / "shop", tmp_path / "public"
    many.write(shop, many.report())
    (tmp_path / "secret").write_text("secret")
    (shop / "reports" / "2026-W40.html").symlink_to(tmp_path / "secret")
    gather(sources_of([shop]), out)
    assert not list(out.rglob("2026-W40*"))


def test_projects_of_one_name_or_none_are_refused(tmp_path: Path) -> None:
    for place in ("a", "b"):
        many.write(tmp_path / place / "shop", many.report())
    with pytest.raises(UsageError, match="two projects are called shop"):
        sources_of([tmp_path / "a" / "shop", tmp_path / "b" / "shop"])
    with pytest.raises(UsageError, match="is no project"):
        sources_of([tmp_path])
    assert len(sources_of([tmp_path / "a" / "shop", tmp_path / "b" / ".." / "a" / "shop"])) == 1


def test_projects_are_found_directly_below_a_folder(tmp_path: Path) -> None:
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "vsd.toml").write_text("")
    (tmp_path / "c").mkdir()
    assert [p.name for p in projects_below(tmp_path)] == ["a", "b"]
    assert projects_below(tmp_path / "a") == [tmp_path / "a"]
    for none in (tmp_path / "c", tmp_path / "d"):
        with pytest.raises(UsageError, match="no project"):
            projects_below(none)


def test_a_page_of_somebody_else_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!doctype html><title>Our intranet</title>")
    with pytest.raises(UsageError, match="was not written by"):
        write_index(tmp_path, "new")
    (tmp_path / "index.html").write_bytes(b"<!doctype html>" + MARK)
    write_index(tmp_path, "new")
    assert (tmp_path / "index.html").read_text() == "new"
