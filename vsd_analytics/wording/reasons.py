"""Reasons and verdicts as text: the sentence of a `Reason`, and the spelling of a verdict outside the report."""

from __future__ import annotations

from datetime import date, datetime
from typing import Any, Final

from vsd_analytics.answer import TEXT, Reason, ReasonValue, Verdict
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import has, nested_quotes, template
from vsd_analytics.wording.languages import separated

COLUMN: Final = "column."
"""Codes of headings of columns: one without an entry is the name in words."""


class _Share(float):
    """A number that the catalogue may write as the page writes percentages: `{share:percent}`."""

    def __format__(self, spec: str) -> str:
        return fmt.percent(float(self)) if spec == "percent" else separated(super().__format__(spec))


class _Count(int):
    """A number of things, which the catalogue may write with separators: `{n:,}`."""

    def __format__(self, spec: str) -> str:
        return separated(super().__format__(spec))


class _Instant:
    """An instant as the page writes it, day and clock time."""

    def __init__(self, at: datetime) -> None:
        self._at = at

    def __str__(self) -> str:
        return fmt.instant_short(self._at)


class _Several:
    """Reasons one after the other: `{reasons}` with semicolons, `{reasons:comma}` with commas."""

    def __init__(self, reasons: tuple[Reason, ...]) -> None:
        self._reasons = reasons

    def __format__(self, spec: str) -> str:
        return (", " if spec == "comma" else "; ").join(reason_text(one) for one in self._reasons)


def reason_text(reason: Reason | None) -> str:
    """Return the sentence of a reason, the catalogue's entry `reason.<code>`; empty for none.

    Raises:
        KeyError: The catalogue has no such entry, or it names a value the reason lacks.
    """
    if reason is None:
        return ""
    if reason.code.startswith(COLUMN) and not has(f"reason.{reason.code}"):
        return reason.code.removeprefix(COLUMN).replace("_", " ")
    values = {name: _shown(value) for name, value in reason.values.items()}
    return nested_quotes(template(f"reason.{reason.code}").format(**values))


def text_or_none(reason: Reason | None) -> str | None:
    """Return the sentence of a reason; None for none, as JSON writes it."""
    return None if reason is None else reason_text(reason)


def verdict_text(verdict: Verdict) -> str:
    """Return a verdict as `vsd compare` writes it, such as "clear fall"."""
    return verdict.replace("_", " ")


def read_reason(text: str) -> Reason:
    """Return a reason for a sentence read from a JSON report; its code is lost."""
    return Reason(TEXT, text=text)


def encode_reason(value: Any) -> Any:
    """Return the sentence of a reason: what msgspec and json call for a type they do not know.

    Raises:
        TypeError: The value is no reason.
    """
    if isinstance(value, Reason):
        return reason_text(value)
    raise TypeError(f"JSON cannot hold {type(value).__name__}")


def decode_reason(kind: type, value: Any) -> Any:
    """Return the reason of a sentence: the hook of msgspec for fields of type `Reason`.

    Raises:
        ValueError: The value is no text; msgspec says where.
        TypeError: The field is of another type.
    """
    if kind is not Reason:
        raise TypeError(f"a report holds no {kind.__name__}")
    if not isinstance(value, str):
        raise ValueError(f"Expected `str`, got `{type(value).__name__}`")
    return read_reason(value)


def reason_schema(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a reason: a text.

    Raises:
        TypeError: The type is another one.
    """
    if kind is not Reason:
        raise TypeError(f"a report holds no {kind.__name__}")
    return {"type": "string"}


def _shown(value: ReasonValue) -> object:
    """Return a value in the form that the catalogue's places can format."""
    match value:
        case Reason():
            return reason_text(value)
        case tuple():
            return _Several(value)
        case datetime():
            return _Instant(value)
        case date():
            return fmt.date_short(value)
        case float():
            return _Share(value)
        case int() if not isinstance(value, bool):
            return _Count(value)
        case _:
            return value
