"""What a decoder is, and the notes beside a model that say what its inputs and outputs do not show."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Protocol

from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.errors import InputError, Where

Outputs = dict[str, NDArray[Any]]
"""What comes out of a network, by name."""


class Decoder(Protocol):
    """What the outputs of a family of networks mean."""

    @property
    def family(self) -> str:
        """Return the name of the family."""

    @property
    def preparation(self) -> Preparation:
        """Return what goes into the network."""

    @property
    def has_joints(self) -> bool:
        """Return whether people come with joints."""

    def decode(self, outputs: Outputs, *, least_score: float) -> Detections:
        """Return the people of one picture, in pixels of the network's input.

        Args:
            outputs: By name.
            least_score: People with a lower score are left out.
        """


_WORDS: Final = {"family": str, "fit": str, "colours": str, "boxes": str, "layout": str, "unit": str, "scores": str}
_MORE_WORDS: Final = {"classes": str}
_NUMBERS: Final = {"pad": int, "person": int}
_LISTS: Final = {"size_px": 2, "mean": 3, "sd": 3}
_CHOICES: Final = {
    "fit": ("corner", "centre", "stretch"),
    "colours": ("bgr", "rgb"),
    "layout": ("corners", "middle", "size"),
    "unit": ("px", "share"),
}


@dataclass(frozen=True, slots=True)
class ModelNotes:
    """The TOML file beside a model.

    Attributes:
        path: The file; None where there is none.
        values: Its keys: `family`, `size_px`, `fit`, `colours`, `mean`, `sd`, `pad`, `person`, and for the family
            `boxes` `boxes`, `layout`, `unit`, `scores` and `classes`.
    """

    path: Path | None = None
    values: Mapping[str, Any] = field(default_factory=dict)

    def person(self, usual: int) -> int:
        """Return the number of the class of a person."""
        return int(self.values.get("person", usual))

    def applied(self, preparation: Preparation) -> Preparation:
        """Return a preparation with what the notes say in place of what is usual."""
        keys = self.values
        changed: dict[str, Any] = {key: tuple(map(float, keys[key])) for key in ("mean", "sd") if key in keys}
        if "size_px" in keys:
            changed["size_px"] = tuple(map(int, keys["size_px"]))
        if "colours" in keys:
            changed["is_rgb"] = keys["colours"] == "rgb"
        changed |= {key: keys[key] for key in ("fit", "pad") if key in keys}
        return replace(preparation, **changed)


def notes_beside(model: Path) -> ModelNotes:
    """Return the notes of a model: `nanodet.toml` beside `nanodet.onnx`.

    Raises:
        InputError: The notes have a mistake (E217).
    """
    path = model.with_suffix(".toml")
    if not path.is_file():
        return ModelNotes()
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise _mistake(path, str(error)) from None
    kinds = {**_WORDS, **_MORE_WORDS, **_NUMBERS}
    for key, value in values.items():
        if key in _LISTS:
            is_right = isinstance(value, list) and len(value) == _LISTS[key]
            is_right &= all(isinstance(v, int | float) and not isinstance(v, bool) for v in value if is_right)
            if not is_right or (key in {"size_px", "sd"} and any(v <= 0 for v in value)):
                raise _mistake(path, f"{key} must be {_LISTS[key]} numbers, such as {_EXAMPLE[key]}")
        elif key not in kinds:
            raise _mistake(path, f"no key {key!r}; there are {', '.join([*_LISTS, *kinds])}")
        elif not isinstance(value, kinds[key]) or isinstance(value, bool):
            raise _mistake(path, f"{key} must be {'a word' if kinds[key] is str else 'a whole number'}")
        elif key in _CHOICES and value not in _CHOICES[key]:
            raise _mistake(path, f"{key} must be {' or '.join(_CHOICES[key])}, not {value!r}")
    return ModelNotes(path, values)


_EXAMPLE: Final = {"size_px": "[640, 640]", "mean": "[123.675, 116.28, 103.53]", "sd": "[58.395, 57.12, 57.375]"}


def _mistake(path: Path, why: str) -> InputError:
    return InputError(
        f"{path.name} beside the model has a mistake",
        code="E217",
        where=Where(str(path)),
        why=why,
        fix="mend that line",
    )
