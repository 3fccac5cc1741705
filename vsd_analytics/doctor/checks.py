"""`vsd doctor`: checks everything that a weekly report needs, and says what to do about what is missing."""

from __future__ import annotations

import platform
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from importlib import metadata
from itertools import chain
from pathlib import Path

from vsd_analytics.config.project import FILE, find_project, load_site
from vsd_analytics.doctor.counters import examine_counters
from vsd_analytics.doctor.finding import Finding
from vsd_analytics.doctor.nodes import examine_exchange
from vsd_analytics.errors import ConfigError, StoreError, VsdError
from vsd_analytics.owners import denied, user_name
from vsd_analytics.report.pages.pdf import find_chromium
from vsd_analytics.settings import SETTINGS, Settings
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.version import VERSION

CORE_PACKAGES = ("duckdb", "pyarrow", "numpy", "pandas", "shapely")
FIGURE_PACKAGES = ("scipy", "opencv-python-headless", "matplotlib")
NETWORK_FILE_SYSTEMS = ("nfs", "cifs", "smb", "afp", "9p", "sshfs", "fuse.sshfs", "glusterfs", "ceph")
OLD_CALIBRATION_DAYS = 365
FREE_MIN_MB = 10.0
QUICK_BYTES = 200_000_000
"""Stored bytes that the quick check compares with their hashes, newest first: about a second of reading."""


@dataclass(frozen=True, slots=True)
class SettingInForce:
    """A setting, its value and where the value comes from."""

    name: str
    value: object
    unit: str
    source: str


def examine(
    start: Path, *, now: datetime, environ: Mapping[str, str], broker_config: Path | None = None
) -> tuple[Finding, ...]:
    """Check the machine and the project in or above `start`.

    Args:
        start: Folder to start from.
        now: The clock.
        environ: Environment variables, which override settings.
        broker_config: The broker's mosquitto.conf, to be checked too, also where there is no project.
    """
    findings = [*_machine(environ), *_project(start, now=now, environ=environ, broker_config=broker_config)]
    return (*findings, *(() if broker_config is None else _broker_config(broker_config)))


def settings_in_force(site: Site | None) -> tuple[SettingInForce, ...]:
    """Return every setting with the source of its value: "default", a line of vsd.toml, or an environment variable."""
    settings, sources = (site.settings, site.setting_sources) if site else (Settings(), {})
    return tuple(
        SettingInForce(s.name, settings.values[s.name], s.unit, sources.get(s.name, "default")) for s in SETTINGS
    )


def _machine(environ: Mapping[str, str]) -> Iterator[Finding]:
    yield Finding("vsd-analytics", "ok", f"{VERSION} on Python {platform.python_version()}")
    yield _platform(sys.platform)
    yield _packages(metadata.version)
    yield _browser(shutil.which, environ=environ)


def _packages(version_of: Callable[[str], str]) -> Finding:
    versions: dict[str, str] = {}
    for name in (*CORE_PACKAGES, *FIGURE_PACKAGES):
        with suppress(metadata.PackageNotFoundError):
            versions[name] = version_of(name)
    missing = [name for name in (*CORE_PACKAGES, *FIGURE_PACKAGES) if name not in versions]
    versions_text = ", ".join(f"{name} {version}" for name, version in versions.items())
    if tuple(missing) == FIGURE_PACKAGES:
        fix = "vsd-analytics with all its libraries where reports are made"
        return Finding("packages", "note", f"{versions_text}: the core, without figures, maps and pages", fix)
    if missing:
        fix = "install vsd-analytics again with pip"
        return Finding("packages", "needs you", f"missing: {', '.join(missing)}", fix)
    return Finding("packages", "ok", versions_text)


def _platform(name: str) -> Finding:
    if name in {"linux", "darwin"}:
        return Finding("platform", "ok", f"{platform.system()} {platform.machine()}")
    fix = "use Linux or macOS (on Windows: WSL, with the project inside its own file system)"
    return Finding("platform", "needs you", f"{name} is not supported: the store needs flock and folder fsync", fix)


def _browser(which: Callable[[str], str | None], *, environ: Mapping[str, str]) -> Finding:
    try:
        path = find_chromium(environ=environ, which=which)
    except VsdError as error:
        return Finding("browser", "needs you", error.what, error.fix)
    if path is None:
        return Finding(
            "browser", "note", "no Chromium or Chrome found: reports are made as HTML, JSON and CSV, not PDF"
        )
    return Finding("browser", "ok", path.name)


