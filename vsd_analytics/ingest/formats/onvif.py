"""ONVIF analytics metadata: XML documents of `tt:MetadataStream` with `tt:Frame` and `tt:Object`.

A file has one document or many, one after the other, as recorders write them. The document is read as it comes, never
as a whole, and documents that declare types or entities are refused. Persons are objects of class Human. An object
whose class comes in some frames only keeps it. Parts of persons (`Parent`), such as heads, are left out. Boxes are
shares of the picture from -1 to 1, or device units that `tt:Transformation` turns into them; y goes up. `UtcTime` is
UTC, also where it has no offset. Frames of another lens (`VideoSourceToken`) than the first are refused where all go to
one camera.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from typing import IO, Any
from xml.parsers import expat

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Source, bytes_read
from vsd_analytics.ingest.reading.frame_rows import FrameRows, SeenPerson, finite, instant_of, size_of
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.reasons import NO_CLASS, NOT_A_PERSON, PART_OF_A_PERSON

READ_BYTES = 1 << 16
PERSONS = frozenset({"human", "humanbody", "person", "pedestrian"})
NO_BOX = "person in a cropped picture, without a box"
_SIDES = ("left", "top", "right", "bottom")
_NO_PARENT = frozenset({None, "", "0"})
"""What cameras write as `Parent` of an object that is a part of nothing."""
_END = re.compile(rb"</(?:[\w.-]+:)?MetadataStream\s*>")
_START = re.compile(rb"<(?:[\w.-]+:)?MetadataStream[\s>]")
_TAIL_BYTES = 256


@dataclass(slots=True)
class _Object:
    """One object of the frame that is being read."""

    object_id: str | None
    parent: str | None
    kinds: list[tuple[float, str]] = field(default_factory=list)
    box: dict[str, str] | None = None

    @property
    def is_pictured_only(self) -> bool:
        """Return whether all sides of the box are 0, as cameras write beside a cropped picture (`ImageRef`)."""
        return self.box is not None and all(self.box.get(side, "").strip("0.") == "" for side in _SIDES)


class Onvif:
    """Adapter of ONVIF metadata."""

    name = "onvif"
    coordinates = "shares of the picture (-1 to 1), foot point = bottom centre of the box"
    uses = frozenset({"zone", "period_s", "size_px"})

    def detects(self, source: Source) -> bool:
        """Return whether the first bytes have the start of a metadata stream."""
        return source.path.is_file() and _START.search(source.head()) is not None

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the frames. A document that is no XML goes to quarantine from there to its end.

        Raises:
            InputError: E205, E206, the compressed file is damaged.
        """
        frames = FrameRows(options, engine="ONVIF")
        documents = _Documents(frames, options)
        with source.open() as stream:
            try:
                for data in _pieces(stream):
                    documents.feed(data)
                    if frames.n_rows >= BATCH_ROWS:
                        yield frames.batch(bytes_read(stream))
            except InputError:
                yield frames.batch(bytes_read(stream))  # what came before the damage
                raise
            documents.close()
            yield frames.batch(source.size_bytes)


def _pieces(stream: IO[bytes]) -> Iterator[bytes]:
    while data := stream.read1(READ_BYTES):  # type: ignore[attr-defined]
        yield data


class _Documents:
    """Feeds documents to a parser of their own each."""

    def __init__(self, frames: FrameRows, options: IngestOptions) -> None:
        self._frames, self._options = frames, options
        self._held = b""
        self._reader: _Reader | None = None
        self._n_frames = 0

    def feed(self, data: bytes) -> None:
        """Take more bytes; the end of a document may be cut in two, so the last ones wait."""
        self._held += data
        while (end := _END.search(self._held)) is not None:
            self._some(self._held[: end.end()], is_last=True)
            self._held = self._held[end.end() :]
        if len(self._held) > _TAIL_BYTES:
            self._some(self._held[:-_TAIL_BYTES], is_last=False)
            self._held = self._held[-_TAIL_BYTES:]

    def close(self) -> None:
        """Take what is left at the end of the file: a document without its end is bad."""
        if self._held.strip() or self._reader is not None:
            self._some(self._held, is_last=True)

    def _some(self, data: bytes, *, is_last: bool) -> None:
        if self._reader is None:
            data = data.removeprefix(b"\xef\xbb\xbf").lstrip()
            if not data:
                return
            self._reader = _Reader(self._frames, self._options, self._n_frames)
        self._reader.feed(data, is_last=is_last)
        self._n_frames = self._reader.n_frames
        if is_last:
            self._reader = None


