"""An assistant that asks the server of the Model Context Protocol by the client of its official library."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from typing import Any

from mcp import Client

from vsd_analytics.cli.explain import explanations
from vsd_analytics.service.answers import TABLES, ReportAnswers
from vsd_analytics.service.mcp_server import mcp_server

Call = tuple[str, dict[str, Any]]


def ask(server: Any, calls: Sequence[Call]) -> list[tuple[bool, str]]:
    """Return, for each call of a tool, whether it was refused, and what was answered."""

    async def asked() -> list[tuple[bool, str]]:
        async with Client(server) as client:
            answers = [await client.call_tool(name, given) for name, given in calls]
            return [(bool(a.is_error), "\n".join(str(part.text) for part in a.content)) for a in answers]

    return asyncio.run(asked())


def ask_everything(answers: ReportAnswers, *, week: str) -> str:
    """Return all that an assistant is told of a week of the first floor."""
    server = mcp_server(answers, explanations=explanations())
    of_week = {"week": week}
    calls: list[Call] = [("site", {}), ("verdicts", of_week), ("list_figures", of_week)]
    calls += [("table", {"name": name, **of_week}) for name in TABLES]
    (_, listed), *_ = ask(server, [("list_figures", of_week)])
    calls += [("figure", {"metric": metric, **of_week}) for metric in json.loads(listed)]
    return "\n".join(text for _, text in ask(server, calls))