def _project(
    start: Path, *, now: datetime, environ: Mapping[str, str], broker_config: Path | None
) -> Iterator[Finding]:
    try:
        folder = find_project(start)
    except VsdError as error:
        if broker_config is None:
            yield Finding(FILE, "needs you", error.what, error.fix)
        else:  # the broker may be on a machine without a project
            yield Finding(FILE, "note", f"{error.what}: only the machine and the broker configuration are checked")
        return
    yield _file_system(folder)
    yield from _owners(folder)
    try:
        yield from _project_in(folder, now=now, environ=environ, broker_config=broker_config)
    except OSError as error:
        why, fix = denied(error, error.filename or folder)
        detail = f"{error.strerror or error}: {error.filename}; nothing after it was checked"
        yield Finding("files", "needs you", detail + (f": {why}" if why else ""), fix)


def _project_in(
    folder: Path, *, now: datetime, environ: Mapping[str, str], broker_config: Path | None
) -> Iterator[Finding]:
    try:
        site = load_site(folder, environ=environ)
    except ConfigError as error:
        for problem in error.problems:
            place = f"line {problem.where.line}: " if problem.where and problem.where.line else ""
            yield Finding(problem.where.file if problem.where else FILE, "needs you", place + problem.what, problem.fix)
        return
    yield Finding(FILE, "ok", f"site {site.site_id!r}: {len(site.floors)} floor(s), {len(site.cameras)} camera(s)")
    if site.node is None:
        yield _store(site)
    yield from _far_off(site)
    yield from examine_exchange(site, now=now)
    yield _disk(site)
    yield _pseudonyms(site)
    yield from _retention(site, now=now)
    yield from _watch(site)
    yield from _kept_files(site, now=now)
    yield from _mails(site)
    yield from _live(site, now=now, environ=environ, broker_config=broker_config)
    yield _plans(site)
    today = now.astimezone(site.zone).date()
    there = [c for c in site.cameras if c.end_day is None or c.end_day > today]
    for camera in there:
        yield _calibration(camera, now=now)
    yield from examine_counters(site, now=now)
    yield from _agreement(site)
    yield _pictures(there)
    yield _log(site)


def _agreement(site: Site) -> Iterator[Finding]:
    """Yield a finding for each thing stored that vsd.toml does not describe; damage is reported by other checks."""
    from vsd_analytics.warehouse.agreement import stored_disagreements

    with suppress(StoreError):
        for problem in stored_disagreements(site):
            yield Finding(FILE, "needs you", f"{problem.what}: {problem.why}", problem.fix or "")


def _file_system(folder: Path) -> Finding:
    kind = _kind_of_mount(folder.resolve(), Path("/proc/mounts"))
    if kind is not None and kind.startswith(NETWORK_FILE_SYSTEMS):
        return Finding(
            "file system", "needs you", f"{folder} is on a network file system ({kind})", "move it to a local disk"
        )
    return Finding("file system", "ok" if kind else "note", kind or "its kind is unknown here; it must be local")


def _kind_of_mount(folder: Path, mounts: Path) -> str | None:
    """Return the kind of file system a folder is on, from the longest mount point above it."""
    try:
        rows = [line.split() for line in mounts.read_text(encoding="utf-8", errors="replace").splitlines()]
    except OSError:
        return None
    above = [
        (len(row[1]), row[2]) for row in rows if len(row) > 2 and folder.is_relative_to(row[1].replace(r"\040", " "))
    ]
    return max(above)[1] if above else None


def _store(site: Site) -> Finding:
    days = sorted(
        {path.parent.name.removeprefix("date=") for path in (site.root / "store").glob("*/site=*/date=*/*.parquet")}
    )
    if not days:
        if (site.root / "sealed").is_dir():
            return Finding("store", "note", "no records, only the sealed figures of purged days")
        return Finding("store", "needs you", "nothing is stored yet", "vsd ingest FILES...")
    from vsd_analytics.store.store import Store
    from vsd_analytics.store.verify_files import all_parts, check_parts, newest_parts

    store = Store(site.root / "store", site_id=site.site_id)
    newest, n_all = newest_parts(store, n_bytes=QUICK_BYTES), len(all_parts(store))
    if damaged := [f.path for check in check_parts(newest)[:2] for f in check.damages]:
        names = ", ".join(str(path.relative_to(site.root)) for path in damaged[:3])
        detail = f"{len(damaged)} damaged file(s), whose bytes do not match the hash in their name: {names}"
        return Finding("store", "needs you", detail, "vsd verify says what to do about each; vsd explain E302")
    looked = f"; checked the newest {len(newest):,} of {n_all:,} files, vsd verify checks all"
    days_stored = f"{len(days)} UTC day(s), {days[0]} to {days[-1]}" + (looked if len(newest) < n_all else "")
    return Finding("store", "ok", days_stored)


