"""The reference pages of `docs/` that are made from the code: settings, commands, relations.

`make docs` (`python docs/generate_reference.py docs`) writes them; a test holds the files equal to what this makes.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import click

    from vsd_analytics.settings import Setting
    from vsd_analytics.warehouse.sqlfiles import Relation

NOTE: Final = "<!-- Made by `make docs` from the code; edit there. -->"
_SECTIONS: Final = {
    "site": "Describes the site itself. Its other keys: [every key](keys.md).",
    "rule": "What counts as what.",
    "report": "What a report needs before it judges, and how it looks.",
    "analysis": "When hotspots and other findings are reported.",
    "ingest": "Which records are refused.",
    "alarms": "When alarms are sent. The other keys of this table: [alarms](alarms.md#where-alarms-go).",
    "staff": "Whom the figures count: [staff apart from visitors](space.md#staff-apart-from-visitors).",
    "privacy": "What is stored about people.",
}

_USUAL: Final = {
    "camera_id": "camera of `vsd.toml`",
    "floor_id": "floor of `vsd.toml`",
    "area_id": "area of `vsd.toml`",
    "local_date": "date in the site's zone",
    "local_hour": "0 to 23, in the site's zone",
}


def settings_markdown() -> str:
    """Return `docs/settings.md`: every setting with its default, unit, range and meaning."""
    from vsd_analytics.settings import SETTINGS

    parts = [
        "# Settings",
        NOTE,
        """\
Every default of the product. A value in `vsd.toml` wins over the default, and the environment variable `VSD_` + name in
capitals (`VSD_DISTANCE_M=1.83`) wins over both. `vsd doctor --show-config` prints what is in force and where it comes
from. A value outside its range is refused with its line, and a variable that is nearly the name of
a setting with that name.""",
        """\
Settings marked *facts* change what is computed from the store: after such a change the next command computes the facts
again. All other settings act at once. Values that differ from the default, and a hash of all of them, are printed at
the end of every report.""",
        """\
Editors that know TOML (Even Better TOML for VS Code, taplo, Zed, Helix) complete and check `vsd.toml` with its JSON
Schema: run `vsd schema config > vsd.schema.json` in the project folder, and again after an update, and make
`#:schema ./vsd.schema.json` the first line of `vsd.toml`. `vsd doctor` finds what takes a file or several keys to
judge.""",
    ]
    for section in dict.fromkeys(s.section for s in SETTINGS):
        rows = [_setting(s) for s in SETTINGS if s.section == section]
        parts += [
            f"## `[{section}]`",
            _SECTIONS[section],
            _table(("name", "default", "unit", "range", "meaning"), rows),
        ]
    return _page(parts)


def _setting(setting: Setting) -> tuple[str, ...]:
    form = ".10g" if setting.unit == "year" else ",.10g"
    range_ = "" if setting.minimum is None else f"{setting.minimum:{form}} to {setting.maximum:{form}}"
    meaning = setting.help + (" *facts*" if setting.is_fact else "")
    return f"`{setting.name}`", f"`{_toml(setting.default)}`", setting.unit, range_, meaning


def _toml(value: Any) -> str:
    """Return a value as `vsd.toml` writes it."""
    match value:
        case bool():
            return str(value).lower()
        case tuple():
            return "[" + ", ".join(_toml(v) for v in value) + "]"
        case str():
            return f'"{value}"'
        case float():
            return f"{value:.1f}" if value == int(value) else f"{value:g}"
        case _:
            return str(value)


def cli_markdown() -> str:
    """Return `docs/cli.md`: every command with its help, arguments, options and examples, from the program itself."""
    from vsd_analytics.cli import JOBS, cli

    commands = list(every_command())
    rows = {name: (f"[`{name}`](#{_anchor(name)})", _prose(c.help or "")[0].split("\n")[0]) for name, c in commands}
    jobs = list[str]()
    for title, names in JOBS.values():
        job_rows = [row for name, row in rows.items() if name.split()[1] in names]
        jobs += [f"**{title}**", _table(("command", "what it does"), job_rows)]
    parts = [
        "# Commands",
        NOTE,
        """\
