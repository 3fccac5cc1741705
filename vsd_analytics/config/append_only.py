"""Files of a project to which lines are added and never altered: one JSON object a line, of one type."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from vsd_analytics.errors import InputError, Where
from vsd_analytics.site.model import Site

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class AppendOnlyFile(Generic[T]):
    """A file in the project folder.

    Attributes:
        name: Its name, such as "plans.jsonl".
        type: What each line is: a dataclass that msgspec decodes.
        written: Returns an item as its line is written.
        what: What an item is called in messages, with its article.
        fix: What makes a new one.
    """

    name: str
    type: type[T]
    written: Callable[[T], dict[str, Any]]
    what: str
    fix: str

    def read(self, site: Site) -> tuple[T, ...]:
        """Return the items in the order in which they were added.

        Raises:
            InputError: E110, a line is none.
        """
        return tuple(self._item(line, number=n) for n, line in self._lines(site))

    def add(self, site: Site, item: T) -> bool:
        """Add an item, durably: it is on disk when this returns. Returns False where an equal one is there already.

        The file is replaced as a whole, under a lock, so that it holds all of the item or nothing.

        Raises:
            InputError: E110, a line of the file is no item; nothing is written.
            DiskError: E304 to E306, the disk refused.
        """
        from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

        path = (site.root / self.name).resolve()  # what a link points to
        with exclusive(site.root / "status" / Path(self.name).with_suffix(".lock").name):
            sweep_temporaries(path.parent, file_name=path.name)
            if item in self.read(site):
                return False
            lines = [line for _, line in self._lines(site)]
            publish(path, b"".join(line + b"\n" for line in [*lines, json.dumps(self.written(item)).encode()]))
        return True

    def _lines(self, site: Site) -> Iterator[tuple[int, bytes]]:
        path = site.root / self.name
        if path.exists():
            lines = enumerate(path.read_bytes().split(b"\n"), start=1)
            yield from ((n, line) for n, line in lines if line.strip())

    def _item(self, line: bytes, *, number: int) -> T:
        try:
            return msgspec.json.decode(line, type=self.type)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise InputError(
                f"line {number} of {self.name} is not {self.what}",
                code="E110",
                where=Where(self.name, number, line.decode(errors="replace")[:200]),
                why=str(error),
                fix=f"correct or delete the line; {self.fix}",
            ) from None
