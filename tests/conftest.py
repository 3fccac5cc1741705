"""Fixtures every test may use."""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

# the same examples in every run, and none fails for being slow: machines are noisy
settings.register_profile(
    "steady", deadline=None, derandomize=True, max_examples=40, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("steady")

REPOSITORY = Path(__file__).resolve().parent.parent
IN_MEMORY = Path("/dev/shm")
FREE_BYTES_MIN = 8_000_000_000
WCAG = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice")
OF_DEMO: set[Path] = set()
"""Files with tests that need the demo project."""
LONG = tomllib.loads((Path(__file__).parent / "long_proofs.toml").read_text(encoding="utf-8"))


def _write_in_memory() -> None:
    """Let temporary files be in memory where there is enough of it: tests make a hundred thousand small files."""
    if "TMPDIR" not in os.environ and IN_MEMORY.is_dir() and shutil.disk_usage(IN_MEMORY).free > FREE_BYTES_MIN:
        os.environ["TMPDIR"] = str(IN_MEMORY)
        tempfile.tempdir = None


_write_in_memory()
# Before numpy is imported: threads of its algebra wait in busy loops, a third of the processor time of calibrations.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
gc.disable()  # until all tests are collected: nothing of them is garbage


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that only `make prove` runs, before the marks are chosen from."""
    for item in items:
        node = item.nodeid.removeprefix("tests/")
        if node in LONG or node.split("[", maxsplit=1)[0] in LONG:
            item.add_marker("long")
    _let_one_worker_make_the_demo(items)


def _let_one_worker_make_the_demo(items: list[pytest.Item]) -> None:
    """Put one file that needs the demo project first and the others last, so that no worker waits until it is made.

    Of the others, the notebooks come first: the last file would keep one worker busy for a minute longer.
    """
    OF_DEMO.update(item.path for item in items if "demo_project" in getattr(item, "fixturenames", ()))
    first = next((item.path for item in items if item.path in OF_DEMO), None)
    rank = {path: 0 if path == first else 2 if "notebooks" in path.parts else 3 for path in OF_DEMO}
    items.sort(key=lambda item: rank.get(item.path, 1))


def pytest_collection_finish() -> None:
    """Let the garbage collector leave alone what the collected tests are made of, and run less often.

    It looked at some million objects again and again: a twelfth of the processor time of a test that makes a report.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
    gc.enable()


@pytest.fixture(scope="module", autouse=True)
def _no_wait_for_the_disk(request: pytest.FixtureRequest) -> Iterator[None]:
    """Let fsync do nothing in this process: only a power cut or a broken disk shows a difference.

    Tests of the store and of faults wait for the disk, and so do the processes that a test starts.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not {"faults", "store"} & set(request.path.parts):
            patch.setattr(os, "fsync", lambda file: None)
        yield


@pytest.fixture(scope="module", autouse=True)
def _one_thread_for_a_query(request: pytest.FixtureRequest) -> Iterator[None]:
    """Let DuckDB use one thread in this process: over a few records, threads cost more than they bring.

    Tests of equal bytes and of faults use as many as a user does.
    """
    from vsd_analytics.store.duck import connect
    from vsd_analytics.warehouse.warehouse import Warehouse

    with pytest.MonkeyPatch.context() as patch:
        if not {"faults", "invariances"} & set(request.path.parts):
            patch.setitem(connect.__kwdefaults__, "threads", 1)
            patch.setitem(Warehouse.__init__.__kwdefaults__, "threads", 1)
        yield


@pytest.fixture(scope="module", autouse=True)
def _no_day_files(request: pytest.FixtureRequest) -> Iterator[None]:
    """Let marts be computed without writing week files: a test with one report a store never reads them again.

    A quarter to a half of the processor time of such a test. The demo project is read by many tests. Tests of the
    warehouse compare both ways; those of faults, of purges and of the store are about what is on the disk.
    """
    from vsd_analytics.warehouse.warehouse import Warehouse

    with pytest.MonkeyPatch.context() as patch:
        reads_again = request.path in OF_DEMO or {"faults", "retention", "store", "warehouse"} & set(request.path.parts)
        if not reads_again:
            patch.setitem(Warehouse.__init__.__kwdefaults__, "uses_days", False)
        yield


def _realdata_root() -> Path:
    return Path(os.environ.get("VSD_REALDATA", REPOSITORY.parent / "shared" / "data"))


@pytest.fixture(scope="session")
def realdata() -> Callable[[str], Path]:
    """Return a function from a name below the folder of real recordings to its path; skips where it is absent."""

    def find(name: str) -> Path:
        path = _realdata_root() / name
        if not path.exists():
            pytest.skip(f"real recording {name!r} is not here (set VSD_REALDATA)")
        return path

    return find


@pytest.fixture(scope="session")
def demo_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a demo project with one week, 2026-W46, stored and built. Tests leave it as it is.

    With half of the frames it takes a quarter of a minute, not half a minute. The workers of a run share one: the first
    that needs it makes it.
    """
    from vsd_analytics.config.project import load_site
    from vsd_analytics.ingest.intake import pipeline
    from vsd_analytics.simulate import demo_project as demo
    from vsd_analytics.simulate.demo import ingest_demo
    from vsd_analytics.simulate.demo_project import write_demo_project
    from vsd_analytics.warehouse.build import build

    base = tmp_path_factory.getbasetemp()
    is_worker = "PYTEST_XDIST_WORKER" in os.environ
    folder = (base.parent if is_worker else base) / "demo"
    folder.mkdir(exist_ok=True)
    root = folder / "vsd-demo"
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "made").exists():
            with mock.patch.object(demo, "DETAILED_S", 4.0):
                write_demo_project(root, seed=4, weeks=1)
            with mock.patch.object(pipeline._Ingest, "understand", return_value=None):  # no test reads the cards
                ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
            build(load_site(root))
            (folder / "made").touch()
    return root


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Return a headless Chromium, one for all tests of a worker; skips where none is found."""
    from vsd_analytics.report.pages.pdf import find_chromium

    chromium = find_chromium(environ=os.environ)
    if chromium is None:
        pytest.skip("no chromium, chromium-browser or google-chrome on this machine")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as engine:
        launched = engine.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        yield launched
        launched.close()


@pytest.fixture(scope="session")
def idle_tabs() -> dict[tuple[tuple[str, Any], ...], list[Any]]:
    """Return the browser's tabs that no test uses, by the options of their context."""
    return {}


