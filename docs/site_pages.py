"""What MkDocs changes in the pages of the documentation: links to files that the site lacks, ranks in its search."""

from __future__ import annotations

import posixpath
import re
from typing import Any, Final

PROOF_RANK: Final = 0.2
"""Weight of the pages of `docs/methods` in the site's search: who looks for "opening hours" wants to set them."""

_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((\.\./[^)\s]*)\)")


def on_page_markdown(markdown: str, *, page: Any, **_: Any) -> str:
    """Return a page whose links out of `docs/` name the file instead; rank it. MkDocs calls this for each page."""
    folder = posixpath.dirname(page.file.src_uri)
    if folder == "methods":
        page.meta["search"] = {"boost": PROOF_RANK}

    def named(found: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join("docs", folder, found[2]))
        return found[1] if found[1].strip("`") == path else f"{found[1]} (`{path}`)"

    return _LINK.sub(named, markdown)
