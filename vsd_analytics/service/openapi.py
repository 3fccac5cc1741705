"""The OpenAPI document of the service, made from its table of addresses and the schema of the report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from vsd_analytics.report.pages.json_and_csv import json_schema
from vsd_analytics.service.answers import TABLES
from vsd_analytics.service.now_page import now_policy
from vsd_analytics.version import VERSION

_TEXT = {"type": "string"}
PARAMETERS: Final[dict[str, dict[str, Any]]] = {
    "week": {
        "description": "ISO week, or last, or last-N for the week N weeks before.",
        "schema": {"type": "string", "pattern": r"^(\d{4}-W\d{2}|last(-\d{1,4})?)$"},
        "example": "last",
    },
    "floor_id": {"description": "Floor of vsd.toml.", "schema": {"type": "string", "pattern": "^[a-z0-9][a-z0-9_-]*$"}},
    "metric": {
        "description": "Id of a figure in the catalogue.",
        "schema": {"type": "string", "pattern": r"^M\d{1,2}$"},
        "example": "M0",
    },
    "table": {"description": "Table of the report.", "schema": {"type": "string", "enum": list(TABLES)}},
}


@dataclass(frozen=True, slots=True)
class Address:
    """One address of the service.

    Attributes:
        path: Its path with parameters in braces.
        name: The method of `ReportAnswers` that answers, and the operation's id.
        summary: What it answers.
        media_type: Type of the answer.
        schema: JSON Schema of a JSON answer.
        policy: Content security policy of a page that asks for more than the others may; None = theirs.
    """

    path: str
    name: str
    summary: str
    media_type: str = "application/json"
    schema: dict[str, Any] = field(default_factory=lambda: {"type": "object"})
    policy: str | None = None


_WEEK: Final = "/v1/weeks/{week}/floors/{floor_id}"
ADDRESSES: Final[Sequence[Address]] = (
    Address("/v1/site", "site", "The site, its floors, cameras and areas, and the stored weeks."),
    Address(
        f"{_WEEK}/report", "report", "The whole report as JSON.", schema={"$ref": "#/components/schemas/WeekReport"}
    ),
    Address(
        f"{_WEEK}/figures",
        "figures",
        "All figures by catalogue id.",
        schema={
            "type": "object",
            "required": ["figures"],
            "properties": {
                "figures": {"type": "object", "additionalProperties": {"$ref": "#/components/schemas/Figure"}}
            },
        },
    ),
    Address(f"{_WEEK}/figures/{{metric}}", "figure", "One figure.", schema={"$ref": "#/components/schemas/Figure"}),
    Address(f"{_WEEK}/tables/{{table}}.csv", "table", "A table as CSV.", "text/csv", _TEXT),
    Address(f"{_WEEK}/page", "page", "The page of the week.", "text/html", _TEXT),
    Address(f"{_WEEK}/planner", "planner", "The interactive page of the week.", "text/html", _TEXT),
    Address("/now", "now", "The live page of the first floor.", "text/html", _TEXT, now_policy()),
    Address("/now/{floor_id}", "floor_now", "The live page of a floor.", "text/html", _TEXT, now_policy()),
)
_PROBLEMS: Final = {
    "400": "The request cannot be read.",
    "401": "No token, or a wrong one.",
    "404": "There is no such week, floor, figure or table.",
    "429": "Too many requests; `Retry-After` says when to ask again.",
    "500": "The answer could not be made.",
    "503": "Nothing is stored yet, or the project cannot be read.",
}


def document(*, title: str) -> dict[str, Any]:
    """Return the OpenAPI 3.1 document.

    Args:
        title: Name of the site.
    """
    report = json_schema()
    schemas = json.loads(json.dumps(report["$defs"]).replace("#/$defs/", "#/components/schemas/"))
    schemas["Problem"] = {
        "type": "object",
        "required": ["type", "title", "status"],
        "properties": {
            "type": _TEXT,
            "title": {"type": "string", "description": "What could not be done."},
            "status": {"type": "integer"},
            "detail": {"type": ["string", "null"], "description": "Why."},
            "fix": {"type": ["string", "null"], "description": "What to do."},
            "code": {"type": "string", "description": "What `vsd explain` explains."},
        },
    }
    return {
        "openapi": "3.1.0",
        "info": {
            "title": f"{title}: weekly reports of social distancing",
            "version": VERSION,
            "description": "Read-only. The numbers of `vsd report --format json`; small counts are hidden.",
        },
        "security": [{"bearer": []}, {"basic": []}],
        "paths": {a.path: {"get": _operation(a)} for a in ADDRESSES},
        "components": {
            "schemas": schemas,
            "securitySchemes": {
                "bearer": {"type": "http", "scheme": "bearer"},
                "basic": {"type": "http", "scheme": "basic", "description": "Any user; the token is the password."},
            },
        },
    }


def _operation(address: Address) -> dict[str, Any]:
    problem = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    responses: dict[str, Any] = {
        "200": {
            "description": address.summary,
            "headers": {
                "ETag": {"schema": _TEXT, "description": "Send it as If-None-Match to ask whether it changed."}
            },
            "content": {address.media_type: {"schema": address.schema}},
        },
        "304": {"description": "It did not change."},
    }
    responses |= {status: {"description": text, "content": problem} for status, text in _PROBLEMS.items()}
    names = [name for name in PARAMETERS if f"{{{name}}}" in address.path]
    parameters = [{"name": n, "in": "path", "required": True, **PARAMETERS[n]} for n in names]
    return {"operationId": address.name, "summary": address.summary, "parameters": parameters, "responses": responses}
