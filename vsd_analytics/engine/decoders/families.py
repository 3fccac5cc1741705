"""What comes out of networks of known families, as people: one module for each family.

A decoder is chosen by the names and shapes of a network's inputs and outputs. A TOML file beside the model names the
family and what else the shapes do not show.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from vsd_analytics.engine.decoders.boxes import boxes
from vsd_analytics.engine.decoders.crops import CropDecoder, movenet_single, rtmpose
from vsd_analytics.engine.decoders.decoder import Decoder, ModelNotes, notes_beside
from vsd_analytics.engine.decoders.detr import detr
from vsd_analytics.engine.decoders.mmdeploy import rtmdet, rtmo
from vsd_analytics.engine.decoders.movenet import movenet
from vsd_analytics.engine.decoders.nanodet import nanodet
from vsd_analytics.engine.decoders.yolo import yolo
from vsd_analytics.engine.decoders.yolox import yolox
from vsd_analytics.engine.model_input import TYPES, other_inputs
from vsd_analytics.engine.network import Signature
from vsd_analytics.errors import InputError, Where

FAMILIES: Final[dict[str, Callable[[Signature, ModelNotes], Any]]] = {
    "movenet": movenet,
    "rtmo": rtmo,
    "rtmdet": rtmdet,
    "detr": detr,
    "nanodet": nanodet,
    "yolox": yolox,
    "yolo": yolo,
    "boxes": boxes,
}
"""Each family, and what makes its decoder of a signature that fits; the first that fits is taken."""
CROP_FAMILIES: Final[dict[str, Callable[[Signature, ModelNotes], Any]]] = {
    "rtmpose": rtmpose,
    "movenet-singlepose": movenet_single,
}
"""The same for networks that find the joints of one person in a crop."""


def decoder_for(signature: Signature, *, model: Path) -> Decoder:
    """Return the decoder of a model, by the notes beside it where there are any, else by its signature.

    Raises:
        InputError: No family fits (E216), or the notes have a mistake (E217).
    """
    chosen: Decoder = _chosen(FAMILIES, signature, model)
    return chosen


def crop_decoder_for(signature: Signature, *, model: Path) -> CropDecoder:
    """Return the decoder of a model that finds one person's joints in a crop; raises as `decoder_for`."""
    chosen: CropDecoder = _chosen(CROP_FAMILIES, signature, model)
    return chosen


def _chosen(families: dict[str, Callable[[Signature, ModelNotes], Any]], signature: Signature, model: Path) -> Any:
    notes = notes_beside(model)
    named = notes.values.get("family")
    if named is not None and named not in families:
        raise _unknown(model, signature, families, why=f"{model.with_suffix('.toml').name} names a family {named!r}")
    is_picture = bool(signature.inputs) and len(signature.inputs[0].shape) == 4 and signature.inputs[0].kind in TYPES
    if is_picture and other_inputs(signature.inputs[1:], (1, 1)) is None:
        raise _unknown(model, signature, families, why="it takes more than a picture")
    for family, decoder_of in families.items():
        if is_picture and named in {None, family}:
            decoder = decoder_of(signature, notes)
            if decoder is not None:
                return replace(decoder, preparation=notes.applied(decoder.preparation))
    raise _unknown(model, signature, families, why=f"its outputs are not those of {named}" if named else None)


def _unknown(
    model: Path, signature: Signature, families: dict[str, Callable[[Signature, ModelNotes], Any]], *, why: str | None
) -> InputError:
    explanation = f"{why}; its inputs and outputs are {signature}" if why else str(signature)
    if families is CROP_FAMILIES:
        return InputError(
            f"{model.name} does not find the joints of one person in a way that is known",
            code="E216",
            where=Where(str(model)),
            why=explanation,
            fix=f"give a model of {' or '.join(CROP_FAMILIES)}, or leave out --joints",
        )
    width, height = signature.picture_px or (640, 640)
    names = [port.name for port in signature.outputs]
    lines = [
        f'family = "boxes"             # or {", ".join(name for name in FAMILIES if name != "boxes")}',
        f"size_px = [{width}, {height}]",
        'fit = "corner"               # a picture of other proportions: corner, centre or stretch',
        'colours = "rgb"              # or bgr',
        "mean = [0, 0, 0]             # taken off each colour",
        "sd = [255, 255, 255]         # and what the rest is divided by",
        f'boxes = "{names[0] if names else ""}[0:4]"',
        'layout = "corners"           # or middle (and size), or size (left, top, width, height)',
        'unit = "px"                  # or share, of the input',
        f'scores = "{names[-1] if names else ""}[4]"',
        "person = 0                   # number of the class of a person",
    ]
    return InputError(
        f"{model.name} is a model of no known family",
        code="E216",
        where=Where(str(model)),
        why=explanation,
        fix=f"write {model.with_suffix('.toml').name} beside it and fill it in:\n  " + "\n  ".join(lines),
    )