Results go to standard output, messages to standard error. `--json` prints one object on everything that prints numbers,
also for errors. Weeks are ISO weeks (`2026-W46`, `last`, `last-2`); ranges are `2026-11-09..2026-11-15`; without
either, everything stored is meant.""",
        "Exit codes: **0** done, **1** done and something needs you, **2** could not run, **130** interrupted.",
        *jobs,
        "## Options of every command",
        "They come before the command: `vsd -C shop hours`.",
        _table(("option", "meaning"), _options(cli.params)),
    ]
    for name, command in commands:
        parts += [f"## {name}", *_prose(command.help or ""), f"```\n{_usage(name, command)}\n```"]
        options = _options(command.params)
        if options:
            parts.append(_table(("option", "meaning"), options))
    return _page(parts)


def every_command() -> Iterator[tuple[str, click.Command]]:
    """Yield every command by its whole name, in the order of the program's own list."""
    import click

    from vsd_analytics.cli import cli

    context = click.Context(cli, info_name="vsd")
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        if command is None:
            continue
        yield f"vsd {name}", command
        if isinstance(command, click.Group):
            for sub, inner in command.commands.items():
                yield f"vsd {name} {sub}", inner


def _prose(text: str) -> list[str]:
    """Return the paragraphs of a help text; what click must not wrap becomes a block of code."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        lines = paragraph.split("\n")
        if lines[0].strip() != "\b":
            parts.append(paragraph)
            continue
        title, *rest = lines[1:]
        parts += [title, "```\n" + inspect.cleandoc("\n".join(rest)) + "\n```"]
    return parts


def _usage(name: str, command: click.Command) -> str:
    import click

    pieces = command.collect_usage_pieces(click.Context(command, info_name=name))
    return " ".join([name, *pieces])


def _options(params: Sequence[click.Parameter]) -> list[tuple[str, str]]:
    import click

    rows = []
    for option in params:
        if not isinstance(option, click.Option) or option.hidden:
            continue
        value = ""
        if isinstance(option.type, click.Choice):
            value = " " + "|".join(str(c) for c in option.type.choices)
        elif not option.is_flag:
            value = f" {option.metavar or option.type.name.split()[0].upper()}"
        shown = option.show_default and option.default not in (None, False, ())
        default = f" Default: `{option.default}`." if shown else ""
        names = ", ".join([*option.opts, *option.secondary_opts])
        rows.append(
            (f"`{names}{value}`" if "\\|" not in value else f"`{names}`{value}", f"{option.help or ''}{default}")
        )
    return rows


def relations_markdown() -> str:
    """Return `docs/relations.md`: the tables for analysts and the stored tables, with units."""
    from vsd_analytics.api.computed_tables import COMPUTED_TABLES
    from vsd_analytics.schema import KEYS, SCHEMAS, TABLES
    from vsd_analytics.warehouse.sqlfiles import relations

    parts = [
        "# Relations",
        NOTE,
        """\
`week.hours` in Python, `week.sql("select ... from hours")`, and `vsd sql "select ... from hours"` answer from the same
tables. This page describes them. The facts and marts behind them: [internal relations](internal.md).""",
        "## Tables",
        """\
Made for analysts: each has exactly the local days asked for and a row for everything that could have one. Instants have
the site's zone. A count is null where it is unknown, never 0. What several cameras see is counted once. `state` says
how much of the time was recorded (full, partial, low_data, no_data, closed), and `is_in_rates` whether that is enough
for rates and averages. `vsd sql --show NAME` prints the query.""",
        """\
**An average per hour** is one over hours that enter rates: `select avg(n_violations_open) from area_hours where
area_id = 'checkout-queue' and is_in_rates`. Hours without a violation are rows with 0, so they count. Where a camera
was down for a part of the hours it is too low: `week.areas` has the rate of the report, by hours each camera recorded.

