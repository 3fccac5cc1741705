"""Facts of other settings than those of vsd.toml: beside the stored ones, never instead of them.

```
facts/beside/<id>/<fact>/...         facts that read a setting which has another value; all others are shared
facts/beside/<id>/weeks/<mart>/...   week files of marts
```

The id is a hash of the settings that differ. At most `MOST` sets of other settings are stored; the one that was longest
not in use gives way.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping
from pathlib import Path

from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.input_fingerprint import fact_inputs, text_hash
from vsd_analytics.warehouse.sqlfiles import relations

FOLDER = Path("facts", "beside")
MOST = 3
_ID = re.compile(r"^[0-9a-f]{16}$")


def folder(site: Site) -> Path | None:
    """Return the folder of the settings in force; None where they are those of vsd.toml."""
    if site.own_settings is None:
        return None
    own, used = params(site.with_own_settings()), params(site)
    other = {name: value for name, value in used.items() if value != own[name]}
    return site.root / FOLDER / text_hash(other) if other else None


def roots(site: Site) -> Mapping[str, Path]:
    """Return the folder that holds the files of each fact: that of other settings only where it reads one of them."""
    stored, other = site.root / "facts", folder(site)
    if other is None:
        return dict.fromkeys(relations("facts"), stored)
    own = site.with_own_settings()
    return {
        name: stored if fact_inputs(site, [name]).settings == fact_inputs(own, [name]).settings else other
        for name in relations("facts")
    }


def is_variant(root: Path) -> bool:
    """Return whether a folder of facts is that of other settings than those of vsd.toml."""
    return root.parent.name == FOLDER.name


def root_of_marts(site: Site) -> Path:
    """Return the folder that holds the files of marts of the settings in force."""
    return folder(site) or site.root / "facts"


def folders(site: Site) -> list[Path]:
    """Return the folders of all other settings that are stored, the one that was longest not in use first."""
    root = site.root / FOLDER
    paths = [p for p in root.iterdir() if _ID.match(p.name)] if root.is_dir() else []
    return sorted(paths, key=lambda p: (p.stat().st_mtime_ns, p.name))


def note_use(site: Site) -> None:
    """Note that the settings in force are in use now; a read-only disk costs nothing but the order of `folders`."""
    if (path := folder(site)) is not None:
        with contextlib.suppress(OSError):
            os.utime(path)


def surplus(site: Site) -> list[Path]:
    """Return the files of other settings beyond the `MOST` used last; those in force are never among them."""
    current = folder(site)
    others = [path for path in folders(site) if path != current]
    n_kept = MOST - (current is not None)
    return [path for other in others[: max(0, len(others) - n_kept)] for path in other.rglob("*.parquet")]
