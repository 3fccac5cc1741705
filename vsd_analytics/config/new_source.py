"""Appending a `[[source]]` to `vsd.toml`; what is written there already stays as it is."""

from __future__ import annotations

import re
from pathlib import Path

from vsd_analytics.config.project import FILE, site_of
from vsd_analytics.config.reader import ID_PATTERN, suggest_id
from vsd_analytics.config.reading_rules import NewReadingRule
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.errors import UsageError
from vsd_analytics.site.model import Site


def refuse_name(site: Site, name: str) -> None:
    """Raise UsageError (E101) when a profile cannot have this id, or one has it already."""
    if not re.fullmatch(ID_PATTERN, name):
        raise UsageError(
            f"--save {name!r} cannot be the id of a source",
            why="ids are of a-z, 0-9, - and _, at most 63, first a letter or digit",
            fix=f"--save {suggest_id(name)}",
        )
    if any(profile.rule_id == name for profile in site.sources):
        raise UsageError(
            f"--save {name}: {FILE} has a [[source]] of this id already",
            why="a profile is never replaced by a command",
            fix="choose another name, or change the one in the file",
        )


def save_source(site: Site, profile: NewReadingRule) -> str:
    """Append a profile to `vsd.toml`, in one step, and return its lines.

    Comments, layout and line ends of the file stay. The file is read again before it is written, so a profile that
    cannot be read is never saved.

    Raises:
        UsageError: E101, the id cannot be used.
        ConfigError: E103, the profile, or what somebody wrote into the file meanwhile, has a mistake.
        DiskError: E304 to E306, the disk refused.
    """
    refuse_name(site, profile.rule_id)
    path = (site.root / FILE).resolve()
    before = path.read_bytes()
    newline = b"\r\n" if b"\r\n" in before else b"\n"
    gap = b"" if before.endswith(b"\n") else newline
    lines = profile.text()
    after = before + gap + newline + lines.encode().replace(b"\n", newline)
    site_of(TomlText(FILE, after.decode("utf-8-sig").replace("\r\n", "\n")), folder=site.root)
    _replace(path, after)
    return lines


def _replace(path: Path, data: bytes) -> None:
    from vsd_analytics.store.durable import publish

    mode = path.stat().st_mode & 0o777
    publish(path, data)
    path.chmod(mode)