def _far_off(site: Site) -> Iterator[Finding]:
    """Yield a finding for days with records more than a year from most others: a camera's clock may have been wrong."""
    from vsd_analytics.store.seals import FOLDER, Seals
    from vsd_analytics.store.store import Store
    from vsd_analytics.store.stretches import FAR_OFF_FIX, day_range, far_off

    sealed = Seals(site.root / FOLDER, site_id=site.site_id).days()
    if stretches := far_off({*Store(site.root / "store", site_id=site.site_id).days(), *sealed}):
        detail = f"records more than a year from the others: {', '.join(map(day_range, stretches[:5]))} (UTC)"
        yield Finding("instants", "needs you", detail, FAR_OFF_FIX)


def _owners(folder: Path) -> Iterator[Finding]:
    """Yield a finding where files are of another user than the folder: its own user cannot read what root made."""
    owner = folder.stat().st_uid
    near = chain(folder.iterdir(), folder.glob("*/*"))
    strange = sorted(path for path in near if path.lstat().st_uid != owner)
    if strange:
        names = ", ".join(str(path.relative_to(folder)) for path in strange[:3])
        are = "1 file belongs" if len(strange) == 1 else f"{len(strange)} files belong"
        detail = f"{are} to another user than the project: {names}{', ...' if len(strange) > 3 else ''}"
        fix = f"as root: chown -R {user_name(owner)}: {shlex.quote(str(folder.resolve()))}"
        yield Finding("owner", "needs you", detail, fix)


def _mails(site: Site) -> Iterator[Finding]:
    if site.mail is not None:
        from vsd_analytics.doctor.mails import examine_mails  # mail programs are loaded only where mail is sent

        yield from examine_mails(site)


def _watch(site: Site) -> Iterator[Finding]:
    from vsd_analytics.live.watch import read_watch_status

    status = read_watch_status(site.root)
    if status is None:
        return
    folder, error = status.get("folder"), status.get("error")
    counts = f"{status.get('done')} files ingested, {status.get('failed')} failed, {status.get('open')} open"
    if status["is_running"] and not error:
        yield Finding("watched folder", "ok", f"{folder}: {counts} since {status.get('started')}")
    elif status["is_running"]:
        fix = "fix it; the watch goes on by itself"
        yield Finding("watched folder", "needs you", f"{folder}: {error} ({counts})", fix)
    elif status.get("state") == "stopped":
        yield Finding("watched folder", "note", f"{folder} is not watched since {status.get('at')} ({counts})")
    else:
        died = f"the watch of {folder} died after {status.get('at')} ({counts})"
        yield Finding("watched folder", "needs you", died, f"vsd ingest --watch {folder}")


def _kept_files(site: Site, *, now: datetime) -> Iterator[Finding]:
    """Yield a finding for files that were read in a watched folder and outlive their records."""
    from vsd_analytics.ingest.intake.watched_folders import files_read_before

    days = int(site.settings.retention_days)
    kept = [path.parent for path in files_read_before(site.root, now - timedelta(days=days + 1))]
    if kept:
        places = ", ".join(map(str, dict.fromkeys(kept)))
        detail = f"{len(kept)} file(s) read more than {days} days ago are still in {places}"
        yield Finding("read files", "needs you", detail, "vsd purge --older-than retention")


def _live(site: Site, *, now: datetime, environ: Mapping[str, str], broker_config: Path | None) -> Iterator[Finding]:
    from vsd_analytics.live.status import FILE as HEARTBEAT

    has_sources = any(camera.source is not None for camera in site.cameras)
    if site.broker is None and not has_sources and not (site.root / HEARTBEAT).exists():
        return
    from vsd_analytics.doctor.broker import examine_live  # the MQTT client is loaded only where something listens

    yield from examine_live(site, now=now, environ=environ, has_config=broker_config is not None)


def _broker_config(path: Path) -> Iterator[Finding]:
    from vsd_analytics.doctor.broker import examine_config

    yield from examine_config(path)


