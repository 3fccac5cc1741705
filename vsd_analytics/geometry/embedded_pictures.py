"""Pictures inside the page: floor plans and empty camera scenes as small data URIs."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vsd_analytics.errors import ReportError, Where
from vsd_analytics.geometry.picture_size import picture_size

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

    import numpy as np
    from numpy.typing import NDArray

MAX_BYTES: Final = 60_000
SCENE_TONE: Final = 0.62
"""White of a camera picture becomes this share of white below bands."""
MAX_PIXELS: Final = 100_000_000
_ACTIVE: Final = {"script", "foreignobject", "iframe", "embed", "object", "handler"}
_LOADS: Final = re.compile(r"@import|url\(\s*[\"']?(?!#|data:image/|[\"'\s])", re.IGNORECASE)
_UNDRAWN: Final = {"svg", "g", "title", "desc", "defs", "style", "metadata", "namedview"}


def data_uri(data: bytes, *, kind: str) -> str:
    """Return bytes as a data URI of media type `image/{kind}`."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def plan_image(path: Path, *, max_bytes: int = MAX_BYTES) -> tuple[str, tuple[int, int]]:
    """Return a floor plan as a data URI and its size in pixels.

    White becomes transparent (colour to alpha), so that heat can lie below the lines and a dark page can invert them.
    The picture is made smaller and its colours fewer until it fits. SVG plans are carried as they are; one that is more
    than a drawing (scripts, links to other files) is refused, though pages show pictures without running or loading
    anything: other programs that print the page may not be as careful.

    Args:
        path: SVG, PNG or JPG file.
        max_bytes: Largest size of the picture.

    Returns:
        The data URI, and width and height in pixels of the *original* file (0, 0 for SVG).

    Raises:
        ReportError: The file is no picture, or more than one (E501), or an SVG larger than four times `max_bytes`
            (E502).
    """
    if path.suffix.lower() == ".svg":
        data = _read(path)
        if len(data) > 4 * max_bytes:
            raise ReportError(
                f"the floor plan is {len(data) // 1000} KB of SVG",
                code="E502",
                where=Where(file=str(path)),
                why=f"the report carries it inside, and an SVG plan may have at most {4 * max_bytes // 1000} KB",
                fix="save it as PNG and name that file in vsd.toml",
            )
        problem = "it has a style sheet" if b"<?xml-stylesheet" in data else _more_than_drawn(_svg(path, data))
        if problem is not None:
            raise _no_picture(path, f"it is more than a drawing: {problem}")
        return data_uri(data, kind="svg+xml"), (0, 0)
    import cv2
    import numpy as np

    image = _decode(path, flags=cv2.IMREAD_UNCHANGED)
    bgr = _on_white(image)
    height, width = bgr.shape[:2]
    for side, levels in ((1400, 9), (1200, 6), (1000, 5), (800, 4), (640, 4), (480, 3), (320, 3), (160, 2)):
        factor = min(1.0, side / max(width, height))
        size = max(1, round(width * factor)), max(1, round(height * factor))
        small = cv2.resize(bgr, size, interpolation=cv2.INTER_AREA) if factor < 1 else bgr
        encoded = cv2.imencode(".png", _white_to_alpha(small, levels=levels), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1]
        if encoded.nbytes <= max_bytes:
            break
    return data_uri(np.asarray(encoded).tobytes(), kind="png"), (width, height)


def has_paper(path: Path) -> bool:
    """Tell whether an SVG plan is drawn on an opaque ground, which would hide what lies below it.

    True when its first drawn element is a filled rectangle or picture as large as the drawing; other plans have none,
    as `plan_image` makes their white transparent.
    """
    if path.suffix.lower() != ".svg":
        return False
    root = _svg(path, _read(path))
    ground = next((e for e in root.iter() if _tag(e) not in _UNDRAWN), None)
    if ground is None or _tag(ground) not in {"rect", "image"} or ground.get("fill") in {"none", "transparent"}:
        return False
    sizes = (root.get("viewBox") or "").replace(",", " ").split()[2:] or [root.get("width", ""), root.get("height", "")]
    return all(_covers(ground.get(side), whole) for side, whole in zip(("width", "height"), sizes, strict=False))


def _svg(path: Path, data: bytes) -> Element:
    """Return the root of a drawing; expat loads no other file and ends when entities grow without measure."""
    from xml.etree import ElementTree

    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # the latter: an encoding nobody knows
        raise _no_picture(path, "it is no SVG drawing") from error


def _more_than_drawn(root: Element) -> str | None:
    """Return the first thing in a drawing that runs or loads something, or None."""
    for element in root.iter():
        tag = _tag(element)
        if tag.lower() in _ACTIVE:
            return f"it has an element {tag}"
        if tag.lower() == "style" and _LOADS.search(element.text or ""):
            return "its style loads another file"
        for name, value in element.attrib.items():
            bare = name.rpartition("}")[2].lower()
            if bare.startswith("on") or "javascript:" in value.lower():
                return f"it has an attribute {bare}"
            if bare in ("href", "src") and tag != "a" and not value.strip().startswith(("#", "data:image/")):
                return f"it links to {value[:80]!r}"
            if _LOADS.search(value):
                return f"it loads {value[:80]!r}"
    return None


def _tag(element: object) -> str:
    return str(getattr(element, "tag", "")).rpartition("}")[2]


def _covers(length: str | None, whole: str) -> bool:
    """Tell whether a length of an SVG is its whole side: 100%, or nearly the number of the viewBox."""
    if length is None or length.strip() == "100%":
        return length is not None
    try:
        return float(length.removesuffix("px")) >= 0.98 * float(whole.removesuffix("px"))
    except ValueError:
        return False


