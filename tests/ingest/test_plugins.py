"""Formats of installed plug-ins: found by their entry point, tried before tables, never in the way of our own."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.formats import adapters
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source

MODULE = """
class Hall:
    name = "hall"
    coordinates = "floor metres"

    def detects(self, source):
        return source.head(5) == b"#hall"

    def read(self, source, options):
        yield from ()
"""


def install(folder: Path, entries: str, module: str = MODULE) -> None:
    """Write a package as an installer leaves it: a module, and its entry points in a dist-info folder."""
    (folder / "hall_vsd.py").write_text(module, encoding="utf-8")
    info = folder / "hall_vsd-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hall-vsd\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[{adapters.GROUP}]\n{entries}\n", encoding="utf-8")


@pytest.fixture
def site_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "site-packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    adapters.plug_ins.cache_clear()
    yield folder
    adapters.plug_ins.cache_clear()
    sys.modules.pop("hall_vsd", None)


def test_a_plug_in_is_a_format_like_ours(site_packages: Path, tmp_path: Path) -> None:
    install(site_packages, "hall = hall_vsd:Hall")
    path = tmp_path / "a.csv"  # a table would recognise the suffix
    path.write_text("#hall 1\n", encoding="utf-8")

    assert adapters.formats() == (*adapters.SPECIFIC, "hall", *adapters.GENERAL)
    assert find_adapter(Source(path), IngestOptions()).name == "hall"
    assert find_adapter(Source(path), IngestOptions(format="table")).name == "table"


def test_a_plug_in_cannot_replace_a_format_of_ours(site_packages: Path) -> None:
    install(site_packages, "frames = hall_vsd:Hall\npairs = hall_vsd:Hall")
    assert adapters.formats() == (*adapters.SPECIFIC, *adapters.GENERAL)
    assert type(adapters.adapter("frames")).__module__ == "vsd_analytics.ingest.formats.frames"


@pytest.mark.parametrize(
    ("entries", "module", "why"),
    [
        ("hall = hall_vsd:Hall", "import no_such_library\n", "ModuleNotFoundError"),
        ("hall = hall_vsd:Corridor", MODULE, "AttributeError"),
        ("hall = hall_vsd:Hall", "Hall = len\n", "TypeError"),
        ("hall = hall_vsd:Hall", "Hall = dict\n", "TypeError"),
    ],
)
def test_a_plug_in_that_cannot_be_loaded_is_named(site_packages: Path, entries: str, module: str, why: str) -> None:
    install(site_packages, entries, module)
    with pytest.raises(UsageError, match="plug-in hall-vsd of format hall") as raised:
        adapters.adapter("hall")
    assert raised.value.code == "E106"
    assert why in str(raised.value.why)
    assert "pip uninstall hall-vsd" in str(raised.value.fix)
