"""Copies the reports of several projects to one folder, so that one page can link to them, and reads that folder.

Reports that lie below the index are linked where they are; others are copied into a folder named after their project.
Nothing is ever deleted there: a week whose records or report are gone from its project stays listed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import UsageError, VsdError, Where
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.owners import is_there
from vsd_analytics.site_index.read_reports import FoundReports, find_reports, kind_of, read_report_json, shared_names
from vsd_analytics.store.durable import publish, sweep_pages

REPORTS = "reports"
MARK = b'<meta name="generator" content="vsd-analytics site index">'


@dataclass(frozen=True, slots=True)
class ReportSource:
    """A project whose reports are listed.

    Attributes:
        folder: Project folder.
        name: Name of its folder in links: a-z, 0-9, - and _.
        hides: It hides small counts from readers.
    """

    folder: Path
    name: str
    hides: bool = True

    @property
    def reports(self) -> Path:
        """Return its folder of reports."""
        return self.folder / REPORTS


def sources_of(folders: Sequence[Path]) -> tuple[ReportSource, ...]:
    """Return the projects in some folders.

    Args:
        folders: Project folders: each has a vsd.toml or a folder `reports`.

    Raises:
        UsageError: E101, a folder is no project, or two have one name.
    """
    sources: dict[str, ReportSource] = {}
    for folder in dict.fromkeys(f.resolve() for f in folders):
        if not is_there(folder) or not (is_there(folder / REPORTS) or is_there(folder / "vsd.toml")):
            raise UsageError(
                f"{folder} is no project",
                why="it has neither a vsd.toml nor a folder reports",
                fix="name project folders, or their common folder with --root",
            )
        name = re.sub(r"[^a-z0-9_-]+", "-", folder.name.lower()).strip("-") or "site"
        if name in sources:
            raise UsageError(
                f"two projects are called {name}",
                where=Where(str(folder)),
                why=f"{sources[name].folder} is, too, and pages are published under the name of the folder",
                fix="rename one of the two folders",
            )
        sources[name] = ReportSource(folder, name, hides_counts(folder))
    return tuple(sources.values())


def projects_below(root: Path) -> list[Path]:
    """Return `root` if it is a project, else all projects directly in it, by name.

    Raises:
        UsageError: E101, there are none.
    """
    if (root / "vsd.toml").is_file():
        return [root]
    projects = sorted(p for p in root.iterdir() if (p / "vsd.toml").is_file()) if root.is_dir() else []
    if not projects:
        raise UsageError(
            f"there is no project in {root}",
            why="a project is a folder with a vsd.toml",
            fix="--root FOLDER-OF-PROJECTS, or name the project folders",
        )
    return projects


def gather(sources: Iterable[ReportSource], out: Path) -> FoundReports:
    """Return the weeks of all projects, with links relative to `out`; copy what does not lie below it.

    Args:
        sources: Projects.
        out: Folder of the index.
    """
    folders = [_gathered(source, out.resolve()) for source in sources]
    return FoundReports(
        entries=tuple(e for s in folders for e in s.entries), problems=tuple(p for s in folders for p in s.problems)
    )


def write_index(out: Path, page: str) -> Path:
    """Put the page at `out/index.html`, wholly or not at all.

    Raises:
        UsageError: E515, the folder has an index.html that this program did not write.
    """
    path = out / "index.html"
    if path.exists() and MARK not in path.read_bytes()[:8192]:
        raise UsageError(
            f"{path} was not written by vsd site build",
            code="E515",
            where=Where(str(path)),
            why="it may be a page of your own, which is never written over",
            fix="--out ANOTHER-FOLDER, or move that file",
        )
    out.mkdir(parents=True, exist_ok=True)
    publish(path, page.encode())
    sweep_pages(out)
    return path


def _gathered(source: ReportSource, out: Path) -> FoundReports:
    reports = source.reports.resolve()
    if reports.is_relative_to(out):
        prefix = "".join(f"{quote(part)}/" for part in reports.relative_to(out).parts)
        return find_reports(reports, project=source.name, prefix=prefix, hides=source.hides)
    known = find_reports(reports, project=source.name, hides=source.hides)
    target = out / source.name
    target.mkdir(parents=True, exist_ok=True)
    for name in shared_names(reports, hides=source.hides)[0]:
        kind = kind_of(name)
        if kind is not None and (kind != "json" or _is_readable(reports / name)):
            _copy(reports / name, target / name)
    sweep_pages(target)
    published = find_reports(target, project=source.name, prefix=f"{source.name}/", hides=source.hides)
    named = {_name(p) for p in known.problems}
    return FoundReports(
        entries=published.entries,
        problems=(*known.problems, *(p for p in published.problems if _name(p) not in named)),
    )


def hides_counts(folder: Path) -> bool:
    """Tell whether a project hides small counts; one without a readable vsd.toml does."""
    try:
        return Mask(int(load_site(folder).settings.mask_below)).is_on
    except VsdError:
        return True


def _is_readable(path: Path) -> bool:
    try:
        return read_report_json(path) is not None
    except VsdError:
        return False


def _copy(path: Path, to: Path) -> None:
    data = path.read_bytes()
    if not to.is_file() or to.is_symlink() or to.read_bytes() != data:
        publish(to, data, is_synced=False)


def _name(problem: VsdError) -> str:
    return Path(problem.where.file).name if problem.where is not None else problem.what