def picture_image(path: Path, *, width_px: int = 640) -> tuple[str, tuple[int, int]]:
    """Return an empty camera scene as a grey WebP data URI and the size of the original in pixels.

    Args:
        path: PNG or JPG file.
        width_px: Width it is made smaller to.

    Raises:
        ReportError: The file is no picture (E501).
    """
    import cv2

    grey = _decode(path, flags=cv2.IMREAD_GRAYSCALE)
    return _small_webp(grey, width_px=width_px, max_bytes=MAX_BYTES, qualities=(60, 40, 20, 5))


def photo_image(path: Path) -> tuple[str, tuple[int, int]]:
    """Return a picture in colour as a WebP data URI and the size of the original in pixels.

    Args:
        path: PNG or JPG file.

    Raises:
        ReportError: The file is no picture (E501).
    """
    import cv2

    # as stored: the pixels of a calibration know nothing of a photo's orientation tag
    bgr = _decode(path, flags=cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return _small_webp(bgr, width_px=1600, max_bytes=500_000, qualities=(85, 70, 50, 30))


def _small_webp(
    picture: NDArray[Any], *, width_px: int, max_bytes: int, qualities: tuple[int, ...]
) -> tuple[str, tuple[int, int]]:
    """Return a picture of this width as a data URI, of the first quality that fits, and its size before."""
    import cv2
    import numpy as np

    height, width = picture.shape[:2]
    factor = min(1.0, width_px / width)
    small = cv2.resize(picture, (round(width * factor), max(1, round(height * factor))), interpolation=cv2.INTER_AREA)
    for quality in qualities:
        encoded = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, quality])[1]
        if encoded.nbytes <= max_bytes:
            break
    return data_uri(np.asarray(encoded).tobytes(), kind="webp"), (width, height)


def scene_image(
    path: Path,
    *,
    cut: tuple[float, float, float, float],
    of_px: tuple[int, int],
    width_px: int = 640,
    max_bytes: int = 7_000,
) -> str:
    """Return part of an empty camera scene as a grey WebP data URI, toned down so that bands are clearly visible on it.

    Args:
        path: PNG or JPG file.
        cut: x0, y0, x1, y1 of the part, in pixels of a picture of size `of_px`.
        of_px: Width and height that `cut` is given in; a file of another size is cut in proportion.
        width_px: Width it is made smaller to.
        max_bytes: Quality, then size, is lowered until it fits.

    Raises:
        ReportError: The file is no picture (E501).
    """
    import cv2
    import numpy as np

    grey = _decode(path, flags=cv2.IMREAD_GRAYSCALE)
    height, width = grey.shape[:2]
    x0, x1 = (min(width, max(0, round(x * width / of_px[0]))) for x in cut[::2])
    y0, y1 = (min(height, max(0, round(y * height / of_px[1]))) for y in cut[1::2])
    part = np.clip(grey[y0 : max(y1, y0 + 1), x0 : max(x1, x0 + 1)] * SCENE_TONE, 0, 255).astype(np.uint8)
    for side in (width_px, width_px * 3 // 4, width_px // 2, width_px // 4):
        factor = min(1.0, side / part.shape[1])
        size = max(1, round(part.shape[1] * factor)), max(1, round(part.shape[0] * factor))
        small = cv2.resize(part, size, interpolation=cv2.INTER_AREA) if factor < 1 else part
        for quality in (75, 60, 45, 30, 15):
            encoded = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, quality])[1]
            if encoded.nbytes <= max_bytes:
                return data_uri(np.asarray(encoded).tobytes(), kind="webp")
    return data_uri(np.asarray(encoded).tobytes(), kind="webp")


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise _no_picture(path, error.strerror or "it cannot be read") from error


def _decode(path: Path, *, flags: int) -> NDArray[Any]:
    import cv2
    import numpy as np

    data = _read(path)
    width, height = picture_size(path) or (0, 0)
    if width * height > MAX_PIXELS:
        raise _no_picture(path, f"it has {width:,} x {height:,} pixels; at most {MAX_PIXELS:,} are read")
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags) if width else None
    except cv2.error:
        image = None
    if image is None:
        raise _no_picture(path, "it is no PNG or JPG picture")
    return np.asarray(image)


def _no_picture(path: Path, why: str) -> ReportError:
    return ReportError(
        f"the picture {path.name} cannot be shown",
        code="E501",
        where=Where(file=str(path)),
        why=why,
        fix="name another file in vsd.toml, or take the line out",
    )


def _on_white(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return 8-bit BGR; transparent pixels become white."""
    import cv2
    import numpy as np

    if image.dtype == np.uint16:
        image = (image // 257).astype(np.uint8)
    if image.ndim == 2:
        return np.asarray(cv2.cvtColor(image.astype(np.uint8), cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    if image.shape[2] == 4:
        alpha = image[..., 3:].astype(np.float32) / 255
        return np.asarray(image[..., :3] * alpha + 255 * (1 - alpha) + 0.5, dtype=np.uint8)
    return image.astype(np.uint8)


def _white_to_alpha(bgr: NDArray[Any], *, levels: int) -> NDArray[np.uint8]:
    """Return BGRA with `levels` steps of alpha: white is clear, the rest keeps its look on a white page."""
    import numpy as np

    colour = bgr.astype(np.float32)
    alpha = 255 - colour.min(axis=2, keepdims=True)
    alpha = np.round(alpha / 255 * (levels - 1)) / (levels - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ink = np.where(alpha > 0, (colour - 255 * (1 - alpha)) / alpha, 0)
    ink = np.round(np.clip(ink, 0, 255) / 51) * 51
    return np.concatenate([ink, alpha * 255], axis=2).astype(np.uint8)
