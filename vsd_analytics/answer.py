"""The form in which every figure leaves `figures/`: an answer, a table whose values say how certain they are.

An answer has a row for each key that could have one: an hour or an area that has nothing says so, with a state and a
reason. Every output only renders answers: text, JSON, CSV, frames, the DuckDB file, pages.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from types import MappingProxyType
from typing import Any, Final, Literal, Protocol, TypeAlias

State = Literal["ok", "not_enough_data", "not_measurable"]
Verdict = Literal["clear_fall", "clear_rise", "about_same", "cannot_tell", "too_little_data"]
"""What an interval of a change allows to say; "too_little_data" where there is none."""
Design = Literal["beside", "alone"]
"""How a change of the log is judged: beside areas that were left alone, or the area by itself."""
Outcome = Literal[
    "works", "moved", "fell", "doubtful", "rose", "about_same", "cannot_tell", "too_early", "alone", "site_wide"
]
"""What may be said of a change of the log (`vsd_analytics.figures.change_outcome`)."""


class Reason:
    """Why a figure is missing, what is special about it, or its unit: a code and the values its words name.

    The sentence is the entry `reason.<code>` of the wording catalogue; `vsd_analytics.wording.reasons` makes it.
    It is a class of its own, and no dataclass, so that JSON writes it as its sentence (msgspec asks the hooks).

    Attributes:
        code: Dotted name, such as "level.days". Code may compare it; nothing compares sentences.
        values: Numbers, instants, names from the data, and reasons that are part of this one. Read-only.

    Example:
        >>> Reason("level.days", least=3, has=2)
        Reason('level.days', least=3, has=2)
        >>> Reason("level.days", least=3, has=2) == Reason("level.days", has=2, least=3)
        True
    """

    __slots__ = ("code", "values")

    code: str
    values: Mapping[str, ReasonValue]

    def __init__(self, code: str, /, **values: ReasonValue) -> None:
        object.__setattr__(self, "code", code)
        object.__setattr__(self, "values", MappingProxyType(values))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Reason is read-only: {name}")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Reason) and (self.code, self.values) == (other.code, other.values)

    def __hash__(self) -> int:
        return hash((self.code, frozenset(self.values.items())))

    def __repr__(self) -> str:
        return f"Reason({', '.join([repr(self.code), *(f'{k}={v!r}' for k, v in self.values.items())])})"

    def __reduce__(self) -> tuple[Any, ...]:
        # copy and pickle: a mapping proxy does neither
        return _restored, (self.code, dict(self.values))


ReasonValue: TypeAlias = "str | int | float | date | datetime | Reason | tuple[Reason, ...]"
TEXT: Final = "text"
"""Code of a reason that was read from a JSON report, which holds the sentence only."""


def _restored(code: str, values: dict[str, ReasonValue]) -> Reason:
    return Reason(code, **values)


Kind = Literal["key", "fact", "count", "number", "people", "seconds", "share", "rate", "instant", "place"]
"""What a column holds: a part of the key, a fact about the row, a count of events or people, a number of things that
tell of nobody (messages, cameras), a mean number of people, a duration, a share of 0 to 1, a rate, an instant with its
zone, a place or the name of one. Only counts can be too small to share."""
VALUES: Final = frozenset({"count", "number", "people", "seconds", "share", "rate"})
"""Kinds of columns whose cells are a `Value`; the others hold scalars."""
INTERVALS: Final = frozenset({"people", "seconds", "share", "rate"})
"""Kinds of columns whose values may have an interval."""
Audience = Literal["anybody", "operator"]
Scalar: TypeAlias = "str | int | float | bool | date | datetime | None"
Cell: TypeAlias = "Value | Scalar | tuple[Scalar, ...]"
Row: TypeAlias = "Mapping[str, Cell]"


@dataclass(frozen=True, slots=True)
class Column:
    """A column of an answer.

    Attributes:
        name: Its name in every output, with its unit at the end where that is a physical one.
        kind: What it holds.
        unit: The unit as a code of the wording catalogue, such as "people"; empty for keys, facts and plain counts.
        figure: Id of the catalogue, such as M36; empty for what is no figure of its own.
        digits: Significant digits in text.
        tells: Count columns of the same row that its value would reveal.
        per: Column of the same row that holds what it was divided by; empty where nothing was.
        audience: Who may read it: "operator" columns never leave the operator's hands.
    """

    name: str
    kind: Kind
    unit: str = ""
    figure: str = ""
    digits: int = 3
    tells: tuple[str, ...] = ()
    per: str = ""
    audience: Audience = "anybody"


@dataclass(frozen=True, slots=True)
class Sum:
    """A declared sum: a count of this answer is the sum of counts of others, or of other columns of its row.

    Attributes:
        total: Count column of this answer.
        parts: What adds up to it: "n_left" is a column of the same row; "queue_hours.n_entered" is that column over all
            rows of the answer `queue_hours` whose keys agree with those of the row.
    """

    total: str
    parts: tuple[str, ...]


class Estimated(Protocol):
    """What statistics return of one number: `value` with the limits `lo` and `hi` of its interval."""

    @property
    def value(self) -> float | None:
        """Return the number; None where there is none."""

    @property
    def lo(self) -> float | None:
        """Return its lower limit; None without an interval."""

    @property
    def hi(self) -> float | None:
        """Return its upper limit; None without an interval."""


@dataclass(frozen=True, slots=True)
class Value:
    """A number with its interval, or why there is none.

    The state is about the number alone: "ok" where there is one. A number that should have an interval and has none
    says why in its reason, and is not to be relied on (`is_uncertain`).

    Attributes:
        value: The number; None where it cannot be given.
        lo, hi: Limits of the interval; None without one.
        state: "ok" where there is a number, else which kind of lack.
        reason: Why there is no value or no interval, or what is special.

    Raises:
        ValueError: There is a number beside a lack, or none beside "ok".
    """

    value: float | None
    lo: float | None = None
    hi: float | None = None
    state: State = "ok"
    reason: Reason | None = None

    def __post_init__(self) -> None:
        if (self.value is None) is (self.state == "ok"):
            raise ValueError(f"a value of {self.value} cannot have the state {self.state!r}")

    @property
    def is_uncertain(self) -> bool:
        """Return whether the number, or the interval it should have, is missing."""
        return self.value is None or (self.lo is None and self.reason is not None)

    @classmethod
    def of(cls, estimate: Estimated, *, state: State | None = None, reason: Reason | None = None) -> Value:
        """Return an estimate of `stats/` as a value.

        Args:
            estimate: What has `value`, `lo`, `hi`; its own `state` and `reason` are used where none are given.
            state: Of an estimate without a number: the lack of what it is part of, such as all stays in an area.
            reason: Likewise.
        """
        state = state or getattr(estimate, "state", None) or "ok"
        reason = reason if reason is not None else getattr(estimate, "reason", None)
        if estimate.value is not None:
            state = "ok"
        elif state == "ok":
            state = "not_enough_data"
        return cls(estimate.value, estimate.lo, estimate.hi, state, reason)

    @classmethod
    def missing(cls, reason: Reason | None, state: State = "not_enough_data") -> Value:
        """Return a value that is not given, and why."""
        return cls(None, state=state, reason=reason)


@dataclass(frozen=True, slots=True)
class HoldsFor:
    """What an answer is about.

    Attributes:
        site_id, floor_id: The place; without a floor, all floors.
        first, last: First and last local day.
        until: Instant up to which hours are over, where the days are still running; None = they are over.
        settings: Hash of all settings in force (`Settings.settings_id`).
        inputs: Hash of the facts it was computed from; empty where nothing was.
    """

    site_id: str
    floor_id: str | None
    first: date
    last: date
    until: datetime | None = None
    settings: str = ""
    inputs: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """One table of figures, as every output renders it.

    Attributes:
        name: Name of the table, such as "queue_hours".
        columns: Its columns, keys first.
        rows: One for each key that could have one.
        holds_for: Place, days and settings.
        sums: Declared sums.
        notes: What a reader must know: a row by its number, or None for the whole table, and the reason.
        nothing: Why there are no rows; None where there are some, and where there is truly nothing to list.
        state: Which lack `nothing` is; "ok" without one.

    Raises:
        ValueError: A row lacks a column or has another one, two rows have one key, or a declared sum does not hold.

    Example:
        >>> holds = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
        >>> columns = (Column("area_id", "key"), Column("n_visits", "count"))
        >>> visits = Answer("visits", columns, ({"area_id": "door", "n_visits": Value(12)},), holds)
        >>> visits.value("n_visits", area_id="door").value
        12
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    holds_for: HoldsFor
    sums: tuple[Sum, ...] = ()
    notes: tuple[tuple[int | None, Reason], ...] = ()
    nothing: Reason | None = None
    state: State = "ok"

    def __post_init__(self) -> None:
        names = [c.name for c in self.columns]
        if len(set(names)) < len(names):
            raise ValueError(f"{self.name} has a column twice: {', '.join(names)}")
        expected, typed = set(names), {c.name: c.kind in VALUES for c in self.columns}
        for row in self.rows:
            if row.keys() != expected:
                raise ValueError(f"a row of {self.name} has other columns: {sorted(row.keys() ^ expected)}")
            if wrong := [n for n, cell in row.items() if isinstance(cell, Value) is not typed[n]]:
                raise ValueError(f"cells of {self.name} have the wrong type: {', '.join(wrong)}")
        keys = [self.key(row) for row in self.rows]
        if len(set(keys)) < len(keys):
            raise ValueError(f"{self.name} has two rows for one key")
        for declared in self.sums:
            if all("." not in part for part in declared.parts):
                self._check_sum(declared)

    def _check_sum(self, declared: Sum) -> None:
        for row in self.rows:
            total, *parts = (cell.value for n in (declared.total, *declared.parts) if isinstance(cell := row[n], Value))
            known = [n for n in parts if n is not None]
            if total is not None and len(known) == len(parts) and sum(known) != total:
                raise ValueError(f"{declared.total} of {self.name} is {total}, its parts are {parts}")

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the names of the key columns."""
        return tuple(c.name for c in self.columns if c.kind == "key")

    def key(self, row: Row) -> tuple[Cell, ...]:
        """Return the key of a row."""
        return tuple(row[name] for name in self.keys)

    def column(self, name: str) -> Column:
        """Return a column by its name.

        Raises:
            KeyError: There is no such column.
        """
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(f"{self.name} has no column {name!r}")

    def where(self, **keys: Scalar) -> Iterator[Row]:
        """Yield the rows whose cells equal those given."""
        return (row for row in self.rows if all(row[name] == cell for name, cell in keys.items()))

    def value(self, column: str, **keys: Scalar) -> Value:
        """Return the value of a column in the one row that has these keys.

        Raises:
            KeyError: No row has them, or several.
        """
        rows = list(self.where(**keys))
        if len(rows) != 1:
            raise KeyError(f"{len(rows)} rows of {self.name} have {keys}")
        return value_of(rows[0], column)


class Answers:
    """Answers by name, in order.

    Args:
        answers: The answers; of two with one name the last counts.
    """

    __slots__ = ("_by_name",)

    def __init__(self, answers: Iterable[Answer] = ()) -> None:
        self._by_name = {answer.name: answer for answer in answers}

    def __getitem__(self, name: str) -> Answer:
        return self._by_name[name]

    def __iter__(self) -> Iterator[Answer]:
        return iter(self._by_name.values())

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __len__(self) -> int:
        return len(self._by_name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Answers) and self._by_name == other._by_name

    def __hash__(self) -> int:
        return hash(tuple(self._by_name))

    def get(self, name: str) -> Answer | None:
        """Return an answer; None where there is none of this name."""
        return self._by_name.get(name)


def value_of(row: Row, column: str) -> Value:
    """Return the cell of a value column.

    Raises:
        TypeError: The column holds no values.
    """
    cell = row[column]
    if not isinstance(cell, Value):
        raise TypeError(f"{column} holds no values")
    return cell


def check_sums(answers: Sequence[Answer]) -> None:
    """Check the sums that are declared over several answers.

    Raises:
        ValueError: One does not hold; sums over unknown parts are unknown and hold.
    """
    by_name = {answer.name: answer for answer in answers}
    for answer in answers:
        for declared in (s for s in answer.sums if any("." in part for part in s.parts)):
            for row in answer.rows:
                parts = [n for part in declared.parts for n in _parts(answer, row, part, by_name)]
                total = value_of(row, declared.total).value
                known = [n for n in parts if n is not None]
                if total is not None and len(known) == len(parts) and sum(known) != total:
                    raise ValueError(f"{answer.name}, {answer.key(row)}: {declared.total} is {total}, not {sum(known)}")


def _parts(answer: Answer, row: Row, part: str, by_name: Mapping[str, Answer]) -> list[float | None]:
    """Return the counts behind a part of a declared sum."""
    name, _, column = part.rpartition(".")
    if not name:
        return [value_of(row, column).value]
    if name not in by_name:
        return [None]
    other = by_name[name]
    shared = [k for k in answer.keys if k in other.keys]
    return [value_of(r, column).value for r in other.rows if all(r[k] == row[k] for k in shared)]
