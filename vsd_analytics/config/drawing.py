"""Floor plans from an architect's drawing (DXF): its lines in metres, and the SVG that `plan` of vsd.toml names.

Needs the extra `dxf` (ezdxf). The unit comes from $INSUNITS of the drawing, or from the user. Layers that are off or
frozen are left out, as a CAD program leaves them out of a print; `--where "layer = 'A-WALL'"` chooses others.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from xml.sax.saxutils import quoteattr

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.config.row_filter import RowCondition
from vsd_analytics.errors import InputError, UsageError, Where

if TYPE_CHECKING:
    from ezdxf.document import Drawing

M_PER_PX: Final = 0.01
"""Scale of the SVG that is drawn: metres of one of its units."""
_MARGIN_M: Final = 0.5
_FLAT_M: Final = 0.02
"""How far a drawn curve may be from the true one."""
_ROOM_M: Final = (3.0, 300.0)
"""Sides of usual floors, by which a unit is proposed."""
_FLOOR_MAX_M: Final = 2_000.0
_FARTHEST_M: Final = 1e6
_BYTES_MAX: Final = 200_000_000
_ENTITIES_MAX, _POINTS_MAX = 200_000, 2_000_000
_BINARY: Final = b"AutoCAD Binary DXF"
_UNITS: Final[Mapping[int, str]] = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 10: "yd", 14: "dm"}
"""$INSUNITS, and the unit as options call it."""
_NO_LINES: Final = frozenset(
    (
        *("TEXT", "MTEXT", "ATTRIB", "ATTDEF", "DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "POINT", "VIEWPORT"),
        *("IMAGE", "WIPEOUT", "OLE2FRAME", "ACAD_TABLE", "TOLERANCE", "XLINE", "RAY"),
    )
)

Line = tuple[tuple[float, float], ...]
"""Corners of a line in metres of the drawing."""


@dataclass(frozen=True, slots=True)
class FloorDrawing:
    """The lines of a drawing.

    Attributes:
        name: Name of the file.
        unit: Unit of its numbers, a key of `METRES`.
        is_stated: Whether the drawing itself says the unit.
        lines: Lines by layer, in metres.
        left_out: Things without lines, and things of layers that are off or were not chosen, by what they are.
    """

    name: str
    unit: str
    is_stated: bool
    lines: Mapping[str, Sequence[Line]]
    left_out: Mapping[str, int]

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return the least x, least y, largest x and largest y, in metres of the drawing."""
        points = [point for lines in self.lines.values() for line in lines for point in line]
        xs, ys = zip(*points, strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    @property
    def origin_m(self) -> tuple[float, float]:
        """Return `plan_origin_m`: the lower left corner of the SVG, whole centimetres."""
        left, low, _, _ = self.bounds_m
        return round(left - _MARGIN_M, 2), round(low - _MARGIN_M, 2)

    def svg(self) -> str:
        """Return the drawing as SVG, of which one unit is `M_PER_PX` metres; each layer is a group."""
        left, low = self.origin_m
        _, _, right, top = self.bounds_m
        width, height = (math.ceil((end + _MARGIN_M - start) / M_PER_PX) for start, end in ((left, right), (low, top)))

        def place(point: tuple[float, float]) -> str:
            return f"{(point[0] - left) / M_PER_PX:.1f},{height - (point[1] - low) / M_PER_PX:.1f}"

        groups = [
            f"<g id={quoteattr(layer)}>"
            + "".join(f'<polyline points="{" ".join(map(place, line))}"/>' for line in lines)
            + "</g>"
            for layer, lines in self.lines.items()
        ]
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}">\n'
            '<g fill="none" stroke="#555" stroke-width="4" stroke-linejoin="round" stroke-linecap="round">\n'
            + "\n".join(groups)
            + "\n</g>\n</svg>\n"
        )


