"""The questions that weekly reports asked, one JSON object a line in `questions.jsonl`.

A report must know what earlier weeks asked, and only a report that was made asked anything. So `vsd report` stores the
question of each page. A page reads those of earlier weeks only: an old week made again gives the same page, whatever
was asked after it. A week made again with another question adds a line; the last one of a week counts.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Sequence
from datetime import date
from pathlib import Path
from typing import Any, Final

from vsd_analytics.errors import InputError, UsageError, Where, nearest
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AskedQuestion

FILE: Final = "questions.jsonl"
LOCK: Final = Path("status") / "questions.lock"

_TEXTS: Final = {"floor": "floor_id", "id": "question_id", "place": "place", "remedy": "remedy", "text": "text"}
_BEGIN: Final = b'{"week": "'
"""What every line begins with."""


def read_asked(site: Site) -> tuple[AskedQuestion, ...]:
    """Return the question of each floor and week, by week; of a week that was made twice, the last.

    Raises:
        InputError: A line is no question (E110).
    """
    last = {(one.monday, one.floor_id): one for one in _all(site)}
    return tuple(last[key] for key in sorted(last))


def asked_question(site: Site, question_id: str) -> AskedQuestion:
    """Return the question with an id, the latest where two years had the same; UsageError E101 when there is none."""
    every = list(_all(site))
    questions = [one for one in every if one.question_id.casefold() == question_id.strip().casefold()]
    if questions:
        return max(questions, key=lambda one: one.monday)
    known = list(dict.fromkeys(one.question_id for one in sorted(every, key=lambda one: one.monday, reverse=True)))
    close = nearest(question_id, known)
    raise UsageError(
        f"no report asked a question with the id {question_id!r}",
        why=f"the last ones are: {', '.join(known[:5])}" if known else "no report was made yet: vsd report asks them",
        fix=f"vsd log answer {close or (known[0] if known else 'ID')} tried",
    )


def remember(site: Site, asked: Sequence[AskedQuestion]) -> int:
    """Store the questions of reports, durably, and return how many are new; what is stored already is not again.

    Raises:
        InputError: A line is no question (E110).
        DiskError: E304 to E306, the disk refused; the file is as before.
    """
    from vsd_analytics.store.durable import exclusive, publish

    known = set(read_asked(site))
    if all(one in known for one in asked):
        return 0
    path = (site.root / FILE).resolve()
    with exclusive(site.root / LOCK):
        known = set(read_asked(site))
        new = [one for one in asked if one not in known]
        lines = [line for line in _lines(site) if not _is_torn(line)]
        lines += [json.dumps(_line(one), ensure_ascii=False).encode() for one in new]
        publish(path, b"".join(line + b"\n" for line in lines))
    return len(new)


def _all(site: Site) -> Iterable[AskedQuestion]:
    for number, line in enumerate(_lines(site), 1):
        if not _is_torn(line):
            yield _asked(line, number)


def _lines(site: Site) -> list[bytes]:
    path = site.root / FILE
    return [line for line in path.read_bytes().split(b"\n") if line.strip()] if path.exists() else []


def _is_torn(line: bytes) -> bool:
    return not line.rstrip().endswith(b"}") and (line.startswith(_BEGIN) or _BEGIN.startswith(line))


def _line(one: AskedQuestion) -> dict[str, Any]:
    year, week, _ = one.monday.isocalendar()
    texts = {key: getattr(one, name) for key, name in _TEXTS.items()}
    return {"week": f"{year}-W{week:02}", **texts, "area": one.area_id, "change": one.is_change}


def _asked(line: bytes, number: int) -> AskedQuestion:
    value: Any = None
    with contextlib.suppress(ValueError, RecursionError):
        value = json.loads(line)
    if isinstance(value, dict) and all(isinstance(value.get(key), str) for key in ("week", *_TEXTS)):
        with contextlib.suppress(ValueError):
            monday = date.fromisoformat(f"{value['week']}-1")
            area = value.get("area")
            return AskedQuestion(
                monday=monday,
                area_id=area if isinstance(area, str) else None,
                is_change=value.get("change") is not False,
                **{name: value[key] for key, name in _TEXTS.items()},
            )
    raise InputError(
        f"line {number} of {FILE} is no question of a report",
        code="E110",
        where=Where(FILE, number, line.decode(errors="replace")[:200]),
        fix="delete the line: the report of that week asks again when it is made again",
    )
