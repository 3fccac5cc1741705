"""The index of `vsd site build` and the pages it links to, as files of one folder that are read and never made."""

from __future__ import annotations

import re
import stat
from html import unescape
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import unquote

from vsd_analytics.service.answers import NotFoundError
from vsd_analytics.site_index.collect_reports import MARK, hides_counts
from vsd_analytics.site_index.read_reports import shared_names

INDEX: Final = "index.html"
MEDIA_TYPES: Final = {".html": "text/html", ".pdf": "application/pdf", ".json": "application/json"}
HEAD_BYTES: Final = 8192
_LINK: Final = re.compile(r'href="([^"#:?]+)"')


class IndexFiles:
    """The files of one index.

    Nothing but what the index links to is read from its folder, and no page for the operator: whatever else lies
    there, nobody has published.

    Args:
        folder: Where `vsd site build` wrote the index.
        project: The project whose desk shows it: whether it hides small counts from readers.
    """

    def __init__(self, folder: Path, *, project: Path) -> None:
        self.folder, self._project = folder, project

    @property
    def is_there(self) -> bool:
        """Tell whether the folder has an index that this program wrote."""
        return self._page() is not None

    def read(self, name: str) -> tuple[bytes, str]:
        """Return a file and its media type.

        Args:
            name: Address relative to the index, such as `index.html` or `harbour/2026-W46.html`.

        Raises:
            NotFoundError: There is no index, or it does not link to this file, or the file is gone.
        """
        page = self._page()
        if page is not None and name == INDEX:
            return page, MEDIA_TYPES[".html"]
        linked = set() if page is None else {unquote(unescape(link)) for link in _LINK.findall(page.decode())}
        path = self.folder / name
        is_listed = name in linked and ".." not in PurePosixPath(name).parts and path.suffix in MEDIA_TYPES
        if not is_listed or path.name not in shared_names(path.parent, hides=hides_counts(self._project))[0]:
            raise NotFoundError(f"the index has no page {name!r}")
        return path.read_bytes(), MEDIA_TYPES[path.suffix]

    def _page(self) -> bytes | None:
        path = self.folder / INDEX
        if not path.is_file() or not stat.S_ISREG(path.lstat().st_mode):
            return None
        page = path.read_bytes()
        return page if MARK in page[:HEAD_BYTES] else None
