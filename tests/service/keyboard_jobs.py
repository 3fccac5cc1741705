"""The jobs of a manager in a browser at the desk, with the keyboard alone: what they take."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from service.desk_site import DESK_TOKEN

NAME = """(e => e.type === 'radio' ? e.value
  : e.labels && e.labels.length ? (e.labels[0].querySelector('span') || e.labels[0]).textContent.trim()
  : e.textContent.trim()
)(document.activeElement)"""
"""What a screen reader calls the element that has the focus."""
PATIENCE_MS = 120_000
"""For a page that is made for the first time."""
FURTHEST = 250
"""Elements of a page that Tab may pass."""


@dataclass
class Taken:
    """What a job took.

    Attributes:
        presses: Buttons and links.
        keys: All keys, those among them.
        seconds: From the first key until the page says that it is done.
    """

    presses: int = 0
    keys: int = 0
    seconds: float = 0.0


class Keyboard:
    """Somebody at a page, who has no mouse.

    Args:
        page: The page.
    """

    def __init__(self, page: Any) -> None:
        self.page = page
        self.taken: dict[str, Taken] = {}
        self._now = Taken()

    @contextmanager
    def job(self, name: str) -> Iterator[None]:
        """Count what is done inside for a job."""
        self._now = self.taken.setdefault(name, Taken())
        begun = time.monotonic()
        yield
        self._now.seconds += time.monotonic() - begun

    def key(self, name: str) -> None:
        self._now.keys += 1
        self.page.keyboard.press(name)

    def reach(self, name: str) -> None:
        """Press Tab until the element with a name has the focus."""
        for _ in range(FURTHEST):
            if self.page.evaluate(NAME) == name:
                return
            self.key("Tab")
        raise AssertionError(f"{name!r} is not reached with the keyboard")

    def type(self, text: str) -> None:
        self._now.keys += len(text)
        self.page.keyboard.type(text)

    def press(self, name: str, *, is_link: bool = True) -> str:
        """Press what has a name; return what the page says then."""
        self.reach(name)
        self._now.presses += 1
        if not is_link:
            self.key("Enter")
            return ""
        with self.page.expect_navigation():
            self.key("Enter")
        said = self.page.locator("main > p.said[role=status]")
        return str(said.text_content()) if said.count() else ""


def sign_in(keyboard: Keyboard) -> None:
    with keyboard.job("sign in, once in twelve hours"):
        keyboard.reach("Your name")
        keyboard.type("Anna")
        keyboard.reach("Token of the desk")
        keyboard.type(DESK_TOKEN)
        with keyboard.page.expect_navigation():
            keyboard.key("Enter")


def do_jobs(page: Any, address: str, check: Callable[[str], None] = lambda _: None) -> Mapping[str, Taken]:
    """Do all jobs at the desk of the demo, and return what each took.

    Args:
        page: A page that may use the clipboard.
        address: Where the desk is.
        check: Is called after each job, with its name, while its page is shown.
    """
    page.set_default_timeout(PATIENCE_MS)
    keyboard = Keyboard(page)
    page.goto(f"{address}/desk")
    sign_in(keyboard)
    for made in ("weeks/last/floors/ground/page", "weeks/last/floors/ground/planner", "now/ground"):
        page.goto(f"{address}/desk/{made}")
    page.goto(f"{address}/desk")
    with keyboard.job("see it now"):
        keyboard.press("Now")
    check("see it now")
    page.goto(f"{address}/desk")
    with keyboard.job("open the planner"):
        keyboard.press("Planner")
        page.wait_for_function("document.getElementById('side-name').textContent !== ''")
    check("open the planner")
    with keyboard.job("read the rate of an area, in the planner"):
        keyboard.reach("Rates of")
        keyboard.type("Main")
        page.wait_for_function("document.getElementById('side-name').textContent === 'Main entrance'")
    check("read the rate of an area, in the planner")
    with keyboard.job("share a view, from the planner"):
        keyboard.press("Copy link", is_link=False)
        page.wait_for_function("navigator.clipboard.readText().then(text => text.includes('entrance'))")
    check("share a view, from the planner")
    page.goto(f"{address}/desk")
    with keyboard.job("open the weekly page"):
        keyboard.press("Weekly page")
    check("open the weekly page")
    with keyboard.job("answer the question, from the weekly page"):
        keyboard.press("Not possible")
        assert keyboard.press("Save the answer").startswith("Saved.")
    with keyboard.job("log a change"):
        keyboard.reach("What was changed")
        keyboard.type("Mat moved")
        keyboard.reach("Where")
        keyboard.key("ArrowDown")
        assert keyboard.press("Log the change") == "The change is in the log."
    with keyboard.job("take it back"):
        assert keyboard.press("Take back: Mat moved") == "Taken back."
    with keyboard.job("set a target"):
        keyboard.reach("Stay below, violations per open hour")
        keyboard.type("120")
        assert keyboard.press("Save the target").startswith("The target is saved.")
    with keyboard.job("change the opening hours"):
        keyboard.press("Change the opening hours", is_link=False)
        keyboard.reach("Sunday")
        keyboard.type("11:00-18:00")
        assert keyboard.press("Save the hours").startswith("The opening hours are saved.")
    with keyboard.job("mark an area"):
        keyboard.press("Areas and fixtures")
        keyboard.reach("Name")
        keyboard.type("Promotion")
        keyboard.reach("Corners, in metres")
        keyboard.type("8,6 9,6 9,7 8,7")
        assert keyboard.press("Save the place").startswith("The place is saved.")
    check("mark an area")
    page.goto(f"{address}/desk")
    with keyboard.job("compare sites"):
        keyboard.press("All sites and weeks")
    check("compare sites")
    return keyboard.taken