**The number of the weekly page** ("Counted", M8) leaves out camera-hours recorded to less than half: `select
sum(n_violations_open) from camera_hours where is_in_rates`. Without the condition the sum has all that was recorded.

**Violations at different distances do not compare.** An episode ends when two people part by more than the distance,
so a short distance cuts one meeting into several: a week of the demo has 11,401 violations at 1 m, 8,626 at 1.25 m,
9,043 at 1.5 m and 16,052 at 2 m. Compare `violation_s`, the time too close, which falls with the distance.

**A sum of nothing known.** SQL's `sum` is null, `Table.total` None, and the sum of a column of `.df()` `<NA>`, also by
group. The sum of polars is 0, and so is that of pandas after arithmetic on the column: ask `total`, or check
`is_not_null().any()`.""",
    ]
    computed = [(f"### {name}", f"{row} Computed in Python: `week.{name}`.") for name, row in COMPUTED_TABLES.items()]
    files = [tuple(_relation(r)) for r in relations("tables").values()]
    parts += [line for table in sorted([*files, *computed]) for line in table]
    parts += ["## Stored tables", "The Parquet files of `store/`, open to any program: see [storage](storage.md)."]
    for name in TABLES:
        rows = [(f"`{f.name}`", str(f.type), "may be null" if f.nullable else "") for f in SCHEMAS[name]]
        key = "A record is known by: " + ", ".join(f"`{k}`" for k in KEYS[name]) + "."
        parts += [f"### {name}", _table(("column", "type", ""), rows), key]
    return _page(parts)


def internal_markdown() -> str:
    """Return `docs/internal.md`: every fact, mart and staging relation, with its columns."""
    from vsd_analytics.warehouse.sqlfiles import relations

    parts = [
        "# Internal relations",
        NOTE,
        """\
Facts and marts of a range of local days, for questions that no table answers: `internal.NAME` in a query. They change
without notice, and most facts reach over the days asked for on both sides. A notebook's `warehouse.frame(...)` names
them bare. `vsd sql --show internal.NAME` prints the query. Times are UTC milliseconds since 1970 or, where the name
says so, local.""",
        """\
