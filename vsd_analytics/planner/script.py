"""The script of the planner's page and the sentences it says."""

from __future__ import annotations

import re
from functools import cache
from typing import Final

from vsd_analytics.report import wording
from vsd_analytics.resources import shipped

SCRIPTS: Final = ("planner_rates.js", "planner_map.js", "planner_data.js", "planner.js", "planner_start.js")
SAID: Final = "planner.script."
"""Sentences of the catalogue that the script says are those below this and these."""
SAID_TOO: Final = (
    *("format.tiny", "format.same", "format.fewer", "format.more", "format.no_change", "format.likely"),
    *("format.likely_fewer", "format.likely_more", "format.likely_between", "format.hours", "format.under_an_hour"),
    *("words.clear_fall", "words.clear_rise", "words.no_clear_change", "words.too_little_data"),
)


def sentences() -> dict[str, str | dict[str, str]]:
    """Return the sentences the script says, with their places unfilled."""
    found: dict[str, str | dict[str, str]] = {}
    for key, entry in wording.catalogue().items():
        if key.startswith(SAID) or key in SAID_TOO:
            forms = (
                wording.template(key)
                if isinstance(entry, str)
                else {form: wording.template(key, plural=n) for form, n in (("one", 1), ("other", 2))}
            )
            found[key.removeprefix(SAID)] = forms
    return found


@cache
def script() -> str:
    """Return the page's only script: the shipped files one after the other in one scope, without comments' lines."""
    folder = shipped("reports") / "static"
    text = "".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)
    text = re.sub(r"^\s*/\*.*?\*/\s*$", "", text, flags=re.DOTALL | re.MULTILINE)
    lines = "".join(f"{line.strip()}\n" for line in text.splitlines() if line.strip())
    return f"(() => {{\n'use strict';\n{lines}}})();\n"
