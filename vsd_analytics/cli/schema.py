"""`vsd schema`: the published formats as JSON."""

from __future__ import annotations

import json
from typing import Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json

SCHEMAS = ("frame", "report", "tables", "config")


@click.command()
@click.argument("what", type=click.Choice(SCHEMAS))
@json_option
def schema(what: str, as_json: bool) -> None:
    """Print a format as JSON: the frame message, the report's JSON file, the stored tables, vsd.toml.

    frame, report and config are JSON Schemas; editors complete vsd.toml by that of config.

    \b
    Example:
      vsd schema frame > frame.schema.json
      vsd schema tables
      vsd schema config > vsd.schema.json
    """
    emit = emit_json if as_json else _emit_indented
    emit(_schema(what))


def _schema(what: str) -> dict[str, Any]:
    if what == "frame":
        from vsd_analytics.ingest.formats import frames

        return frames.json_schema()
    if what == "report":
        from vsd_analytics.report.pages import json_and_csv

        return json_and_csv.json_schema()
    if what == "config":
        from vsd_analytics.config.schema import SCHEMA_FILE

        schema: dict[str, Any] = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
        return schema
    from vsd_analytics.schema import KEYS, SCHEMAS

    return {
        name: {
            "columns": [{"name": f.name, "type": str(f.type), "nullable": f.nullable} for f in table],
            "key": list(KEYS[name]),
        }
        for name, table in SCHEMAS.items()
    }


def _emit_indented(value: dict[str, Any]) -> None:
    click.echo(json.dumps(value, indent=2, ensure_ascii=False))
