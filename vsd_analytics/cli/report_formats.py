"""The files of a report: which formats were asked for, and the bytes of each, all from one model."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.output import emit_json, render_error
from vsd_analytics.errors import ReportError, UsageError

if TYPE_CHECKING:
    from vsd_analytics.report.model.week import WeekReport
    from vsd_analytics.report.pages.pdf import Paper
    from vsd_analytics.site.model import Site

FORMATS = ("html", "pdf", "json", "csv", "svg", "png")
ALL = ("html", "pdf", "json", "csv")
FIGURES = ("where", "when", "changed", "weeks", "data")
FIGURE_FORMATS = {"svg", "png"}


class Formats(click.ParamType[Any]):
    """One or more formats, with commas between; `all` is every one that holds the whole week."""

    name = "formats"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:
        """Return the formats, each once, in the order given."""
        if isinstance(value, tuple):
            return value
        asked = [word.strip() for word in str(value).split(",")]
        for word in asked:
            if word not in (*FORMATS, "all"):
                self.fail(f"{word!r} is not one of {', '.join(FORMATS)}, all", param, ctx)
        return tuple(dict.fromkeys(asked))


def expanded(kinds: tuple[str, ...], files: ReportFiles) -> tuple[str, ...]:
    """Return the formats with `all` spelled out: without the PDF, and a word about it, where there is no browser."""
    if "all" not in kinds:
        return kinds
    each = dict.fromkeys(k for kind in kinds for k in (ALL if kind == "all" else (kind,)))
    if "pdf" not in kinds and files.chromium is None:
        from vsd_analytics.report.pages.pdf import no_chromium

        click.echo(render_error(no_chromium(), word="warning"), err=True)
        del each["pdf"]
    return tuple(each)


@dataclass
class ReportFiles:
    """The files of one report; each is made at most once.

    Attributes:
        report: The finished week.
        site: Its project, for the browser it names.
        is_only: True when the site has one floor, so that names need not include it.
        figure: Figure of `svg` and `png`.
        paper: Of the PDF.
    """

    report: WeekReport
    site: Site
    is_only: bool
    figure: str | None = None
    paper: Paper = "a4"
    _made: dict[str, dict[str, bytes]] = field(default_factory=dict)

    @property
    def stem(self) -> str:
        """Return what the names of all files begin with."""
        return self.report.week.iso if self.is_only else f"{self.report.week.iso}-{self.report.site.floor_id}"

    def of(self, kind: str) -> dict[str, bytes]:
        """Return the files of a format by name.

        Raises:
            ReportError: E520, E521, no PDF; E522, the week has nothing to draw in the figure.
        """
        if kind not in self._made:
            self._made[kind] = self._make(kind)
        return self._made[kind]

    @cached_property
    def chromium(self) -> Path | None:
        """Return the browser that prints; None when there is none."""
        from vsd_analytics.report.pages.pdf import find_chromium

        return find_chromium(environ=os.environ, configured=self.site.chromium)

    def _make(self, kind: str) -> dict[str, bytes]:
        from vsd_analytics.report.pages.json_and_csv import to_csv, to_json
        from vsd_analytics.report.pages.week import render_html

        match kind:
            case "html":
                return {f"{self.stem}.html": render_html(self.report).encode()}
            case "json":
                return {f"{self.stem}.json": to_json(self.report)}
            case "csv":
                return {f"{self.stem}-{name}": text.encode() for name, text in to_csv(self.report).items()}
            case "pdf":
                return {f"{self.stem}.pdf": self._pdf()}
            case _:
                return {f"{self.stem}-{self.figure}.{kind}": self._figure(kind)}

    def _pdf(self) -> bytes:
        from vsd_analytics.report.pages.pdf import no_chromium, print_pdf
        from vsd_analytics.report.pages.week import render_html

        if self.chromium is None:
            raise no_chromium()
        html = render_html(self.report, paper=self.paper)
        return print_pdf(html, chromium=self.chromium, made_at=self.report.generated_at)

    def _figure(self, kind: str) -> bytes:
        from vsd_analytics.report.pages.single_figures import figure_svg, to_png

        if self.figure is None:
            raise UsageError(f"which figure as {kind}?", fix=f"--figure {'|'.join(FIGURES)}")
        svg = figure_svg(self.report, self.figure)
        return svg.encode() if kind == "svg" else to_png(svg)


def checked(kinds: tuple[str, ...], *, figure: str | None, files: ReportFiles, is_mailed: bool) -> None:
    """Refuse what cannot be written before anything is; a mail goes out all the same when only the PDF is missing.

    Raises:
        UsageError: E101, a figure without its format, or the other way round.
        ReportError: E520, PDF without a browser.
    """
    from vsd_analytics.report.pages.pdf import no_chromium

    drawn = FIGURE_FORMATS & set(kinds)
    if drawn and figure is None:
        raise UsageError(f"which figure as {min(drawn)}?", fix=f"--figure {'|'.join(FIGURES)}")
    if figure is not None and not drawn:
        raise UsageError("a single figure is svg or png", fix=f"--figure {figure} --format svg")
    if "pdf" in kinds and files.chromium is None and not is_mailed:
        raise no_chromium()


def write(folder: Path, files: dict[str, bytes]) -> list[Path]:
    """Put files into a folder, each wholly or not at all, and return their paths."""
    from vsd_analytics.store.durable import publish, sweep_pages

    for name, data in files.items():
        publish(folder / name, data, is_synced=False)
    sweep_pages(folder)
    return [folder / name for name in files]


def print_one(reports: list[ReportFiles], kinds: tuple[str, ...]) -> None:
    """Write the one file that was asked for to standard output.

    Raises:
        UsageError: E101, they are several.
    """
    import json

    if len(kinds) > 1:
        raise UsageError("several formats are several files", fix="--out reports/")
    [kind] = kinds
    if kind == "csv":
        raise UsageError("csv is several files", fix="--out reports/")
    if len(reports) == 1:
        [data] = reports[0].of(kind).values()
        click.echo(data, nl=False)
    elif kind == "json":
        emit_json({"reports": [json.loads(next(iter(r.of("json").values()))) for r in reports]})
    else:
        raise UsageError("there is one file for each floor", fix="--floor FLOOR --out -")


def pdf_or_none(files: ReportFiles) -> tuple[str, bytes] | ReportError:
    """Return the PDF with its name, or why there is none."""
    try:
        [(name, data)] = files.of("pdf").items()
    except ReportError as error:
        return error
    return name, data
