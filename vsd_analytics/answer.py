"""The language between statistics, figures and pages: how certain a figure is, what it says, and why it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any, Final, Literal, TypeAlias

State = Literal["ok", "not_enough_data", "not_measurable"]
Verdict = Literal["clear_fall", "clear_rise", "about_same", "cannot_tell", "too_little_data"]
"""What an interval of a change allows to say; "too_little_data" where there is none."""
Design = Literal["beside", "alone"]
"""How a change of the log is judged: beside areas that were left alone, or the area by itself."""


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


ReasonValue: TypeAlias = "str | int | float | datetime | Reason | tuple[Reason, ...]"
TEXT: Final = "text"
"""Code of a reason that was read from a JSON report, which holds the sentence only."""


def _restored(code: str, values: dict[str, ReasonValue]) -> Reason:
    return Reason(code, **values)