@pytest.fixture
def tab(browser: Any, idle_tabs: dict[tuple[tuple[str, Any], ...], list[Any]]) -> Iterator[Callable[..., Any]]:
    """Return a function that shows an address in a tab, and notes what it requests (`seen`) and its `errors`.

    Later tests use the tabs again: a new one takes a process, half a second of processor time.
    """
    used = []

    def show(
        address: str, *, color_scheme: str = "light", viewport: dict[str, int] | None = None, **options: Any
    ) -> Any:
        key = tuple(sorted(options.items()))
        idle = idle_tabs.setdefault(key, [])
        page = idle.pop() if idle else browser.new_context(**options).new_page()
        page.emulate_media(media="null", color_scheme=color_scheme, reduced_motion="reduce")
        page.set_viewport_size(viewport or {"width": 1280, "height": 720})
        page.seen, page.errors = [], []
        heard = {
            "request": lambda r: page.seen.append(r.url),
            "console": lambda m: page.errors.append(m.text),
            "pageerror": lambda e: page.errors.append(str(e)),
        }
        for event, note in heard.items():
            page.on(event, note)
        used.append((key, page, heard))
        page.goto(address)
        return page

    yield show
    for key, page, heard in used:
        for event, note in heard.items():
            page.remove_listener(event, note)
        page.mouse.move(0, 0)
        page.goto("about:blank")
        idle_tabs[key].append(page)


@pytest.fixture(scope="session")
def axe() -> Callable[..., list[tuple[str, Any, str]]]:
    """Return a function from a page to its accessibility violations: rule, element, what to do.

    Of rules that pass, axe names one element each: to name all takes it as long as to test them.
    """
    package = pytest.importorskip("axe_playwright_python", reason="axe-playwright-python is not installed")
    script = (Path(package.__file__).parent / "axe.min.js").read_text(encoding="utf-8")

    def violations(page: Any, tags: tuple[str, ...] = WCAG) -> list[tuple[str, Any, str]]:
        if not page.evaluate("'axe' in window"):
            page.evaluate(script)
        options = {"resultTypes": ["violations"], **({"runOnly": tags} if tags else {})}
        found = page.evaluate("options => axe.run(document, options)", options)
        assert found["passes"]
        return [(v["id"], n["target"], n["failureSummary"]) for v in found["violations"] for n in v["nodes"]]

    return violations
