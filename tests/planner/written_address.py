"""The address that the planner's page has after a change."""

from __future__ import annotations

from typing import Any


def written_address(page: Any) -> str:
    """Return the address of a page when it has written it, 150 ms after the last change.

    A timer of the page itself waits for it: those of one page end in order, however busy the machine is.
    """
    return str(page.evaluate("new Promise(done => setTimeout(() => done(location.href), 250))"))