def _disk(site: Site) -> Finding:
    """Check the free space and the ballast, which lets a full disk still fold the records it acknowledged."""
    from vsd_analytics.store import ballast

    free_mb = shutil.disk_usage(site.root).free / 1e6
    wanted_mb = float(site.settings.ballast_mb)
    held = "the ballast is in store/.ballast" if ballast.is_held(site.root / "store") else "no ballast yet"
    detail = f"{free_mb:,.0f} MB free, {held}" if wanted_mb else f"{free_mb:,.0f} MB free"
    if free_mb < max(wanted_mb, FREE_MIN_MB):
        return Finding("disk", "needs you", detail, "free some space soon: vsd explain E304")
    return Finding("disk", "ok", detail)


def _pseudonyms(site: Site) -> Finding:
    if site.settings.pseudonyms:
        return Finding("privacy", "ok", "track ids are replaced by keyed hashes")
    detail = "pseudonyms = false keeps the engine's track ids: only for published research recordings"
    return Finding(
        "privacy", "needs you", detail, "take pseudonyms = false out of [privacy] for a site with real visitors"
    )


def _retention(site: Site, *, now: datetime) -> Iterator[Finding]:
    """Yield a finding where raw records are older than the site's `retention_days`."""
    from vsd_analytics.store.layout import date_of_hour
    from vsd_analytics.store.store import Store

    limit_days = int(site.settings.retention_days)
    oldest = now.date() - timedelta(days=limit_days)
    days = [date_of_hour(day * 24) for day in sorted(Store(site.root / "store", site_id=site.site_id).days())]
    if n := sum(day < oldest for day in days):
        detail = f"records of {n} UTC day(s), since {days[0]}, are older than the {limit_days} days of retention_days"
        fix = "vsd purge --older-than retention --dry-run; or set retention_days in [privacy]"
        yield Finding("retention", "needs you", detail, fix)


def _plans(site: Site) -> Finding:
    without = [floor.floor_id for floor in site.floors if floor.plan is None]
    if not without:
        return Finding("floor plans", "ok", "every floor has one")
    return Finding(
        "floor plans", "note", f"none for {', '.join(without)}: maps are drawn over camera pictures or a plain grid"
    )


def _pictures(cameras: Sequence[Camera]) -> Finding:
    without = [c for c in cameras if c.picture is None]
    if not without:
        return Finding("camera pictures", "ok", "every camera has one")
    detail = f"none for {', '.join(c.camera_id for c in without)}"
    if blind := [c.camera_id for c in without if c.view is None and not (c.calibrations and c.picture_px)]:
        detail += f"; unknown without view or picture_px: what {', '.join(blind)} can see"
    return Finding("camera pictures", "note", detail)


def _calibration(camera: Camera, *, now: datetime) -> Finding:
    subject = f"calibration of {camera.camera_id}"
    if not camera.calibrations and camera.planes:
        n = len({plane.plane_id for plane in camera.planes})
        return Finding(subject, "ok", f"{n} {'plane' if n == 1 else 'planes'}, for vsd engine run")
    if not camera.calibrations:
        return Finding(subject, "note", "none: its engine must send floor metres (x_m, y_m) or distances")
    latest = camera.calibrations[-1]
    since = latest.valid_from
    if since is None and latest.source is not None:
        since = datetime.fromtimestamp(latest.source.stat().st_mtime, tz=UTC)
    days = (now - since).days if since else 0
    error = "" if latest.error_m is None else f", error {latest.error_m * 100:.0f} cm"
    if days > OLD_CALIBRATION_DAYS:
        fix = f"vsd calibrate {camera.camera_id}   and check that the grid still follows the floor"
        return Finding(subject, "needs you", f"{days} days old{error}", fix)
    return Finding(subject, "ok", f"{max(days, 0)} days old{error}")


def _log(site: Site) -> Finding:
    from vsd_analytics.config.change_log import read_log, torn_lines

    try:
        entries = read_log(site)
    except VsdError as error:
        return Finding("change log", "needs you", f"{error.what}: {error.why}", error.fix)
    for torn in torn_lines(site):
        return Finding("change log", "needs you", f"{torn.what}: {torn.why}", torn.fix)
    areas = {area.area_id for area in site.areas}
    lost = sorted({entry.area_id for entry in entries if entry.area_id is not None} - areas)
    if lost:
        fix = "give the area its old id in vsd.toml again, or correct log.jsonl"
        return Finding(
            "change log", "needs you", f"it names areas that are no longer described: {', '.join(lost)}", fix
        )
    return Finding("change log", "ok", f"{len(entries)} entries")
