"""The templates of pages and mails, compiled once for all processes, as Python compiles modules."""

from __future__ import annotations

import contextlib
import sys
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.bccache import Bucket, FileSystemBytecodeCache

from vsd_analytics.resources import shipped
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say, say_html
from vsd_analytics.wording.languages import html_tag
from vsd_analytics.wording.reasons import reason_text


class CompiledTemplates(FileSystemBytecodeCache):
    """Compiled templates in `__pycache__` beside their sources; where that cannot be written, each process compiles.

    Jinja compiles a template again when its text has changed. The options of `environment` are compiled in, too: hence
    the version in the names.
    """

    def __init__(self, templates: Path) -> None:
        super().__init__(str(templates / "__pycache__"), f"%s-{VERSION}.jinja")

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Write one compiled template, unless Python was asked to write none or the folder refuses it."""
        if sys.dont_write_bytecode:
            return
        with contextlib.suppress(OSError):
            Path(self.directory).mkdir(exist_ok=True)
            super().dump_bytecode(bucket)


@cache
def environment() -> Environment:
    """Return the templates, with the filters of `format`; an undefined name is an error, text of HTML is escaped."""
    folder = shipped("reports") / "templates"
    templates = Environment(
        loader=FileSystemLoader(folder),
        bytecode_cache=CompiledTemplates(folder),
        undefined=StrictUndefined,
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    templates.filters.update(fmt.FILTERS, reason=reason_text, wrap=fmt.plain_lines)
    templates.globals.update(say=say, say_html=say_html, html_tag=html_tag)
    return templates
