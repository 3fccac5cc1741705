"""Options of a detector, and the people that it finds in a source of pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from vsd_analytics.cli.options import path_option
from vsd_analytics.cli.output import progress
from vsd_analytics.cli.project import Project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.engine.detector import Detector
    from vsd_analytics.engine.people_of_pictures import PeopleOfPictures
    from vsd_analytics.engine.pictures import PictureSource
    from vsd_analytics.engine.tiles import PictureTile
    from vsd_analytics.site.model import Camera

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class ChosenDetector:
    """The options of a detector, as `detector_options` gives them.

    Attributes:
        model: File of ONNX.
        joints: File of a second model, for the joints in each box.
        provider: Execution provider of onnxruntime; None = a GPU where there is one.
        least_score: Least score of a person; None = the default.
        tile_px: Side of tiles; None = by the size of people, 0 = the whole picture at once.
        n_threads: Processor threads.
    """

    model: Path
    joints: Path | None
    provider: str | None
    least_score: float | None
    tile_px: int | None
    n_threads: int | None

    def opened(self) -> Detector:
        """Return the detector."""
        from vsd_analytics.engine.detector import LEAST_SCORE, Detector

        return Detector(
            self.model,
            joints=self.joints,
            providers=None if self.provider is None else [self.provider],
            n_threads=self.n_threads or 1,
            least_score=LEAST_SCORE if self.least_score is None else self.least_score,
        )

    def tiles(self, detector: Detector, pictures: PictureSource, *, hz: float, camera: Camera) -> list[PictureTile]:
        """Return the parts of a picture that the detector looks at, by the size of people in this camera's pictures."""
        from vsd_analytics.engine.bodies import body_sizes_px
        from vsd_analytics.engine.people_of_pictures import tiles_of_source
        from vsd_analytics.engine.tiles import PictureTile, tiles_of

        size_px = pictures.size_px
        if self.tile_px == 0:
            return [PictureTile(0, 0, *size_px)]
        known = camera.calibrations[-1].homography if camera.calibrations else None
        body_px = None if known is None else body_sizes_px(known, size_px)
        if self.tile_px is not None:
            overlap = self.tile_px // 4 if body_px is None else round(body_px[1])
            return tiles_of(size_px, side_px=self.tile_px, overlap_px=(overlap // 2, overlap))
        return tiles_of_source(pictures, detector, hz=hz, body_px=body_px)


_OPTIONS = ("detector", "joints", "provider", "score", "tile", "threads")
_SETTINGS = (
    click.option("--threads", type=click.IntRange(min=1), metavar="N", help="Processor threads (default: 1)."),
    click.option(
        "--tile",
        type=click.IntRange(min=0),
        metavar="PX",
        help="Side of the parts of a picture that the detector looks at (default: by the size of people; 0: whole).",
    ),
    click.option(
        "--score", type=click.FloatRange(0, 1), metavar="SCORE", help="Least score of a person (default: 0.45)."
    ),
    click.option("--provider", metavar="NAME", help="Where it runs: cpu, cuda, ... of the installed onnxruntime."),
    path_option("--joints", metavar="MODEL", help="ONNX model that finds the joints in the boxes of the detector."),
)


def detector_settings(command: F) -> F:
    """Add the options of a detector to a command that has the model as its argument."""
    for option in _SETTINGS:
        command = option(command)
    return command


def detector_options(command: F) -> F:
    """Add --detector and its options to a command, which takes them by `chosen_detector`."""
    model = path_option("--detector", metavar="MODEL", help="ONNX model that finds people in a video or in pictures.")
    return model(detector_settings(command))


def chosen_detector(given: dict[str, Any]) -> ChosenDetector | None:
    """Return what the options of a detector choose; None without --detector.

    Raises:
        UsageError: Some of them are given without --detector (E101).
    """
    values = [given[name] for name in _OPTIONS]
    if values[0] is None:
        if spare := [name for name in _OPTIONS if given[name] is not None]:
            raise UsageError(
                f"--{spare[0]} belongs to --detector", fix=f"--detector model.onnx, or leave out --{spare[0]}"
            )
        return None
    return ChosenDetector(*values)


def people_of_source(
    project: Project,
    source: Path,
    chosen: ChosenDetector,
    *,
    hz: float,
    camera: Camera,
    journal_path: Path,
    quiet: bool,
) -> tuple[PeopleOfPictures, PictureSource]:
    """Return the people of a source of pictures, with a progress bar of frames and people.

    A run that was stopped left its frames at `journal_path`; this one goes on after them. Whoever has put the result
    where it belongs removes that file.
    """
    from vsd_analytics.engine.detection_journal import DetectionJournal, about_run
    from vsd_analytics.engine.people_of_pictures import PeopleOfPictures, seen_frames
    from vsd_analytics.engine.pictures import picture_source

    pictures, detector = picture_source(source), chosen.opened()
    tiles = chosen.tiles(detector, pictures, hz=hz, camera=camera)
    models = [chosen.model, *([] if chosen.joints is None else [chosen.joints])]
    parts = [[tile.left, tile.top, tile.right, tile.bottom] for tile in tiles]
    about = about_run(source, models, hz=hz, least_score=detector.least_score, tiles=parts)
    journal = DetectionJournal(journal_path, about)
    people = PeopleOfPictures()
    try:
        with progress(
            None, total=pictures.n_pictures(hz), label="detecting", unit=" frames", quiet=project.quiet or quiet
        ) as bar:
            n_people = 0
            if journal.frames:
                project.say(f"going on after frame {journal.last}, where an earlier run was stopped")
            frames = seen_frames(pictures, detector, hz=hz, tiles=tiles, after=journal.last)
            for frame in [*journal.frames]:
                people.add(frame)
                bar.update(1)
            for frame in frames:
                journal.add(frame)
                people.add(frame)
                n_people += 0 if frame.detections is None else len(frame.detections)
                bar.set_postfix(people=n_people, refresh=False)
                bar.update(1)
    finally:
        journal.close()
    return people, pictures


def journal_path(project: Project, source: Path, camera_id: str, out: Path | None) -> Path:
    """Return where a run keeps what it has found so far: beside its result, or in the project folder."""
    if out is not None:
        return out.with_name(f"{out.name}.part")
    return project.root / f".{camera_id}-{source.stem}.part"


def store_messages(project: Project, text: bytes, *, name: str) -> int:
    """Put frame messages into the store; return how many records are new.

    Raises:
        VsdError: They were not stored.
    """
    import tempfile

    from vsd_analytics.ingest.intake.pipeline import ingest
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    with tempfile.TemporaryDirectory(dir=project.root, prefix=".engine-") as folder:
        path = Path(folder) / name
        path.write_bytes(text)
        result = ingest(project.site, [path], IngestOptions(), now=project.now, is_dry_run=False)
    for source in result.sources:
        if source.error is not None:
            raise source.error
        for note in source.notes:
            project.say(note)
    return result.fold.n_new
