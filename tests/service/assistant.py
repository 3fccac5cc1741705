"""An assistant that asks the server of the Model Context Protocol by the client of its official library."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from mcp import Client

from vsd_analytics.cli.explain import explanations
from vsd_analytics.service.answers import TABLES, ReportAnswers
from vsd_analytics.service.mcp_server import mcp_server
from vsd_analytics.wording.manual import Manual

Call = tuple[str, dict[str, Any]]
T = TypeVar("T")


def ask(server: Any, calls: Sequence[Call]) -> list[tuple[bool, str]]:
    """Return, for each call of a tool, whether it was refused, and what was answered."""

    async def asked() -> list[tuple[bool, str]]:
        async with Client(server) as client:
            answers = [await client.call_tool(name, given) for name, given in calls]
            return [(bool(a.is_error), "\n".join(str(part.text) for part in a.content)) for a in answers]

    return in_own_loop(asked())


def in_own_loop(coroutine: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine in a thread of its own: a test of a browser may have left a running loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, coroutine).result()


def ask_everything(answers: ReportAnswers, *, week: str) -> str:
    """Return all that an assistant is told of a week of the first floor."""
    server = mcp_server(answers, manual=Manual(explanations()))
    of_week = {"week": week}
    calls: list[Call] = [("site", {}), ("verdicts", of_week), ("list_figures", of_week)]
    calls += [("table", {"name": name, **of_week}) for name in TABLES]
    (_, listed), *_ = ask(server, [("list_figures", of_week)])
    calls += [("figure", {"metric": metric, **of_week}) for metric in json.loads(listed)]
    return "\n".join(text for _, text in ask(server, calls))
