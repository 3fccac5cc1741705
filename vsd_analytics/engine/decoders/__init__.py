"""What comes out of networks of known families, as people: one module for each family.

A decoder is chosen by the names and shapes of a network's inputs and outputs. A TOML file beside the model names the
family and what else the shapes do not show.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Protocol

from numpy.typing import NDArray

from vsd_analytics.engine.decoders.nanodet import nanodet
from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.model_input import Preparation
from vsd_analytics.engine.network import Signature
from vsd_analytics.errors import InputError, Where


class Decoder(Protocol):
    """What a family's outputs mean."""

    @property
    def family(self) -> str:
        """Name of the family."""

    @property
    def preparation(self) -> Preparation:
        """What goes into the network."""

    @property
    def has_joints(self) -> bool:
        """Whether people come with joints."""

    def decode(self, outputs: dict[str, NDArray[Any]], *, least_score: float) -> Detections:
        """Return the people of one picture, in pixels of the network's input.

        Args:
            outputs: By name.
            least_score: People with a lower score are left out.
        """


FAMILIES: Final[dict[str, Callable[[Signature], Decoder | None]]] = {"nanodet": nanodet}
"""Name of each family, and what makes its decoder of a signature that fits."""


def decoder_for(signature: Signature, *, model: Path) -> Decoder:
    """Return the decoder of a model.

    Raises:
        InputError: No family fits (E216).
    """
    for decoder_of in FAMILIES.values():
        decoder = decoder_of(signature)
        if decoder is not None:
            return decoder
    raise InputError(
        f"{model.name} is a model of no known family",
        code="E216",
        where=Where(str(model)),
        why=str(signature),
        fix="",
    )
