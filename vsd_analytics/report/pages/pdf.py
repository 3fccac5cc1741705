"""The page as PDF, printed by a Chromium of this machine: tagged, titled, with an outline, equal bytes for equal pages.

The browser starts with an empty profile that is thrown away, finds no network, and sees one file. What differs from run
to run, the dates and the numbers of its tags, is set right afterwards, byte for byte.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal

from vsd_analytics.errors import ReportError, Where

Paper = Literal["a4", "letter"]
VARIABLE: Final = "VSD_CHROMIUM"
NAMES: Final = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"),
    *("microsoft-edge", "microsoft-edge-stable", "msedge"),
)
MAC_APPS: Final = tuple(
    Path(f"/Applications/{name}.app/Contents/MacOS/{name}") for name in ("Google Chrome", "Chromium", "Microsoft Edge")
)
TIMEOUT_S: Final = 60.0
_KEPT: Final = ("PATH", "LD_LIBRARY_PATH", "FONTCONFIG_FILE", "FONTCONFIG_PATH", "XDG_DATA_DIRS")
_FLAGS: Final = (
    *("--headless", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--no-default-browser-check"),
    *("--disable-extensions", "--disable-sync", "--disable-component-update", "--disable-background-networking"),
    *("--disable-crash-reporter", "--lang=en-GB", "--force-color-profile=srgb"),
    # no name resolves, and what needs none goes to a port nobody listens on
    *("--host-resolver-rules=MAP * ~NOTFOUND", "--proxy-server=127.0.0.1:9"),
    *("--no-pdf-header-footer", "--generate-pdf-document-outline"),
)
_DATE: Final = re.compile(rb"(/(?:CreationDate|ModDate) \(D:)\d{14}[+-]\d\d'\d\d'?\)")
_NODE: Final = re.compile(rb"(?<=\()node\d{8}(?=\))")


def find_chromium(
    *,
    environ: Mapping[str, str],
    configured: Path | None = None,
    which: Callable[[str], str | None] = shutil.which,
    mac_apps: tuple[Path, ...] = MAC_APPS,
) -> Path | None:
    """Return the browser that prints: of VSD_CHROMIUM, of `[report] chromium`, on the PATH, among the apps of macOS.

    Args:
        environ: Its VSD_CHROMIUM wins.
        configured: `[report] chromium` of vsd.toml.
        which: Looks a program up on the PATH.
        mac_apps: Where macOS keeps them.

    Returns:
        The program; None when there is none.

    Raises:
        ReportError: E520, the one that was named is no program.
    """
    for named, source in ((environ.get(VARIABLE), VARIABLE), (configured, "[report] chromium")):
        if named:
            program = which(str(named))
            if program is None:
                raise ReportError(
                    f"{source} names {str(named)!r}, which is no program",
                    code="E520",
                    fix=f"name a Chromium or Chrome there, or take {source} out and one is looked for",
                )
            return Path(program)
    on_path = next((program for program in map(which, NAMES) if program), None)
    return Path(on_path) if on_path else next((app for app in mac_apps if app.is_file()), None)


def no_chromium() -> ReportError:
    """Return the error of a machine without a browser."""
    return ReportError(
        "there is no Chromium or Chrome to print the PDF",
        code="E520",
        why="the PDF is the page, printed by a browser of this machine; nothing else keeps its layout and tags",
        fix="apt install chromium, or dnf install chromium, or brew install --cask chromium; if it stands elsewhere: "
        f"{VARIABLE}=/path/to/chromium. Or print the HTML page from any browser",
    )


def print_pdf(html: str, *, chromium: Path, made_at: datetime, timeout_s: float = TIMEOUT_S) -> bytes:
    """Return a page as PDF.

    Args:
        html: The page; its `@page` rule says the paper.
        chromium: The browser.
        made_at: Aware instant that the PDF has as its date, instead of the clock's.
        timeout_s: Longest wait; the browser and its children are killed then.

    Raises:
        ReportError: E521, the browser does not start, fails, takes too long or writes no PDF.
    """
    with tempfile.TemporaryDirectory(prefix="vsd-pdf-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        page, target = folder / "page.html", folder / "page.pdf"
        page.write_text(html, encoding="utf-8")
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium has no sandbox for root
        last_line = _run(
            [
                *(str(chromium), *_FLAGS, *sandbox),
                *(f"--user-data-dir={folder / 'profile'}", f"--print-to-pdf={target}", page.as_uri()),
            ],
            environ={k: os.environ[k] for k in _KEPT if k in os.environ}
            | {"HOME": name, "TMPDIR": name, "TZ": "UTC", "LANG": "C.UTF-8", "LC_ALL": "C.UTF-8"},
            timeout_s=timeout_s,
        )
        data = target.read_bytes() if target.is_file() else b""
    if not data.startswith(b"%PDF-") or b"%%EOF" not in data[-64:]:
        raise _failed(chromium, f"it wrote no PDF: {last_line}")
    return dated(renumbered(data), at=made_at)


def dated(pdf: bytes, *, at: datetime) -> bytes:
    """Return a PDF with its dates set to an instant; every other byte stays where it is."""
    stamp = f"{at.astimezone(UTC):%Y%m%d%H%M%S}+00'00'".encode()
    return _DATE.sub(lambda match: (match[1] + stamp + b")").ljust(len(match[0])), pdf)


def renumbered(pdf: bytes) -> bytes:
    """Return a PDF whose tags are numbered from 1 in their own order.

    The browser numbers them as it comes to them, some runs with gaps; every other byte stays where it is.
    """
    rank = {name: b"node%08d" % i for i, name in enumerate(sorted(set(_NODE.findall(pdf))), start=1)}
    return _NODE.sub(lambda match: rank[match[0]], pdf)


def _run(command: list[str], *, environ: Mapping[str, str], timeout_s: float) -> str:
    """Run the browser and return the last line of its output. It and its children have ended afterwards."""
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=dict(environ),
            start_new_session=True,
        )
    except OSError as error:
        raise _failed(Path(command[0]), str(error.strerror or error)) from None
    try:
        _, stderr = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise _failed(Path(command[0]), f"it did not end within {timeout_s:g} s") from None
    finally:
        _end(process)
    lines = [line.strip() for line in stderr.decode("utf-8", "replace").splitlines() if line.strip()]
    last = lines[-1][:300] if lines else "it said nothing"
    if process.returncode != 0:
        raise _failed(Path(command[0]), f"it ended with {process.returncode}: {last}")
    return last


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:  # else its group may belong to somebody else by now
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if process.stderr is not None:
        process.stderr.close()


def _failed(chromium: Path, why: str) -> ReportError:
    return ReportError(
        "the browser did not print the PDF",
        code="E521",
        where=Where(str(chromium)),
        why=why,
        fix=f"run it by hand once: {chromium.name} --headless --print-to-pdf=/tmp/a.pdf about:blank; "
        f"or name another one: {VARIABLE}=/path/to/chromium",
    )