def is_drawing(path: Path) -> bool:
    """Return whether a file is a DXF drawing, by its name or its first bytes."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".dxf":
        return True
    with path.open("rb") as file:
        head = file.read(64)
    return head.startswith(_BINARY) or head.split()[:2] == [b"0", b"SECTION"]


def read_drawing(path: Path, *, unit: str | None = None, where: Sequence[RowCondition] = ()) -> FloorDrawing:
    """Read the lines of a DXF drawing: of its model with all blocks, and not of its sheets.

    Args:
        path: The file.
        unit: Unit of its numbers, where it does not say it.
        where: Conditions on `layer` and `type`; none = all layers that are on.

    Raises:
        InputError: E204 ezdxf is not installed, there are no lines or no unit; E205 damage; E206 it is too large.
        UsageError: E101, the user contradicts the unit of the drawing, or compares something else.
    """
    if other := next(
        (c.column for c in where if c.column not in ("layer", "type") or not isinstance(c.value, str)), None
    ):
        raise UsageError(f"a drawing has no {other!r} to compare with a text", fix="--where \"layer = 'A-WALL'\"")
    document, n_damaged = _document(path)
    stated = _UNITS.get(int(document.header.get("$INSUNITS", 0)))
    if unit is not None and stated not in (None, unit):
        raise UsageError(
            f"--unit {unit} contradicts {path.name}, which says {stated} ($INSUNITS)", fix=f"--unit {stated}"
        )
    lines, left_out = _lines(path, document, where, metres=METRES[unit or stated or "m"])
    left_out |= {"damaged": n_damaged} if n_damaged else {}
    if not lines:
        layers = ", ".join(sorted(layer.dxf.name for layer in document.layers)[:20])
        raise InputError(
            f"{path.name} has no lines" + (" on the layers that --where keeps" if where else ""),
            code="E204",
            where=Where(str(path)),
            why=f"its layers: {layers}",
            fix="choose others with --where \"layer = '...'\""
            if where
            else "export the floor plan of the model as DXF",
        )
    drawing = FloorDrawing(path.name, unit or stated or "m", stated is not None, lines, left_out)
    left, low, right, top = drawing.bounds_m
    extent = max(right - left, top - low)
    if (unit is None and stated is None) or extent > _FLOOR_MAX_M:
        raise _no_unit(path, extent / METRES[drawing.unit], stated, unit)
    return drawing


def _no_unit(path: Path, extent: float, stated: str | None, unit: str | None) -> InputError:
    """Return the error of a drawing whose unit nobody says, or is wrong; `extent` is its longer side in that unit."""
    usual = [u for u in ("m", "mm", "cm", "ft", "in") if _ROOM_M[0] <= extent * METRES[u] <= _ROOM_M[1]] or ["mm"]
    more = f" (or {', '.join(usual[1:])})" if usual[1:] else ""
    if stated is not None:
        return InputError(
            f"{path.name} would be {extent * METRES[stated]:,.0f} m long",
            code="E204",
            where=Where(str(path)),
            why=f"it says that its numbers are {stated} ($INSUNITS), and hardly any floor is so long",
            fix="set the unit of the drawing in the CAD program (UNITS), and export what belongs to the floor alone",
        )
    return InputError(
        f"{path.name} does not say its unit" if unit is None else f"{path.name} would be too long in {unit}",
        code="E204",
        where=Where(str(path)),
        why=f"$INSUNITS is missing or 0, and its longer side is {extent:,.6g}",
        fix=f"--unit {usual[0]}{more}",
    )


def _document(path: Path) -> tuple[Drawing, int]:
    """Return the drawing, and how many damaged things were left out of it."""
    try:
        from ezdxf import recover
        from ezdxf.filemanagement import readfile
        from ezdxf.lldxf.const import DXFError
    except ImportError:
        raise InputError(
            f"{path.name} is a drawing (DXF), and ezdxf is not installed",
            code="E204",
            where=Where(str(path)),
            fix='pip install "vsd-analytics[dxf]", or export the plan as SVG',
        ) from None
    n_bytes = path.stat().st_size
    if n_bytes > _BYTES_MAX:
        raise _too_large(path, f"{n_bytes:,} bytes; at most {_BYTES_MAX:,} are read")
    try:
        with path.open("rb") as file:
            is_binary = file.read(len(_BINARY)) == _BINARY
        if is_binary:
            document = readfile(path)
            return document, len(document.audit().errors)
        document, auditor = recover.readfile(path)
        return document, len(auditor.errors)
    except (OSError, EOFError, DXFError, ValueError, LookupError, TypeError, AttributeError, struct.error) as error:
        raise InputError(
            f"{path.name} is no whole drawing",
            code="E205",
            where=Where(str(path)),
            why=f"it is not DXF as programs write it: {str(error)[:200] or type(error).__name__}",
            fix="save it as DXF again (2018 or older, text)",
        ) from None


def _too_large(path: Path, what: str) -> InputError:
    return InputError(
        f"{path.name} has {what}",
        code="E206",
        where=Where(str(path)),
        why="a floor plan has some thousand lines; furniture, hatches and symbols may have millions",
        fix="export the layers of walls and doors alone",
    )


def _lines(
    path: Path, document: Drawing, where: Sequence[RowCondition], *, metres: float
) -> tuple[dict[str, list[Line]], dict[str, int]]:
    """Return the lines by layer, sorted by its name, and what is left out."""
    from ezdxf.disassemble import recursive_decompose

    lines: dict[str, list[Line]] = {}
    left_out: Counter[str] = Counter()
    off = {layer.dxf.name.lower() for layer in document.layers if layer.is_off() or layer.is_frozen()}
    n_points = 0
    for number, entity in enumerate(_parts(path, recursive_decompose(document.modelspace()))):
        if number >= _ENTITIES_MAX:
            raise _too_large(path, f"more than {_ENTITIES_MAX:,} parts")
        kind, layer = entity.dxftype(), str(entity.dxf.get("layer", "0"))
        values = {"layer": layer, "type": kind}
        if (layer.lower() in off and not where) or not all(_holds(c, values[c.column]) for c in where):
            left_out[f"on other layers ({layer[:40]})"] += 1
        elif kind in _NO_LINES:
            left_out[f"without lines ({kind.lower()})"] += 1
        else:
            for line in _corners(entity, metres):
                n_points += len(line)
                if n_points > _POINTS_MAX:
                    raise _too_large(path, f"more than {_POINTS_MAX:,} corners")
                lines.setdefault(layer, []).append(line)
    return dict(sorted(lines.items())), dict(left_out)


def _parts(path: Path, entities: Iterable[Any]) -> Iterator[Any]:
    """Yield the parts of a drawing.

    Raises:
        InputError: E205, a block contains itself.
    """
    try:
        yield from entities
    except RecursionError:
        raise InputError(
            f"{path.name} has a block that contains itself",
            code="E205",
            where=Where(str(path)),
            why="its lines never end",
            fix="explode the block in the program that drew it, and save it as DXF again",
        ) from None


def _holds(condition: RowCondition, value: str) -> bool:
    is_same = value.lower() == str(condition.value).lower()  # names of layers have no case
    return is_same if condition.sign in ("=", "==") else not is_same


def _corners(entity: Any, metres: float) -> Iterator[Line]:
    """Yield the lines of one thing; nothing for what has none, or is nowhere."""
    from ezdxf import path as paths

    try:
        outlines = paths.from_hatch(entity) if entity.dxftype() == "HATCH" else [paths.make_path(entity)]
        for part in outlines:
            for piece in part.sub_paths() if part.has_sub_paths else (part,):
                if not all(abs(v) * metres < _FARTHEST_M for p in piece.control_vertices() for v in (p.x, p.y)):
                    continue  # nowhere, or a curve that would be cut into endless pieces
                line = tuple((p.x * metres, p.y * metres) for p in piece.flattening(_FLAT_M / metres, segments=4))
                if len(line) > 1:
                    yield line
    except (
        TypeError,
        ValueError,
        ZeroDivisionError,
        OverflowError,
    ):  # a kind without lines, or one drawn with numbers that fit no curve
        return