Settings reach SQL as the one-row relation `params`. `vsd.toml` reaches it as `cameras`, `areas`, `calibrations`,
`area_cells` (which floor cells lie in an area), `owner_cells` (which camera counts where the views of several overlap)
and `calendar` (UTC quarter-hours with local date, hour, weekday, and whether the site was open). `site_days` has the
site day of each quarter-hour, for the site days that touch the range; a site day starts at `day_starts`. These small
relations need no `internal.`.""",
    ]
    for layer, title, said in (
        (
            "marts",
            "Marts",
            "Small tables over the range of a query, one or more for each figure. Most are stored by day\n"
            "([storage](storage.md#promises)).",
        ),
        (
            "facts",
            "Facts",
            "Computed from the store hour by hour and stored in `facts/`, a file for each fact and UTC day. While the\n"
            "records are stored, facts can be computed again at any time.",
        ),
        (
            "staging",
            "Staging",
            "Steps between the store and the facts; they are in no file. A query can name\n"
            "`internal.located` and `internal.pairs`, which are computed from the records then; the others exist\n"
            "while facts are computed only.",
        ),
    ):
        found = relations(layer)
        parts += [f"## {title}", said]
        for relation in sorted(found.values(), key=lambda r: r.name):
            parts += _internal(relation)
    return _page(parts)


def figures_markdown() -> str:
    """Return the generated part of `docs/figures.md`: the figures, from the headers of the SQL files."""
    from vsd_analytics.warehouse.sqlfiles import figure_headers

    rows = [
        (
            f.metric,
            f"**{f.name}**" if f.metric in ("M0", "M7") else f.name,
            f.definition,
            f.unit,
            f.denominator,
            f.needs,
            f.uncertainty,
            f"[{f.relation.partition('/')[2]}](../sql/{f.relation}.sql)",
            _python(f.by),
        )
        for f in figure_headers()
    ]
    head = ("", "figure", "definition", "unit", "denominator", "needs at least", "uncertainty", "SQL", "Python")
    return _table(head, rows)


def exports_markdown() -> str:
    """Return the generated part of `docs/tools.md`: the tables of `vsd export --duckdb`, from the SQL files."""
    from vsd_analytics.report.pages.duckdb_file import column_text, exported_tables

    parts = []
    for relation in exported_tables():
        where = f"sql/{relation.layer}/{relation.name}.sql"
        known = f"One row is identified by {_listed(relation.grain)}. File: [{where}](../{where})."
        rows = [(f"`{c}`", column_text(relation, c)) for c in relation.columns]
        parts += [f"### {relation.name}", relation.description, known, _table(("column", "what it is"), rows)]
        parts.append(f"Assumes: {relation.assumes}.")
    return "\n\n".join(parts)


def _python(name: str) -> str:
    """Return a link to the file of a function or class, by its dotted name."""
    module, _, short = name.rpartition(".")
    path = module.replace(".", "/")
    where = f"{path}/__init__.py" if (Path(__file__).parent.parent / path).is_dir() else f"{path}.py"
    return f"[`{short}`](../{where})"


_DAYS = {
    "local_date": "week, of local dates",
    "site_day": "week, of site days",
    "utc_day": "UTC day again where an older version sealed it hour by hour",
}


def _identified(relation: Relation) -> str:
    """Return what a row is, what the query reads, its settings and its file."""
    where = f"sql/{relation.layer}/{relation.name}.sql"
    facts = [f"One row is identified by {_listed(relation.grain)}."]
    if relation.stored_by:
        facts.append(f"Stored by {_DAYS[relation.stored_by]}.")
    if relation.reads:
        facts.append(f"Reads {_listed(relation.reads)}.")
    if relation.params:
        facts.append(f"Settings: {_listed(relation.params)}.")
    if relation.figures:
        facts.append(f"Figures made from it: {', '.join(f.metric for f in relation.figures)} ([which](figures.md)).")
    return " ".join([*facts, f"File: [{where}](../{where})."])


def _internal(relation: Relation) -> list[str]:
    """Return the section of a relation, whose steps and assumptions are in its file alone."""
    file = f"sql/{relation.layer}/{relation.name}.sql"
    facts = [f"Key {_listed(relation.grain)}."]
    if relation.stored_by:
        facts.append(f"Stored by {_DAYS[relation.stored_by]}.")
    if relation.figures:
        facts.append(f"{', '.join(f.metric for f in relation.figures)}.")
    usual = [c for c, said in relation.columns.items() if not said]
    columns = [f"* `{c}`: {said}" for c, said in relation.columns.items() if said]
    if usual:
        columns.insert(0, f"* {_listed(usual)}")
    parts = [f"### internal.{relation.name}", f"{relation.description} {' '.join(facts)} [{file}](../{file})"]
    queried = relation.layer != "staging" or relation.name in ("located", "pairs")
    return [*parts, "\n".join(columns)] if queried else parts


def _relation(relation: Relation) -> list[str]:
    parts = [f"### {relation.name}", relation.description, _identified(relation)]
    rows = [(f"`{c}`", said or _USUAL.get(c, "")) for c, said in relation.columns.items()]
    parts.append(_table(("column", "what it is"), rows))
    if relation.steps:
        parts.append("\n".join(["How:", "", *(f"* `{step}`: {why}." for step, why in relation.steps.items())]))
    return [*parts, f"Assumes: {relation.assumes}."] if relation.assumes else parts


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{n}`" for n in names)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(c) for c in line) + " |" for line in lines)


def _cell(text: str) -> str:
    """Return text that neither ends a cell of a table nor breaks its line."""
    return text.replace("|", "\\|").replace("\n", " ")


def _anchor(heading: str) -> str:
    return re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-")


def _page(parts: Sequence[str]) -> str:
    return "\n\n".join(parts) + "\n"


PAGES: Final[Mapping[str, Callable[[], str]]] = {
    "settings.md": settings_markdown,
    "cli.md": cli_markdown,
    "relations.md": relations_markdown,
    "internal.md": internal_markdown,
}


PARTS: Final[Mapping[str, Callable[[], str]]] = {"figures.md": figures_markdown, "tools.md": exports_markdown}
"""Pages written by hand of which a part, between `PART_BEGINS` and `PART_ENDS`, is made from the code."""
PART_BEGINS: Final = "<!-- Made by `make docs` from the headers of the SQL files; edit there. -->"
PART_ENDS: Final = "<!-- Written by hand from here on. -->"


FORMATS_BEGINS: Final = "<!-- Made by `make docs` from the adapters and the headings below; edit there. -->"


def formats_markdown(page: str) -> str:
    """Return the list of formats in `docs/formats.md`: every adapter, with what it reads and what its positions are.

    Args:
        page: Text of the page, which has a heading `### NAME: WHAT` for each format.

    Raises:
        ValueError: The page says nothing of a format.
    """
    from vsd_analytics.ingest.formats.adapters import GENERAL, SPECIFIC, adapter

    headings = dict(re.findall(r"(?m)^### ([\w-]+): (.+)$", page))
    names = [name for name in (*SPECIFIC, *GENERAL) if name != "table"]  # it is positions or pairs
    if lacking := [name for name in names if name not in headings]:
        raise ValueError(f"docs/formats.md has no heading of {', '.join(lacking)}")
    rows = [
        (f"[`{name}`](#{_anchor(f'{name}: {headings[name]}')})", headings[name], adapter(name).coordinates)
        for name in names
    ]
    return _table(("`--format`", "what it reads", "positions"), rows)


def with_part(page: str, part: str, begins_with: str = PART_BEGINS) -> str:
    """Return a page with its generated part replaced.

    Raises:
        ValueError: The page lacks the lines that mark the part.
    """
    before, begins, rest = page.partition(begins_with)
    _, ends, after = rest.partition(PART_ENDS)
    if not (begins and ends):
        raise ValueError("the page lacks the marks of its generated part")
    return f"{before}{begins}\n\n{part}\n\n{ends}{after}"


def config_schema() -> str:
    """Return `vsd.schema.json` of the package: the JSON Schema of `vsd.toml`."""
    from vsd_analytics.config.schema import json_schema

    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


def write_schema() -> list[Path]:
    """Write the JSON Schema of `vsd.toml` into the package and return its path if it changed."""
    from vsd_analytics.config.schema import SCHEMA_FILE

    text = config_schema()
    if SCHEMA_FILE.exists() and SCHEMA_FILE.read_text(encoding="utf-8") == text:
        return []
    SCHEMA_FILE.write_text(text, encoding="utf-8")
    return [SCHEMA_FILE]


def write_pages(folder: Path) -> list[Path]:
    """Write all pages into `folder` and return those that changed; of `PARTS` only what is there already."""
    changed = []
    made = {name: make() for name, make in PAGES.items()}
    for name, make in PARTS.items():
        if (folder / name).exists():
            made[name] = with_part((folder / name).read_text(encoding="utf-8"), make())
    if (formats := folder / "formats.md").exists():
        text = formats.read_text(encoding="utf-8")
        made["formats.md"] = with_part(text, formats_markdown(text), FORMATS_BEGINS)
    for name, text in made.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            changed.append(path)
    return changed


if __name__ == "__main__":
    import sys

    for path in [*write_pages(Path(sys.argv[1] if len(sys.argv) > 1 else "docs")), *write_schema()]:
        print(f"wrote {path}")