class _Reader:
    """Reads one document."""

    def __init__(self, frames: FrameRows, options: IngestOptions, n_frames: int) -> None:
        self._frames, self._options = frames, options
        self.n_frames = n_frames
        self._is_bad = False
        self._n_waiting = 0
        self._text: list[str] | None = None
        self._likelihood = 0.0
        self._clear()
        self._parser = expat.ParserCreate(namespace_separator="}")
        self._parser.StartDoctypeDeclHandler = _refuse
        self._parser.EntityDeclHandler = _refuse
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters

    def _clear(self) -> None:
        self._at: datetime | None = None
        self._wrong: BadRowError | None = None
        self._camera: str | None = None
        self._view: str | None = None
        self._objects: list[_Object] = []
        self._translate, self._scale = (0.0, 0.0), (1.0, 1.0)
        self._is_in_frame = self._is_class = False

    def feed(self, data: bytes, *, is_last: bool) -> None:
        """Parse more bytes of the document; once it is bad, the rest of it is skipped."""
        if self._is_bad:
            return
        self._n_waiting += len(data)
        try:
            if self._n_waiting > self._options.line_max_bytes + len(data):
                raise BadRowError("bad-xml", "an element is longer than line_max_bytes")
            self._parser.Parse(data, is_last)
        except expat.ExpatError as error:
            self._bad("bad-xml", f"this is no XML: {error}", data)
        except BadRowError as bad:
            reason, detail = bad.args
            self._bad(reason, detail, data)

    def _bad(self, reason: str, detail: str, data: bytes) -> None:
        self._is_bad = True
        self._frames.reject(self.n_frames + 1, reason, detail, data[:2000])

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._n_waiting = 0
        tag = name.rpartition("}")[2]
        if tag == "Frame":
            self._clear()
            self._is_in_frame = True
            self.n_frames += 1
            self._view = attributes.get("VideoSourceToken")
            self._camera = self._camera_of(attributes) if self._options.camera is None else None
            self._guarded(lambda: setattr(self, "_at", self._instant(attributes.get("UtcTime"))))
        elif not self._is_in_frame:
            return
        elif tag == "Object":
            parent = attributes.get("Parent")
            self._objects.append(_Object(attributes.get("ObjectId"), None if parent in _NO_PARENT else parent))
        elif tag in ("Translate", "Scale"):
            self._guarded(lambda: setattr(self, f"_{tag.lower()}", _numbers(attributes, "x", "y")))
        elif tag == "BoundingBox" and self._objects and self._objects[-1].box is None:
            self._objects[-1].box = attributes
        elif tag == "Class":
            self._is_class = True
        elif tag == "Type" and self._is_class:
            self._text = []
            self._guarded(lambda: setattr(self, "_likelihood", finite(attributes.get("Likelihood", "0"))))
        elif tag == "Likelihood" and self._is_class:
            self._text = []

    def _camera_of(self, attributes: dict[str, str]) -> str | None:
        """Return the lens that a frame is of, else the module that made it; the one that vsd.toml knows comes first."""
        named = [n for key in ("VideoSourceToken", "Source") if (n := attributes.get(key))]
        return next((n for n in named if n in self._options.clocks), named[0] if named else None)

    def _instant(self, text: str | None) -> datetime:
        at = instant_of(text)
        return at.replace(tzinfo=UTC) if at.tzinfo is None and self._options.zone is None else at

    def _characters(self, data: str) -> None:
        if self._text is not None:
            self._text.append(data)

    def _end(self, name: str) -> None:
        tag = name.rpartition("}")[2]
        text = "".join(self._text or ()).strip()[:100]
        if tag == "Type" and self._text is not None and self._objects:
            self._objects[-1].kinds.append((self._likelihood, text.lower()))
        elif tag == "Likelihood" and self._text is not None and self._objects and self._objects[-1].kinds:
            # the older ClassCandidate has the likelihood after the type, as an element
            _, kind = self._objects[-1].kinds.pop()
            self._guarded(lambda: self._objects[-1].kinds.append((finite(text), kind)))
        elif tag == "Class":
            self._is_class = False
        elif tag == "Frame" and self._is_in_frame:
            self._finish()
        if tag in ("Type", "Likelihood"):
            self._text = None

    def _guarded(self, take: Any) -> None:
        """Take a value; a wrong one spoils its frame and no other."""
        try:
            take()
        except BadRowError as bad:
            self._wrong = self._wrong or bad

    def _finish(self) -> None:
        """Add the frame that ends; what cannot be used goes to quarantine."""
        for reason, detail in self._frames.attempt(self._add):
            self._frames.reject(self.n_frames, reason, detail, f"frame {self._at} with {len(self._objects)} objects")
        self._clear()

    def _add(self) -> None:
        if self._wrong is not None:
            raise self._wrong
        assert self._at is not None
        self._frames.check_view(self._view)
        seen, others = [], {NOT_A_PERSON: 0, NO_CLASS: 0, PART_OF_A_PERSON: 0, NO_BOX: 0}
        for each in self._objects:
            kind = self._kind(each)
            is_staff = self._options.is_staff(kind)
            is_person = kind in PERSONS or is_staff
            if each.parent is not None:
                others[PART_OF_A_PERSON] += 1
            elif is_person and each.is_pictured_only:
                others[NO_BOX] += 1
            elif is_person:
                seen.append(self._frames.person(partial(self._person, each, is_staff)))
            else:
                others[NOT_A_PERSON if kind else NO_CLASS] += 1
        self._frames.add(self._camera, self._at, seen, line=self.n_frames)
        self._frames.dropped.update(others)

    def _kind(self, each: _Object) -> str:
        """Return the class of an object: the most likely of this frame, else that of an earlier one; "" = unknown."""
        return self._frames.kind_of(each.object_id, max(each.kinds)[1] if each.kinds else "")

    def _person(self, each: _Object, is_staff: bool | None) -> SeenPerson:
        return SeenPerson(each.object_id, None, self._foot(each), is_staff)

    def _foot(self, each: _Object) -> tuple[float, float]:
        """Return the bottom centre of an object's box in pixels, right and down."""
        if each.box is None:
            raise BadRowError("no-position", "the object has no box")
        (move_x, move_y), (scale_x, scale_y) = self._translate, self._scale
        is_transformed = (scale_x, scale_y) != (1.0, 1.0)
        frame_px = (
            (round(2 / abs(scale_x)), round(2 / abs(scale_y))) if is_transformed and scale_x and scale_y else None
        )
        width, height = size_of(self._options, self._camera, message_px=frame_px)
        left, top, right, bottom = _numbers(each.box, *_SIDES)
        x = (left + right) / 2 * scale_x + move_x
        y = min(top * scale_y + move_y, bottom * scale_y + move_y)  # vendors differ in which way y goes
        if not (abs(x) <= 1.5 and abs(y) <= 1.5):
            raise BadRowError("out-of-range", f"a box is at {x:g}, {y:g}; after its transformation it lies in -1 to 1")
        return (x + 1) / 2 * width, (1 - y) / 2 * height


def _numbers(attributes: dict[str, str], *names: str) -> tuple[float, ...]:
    return tuple(finite(attributes.get(name)) for name in names)


def _refuse(*_: object) -> None:
    raise BadRowError("bad-xml", "the document declares types or entities, which ONVIF metadata never do")
