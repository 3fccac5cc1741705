"""Reads the docstrings' `Example:` as the section of examples that mkdocstrings draws as code."""

from __future__ import annotations

import re
from typing import Any

import griffe

_TITLE = re.compile(r"^Example:$", re.M)


class DocstringExamples(griffe.Extension):
    """Renames the section `Example:` while the reference is built; Griffe takes it for a remark otherwise."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring of a function, class or module that was read."""
        if obj.docstring is not None:
            obj.docstring.value = _TITLE.sub("Examples:", obj.docstring.value)
