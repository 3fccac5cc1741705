"""Options of a detector, and the people that it finds in a source of pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
    from vsd_analytics.engine.people_of_pictures import PeopleOfPictures, SeenFrame
    from vsd_analytics.engine.pictures import PictureSource

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class ChosenDetector:
    """The options of a detector, as `detector_options` gives them.

    Attributes:
        model: File of ONNX; None = no detector.
        provider: Execution provider of onnxruntime; None = a GPU where there is one.
        score: Least score of a person; None = the default.
        tile_px: Side of tiles; None = by the size of people, 0 = the whole picture at once.
        n_threads: Processor threads.
    """

    model: Path | None
    provider: str | None
    score: float | None
    tile_px: int | None
    n_threads: int

    def opened(self) -> Detector:
        """Return the detector; UsageError E101 without a model."""
        from vsd_analytics.engine.detector import LEAST_SCORE, Detector

        if self.model is None:
            raise UsageError("no detector is given", fix="--detector model.onnx")
        return Detector(
            self.model,
            providers=None if self.provider is None else [self.provider],
            n_threads=self.n_threads,
            least_score=LEAST_SCORE if self.score is None else self.score,
        )


def detector_options(command: F) -> F:
    """Add the options of a detector to a command, which takes them as `detector`, `provider`, `score`, ..."""
    for option in (
        click.option("--threads", type=click.IntRange(min=1), default=1, help="Processor threads of the network."),
        click.option(
            "--tile",
            type=click.IntRange(min=0),
            metavar="PX",
            help="Side of the parts that the detector sees (0: whole).",
        ),
        click.option("--score", type=click.FloatRange(0, 1), help="Least score of a person (default: 0.45)."),
        click.option("--provider", metavar="NAME", help="Execution provider of onnxruntime, such as cuda or cpu."),
        path_option("--detector", metavar="MODEL", help="ONNX model that finds the people of a video or pictures."),
    ):
        command = option(command)
    return command


def chosen_detector(given: dict[str, Any]) -> ChosenDetector:
    """Take the options of a detector out of those of a command."""
    return ChosenDetector(
        model=given.pop("detector"),
        provider=given.pop("provider"),
        score=given.pop("score"),
        tile_px=given.pop("tile"),
        n_threads=given.pop("threads"),
    )


def people_of_source(
    project: Project, source: PictureSource, detector: Detector, *, hz: float, tile_px: int | None, quiet: bool
) -> PeopleOfPictures:
    """Return the people of a source, with a progress bar of frames and people."""
    from vsd_analytics.engine.people_of_pictures import SeenFrame, collected, rounded_px
    from vsd_analytics.engine.tiles import tiles_of

    tiles = tiles_of(source.size_px, side_px=tile_px or None, overlap_px=(tile_px or 0) // 4)
    with progress(None, total=source.n_pictures(hz), label="detecting", unit=" frames", quiet=quiet) as bar:
        n_people = 0

        def seen() -> Iterator[SeenFrame]:
            for shot in source.pictures(hz):
                detections = None if shot.picture is None else rounded_px(detector.people(shot.picture, tiles=tiles))
                yield SeenFrame(shot.number, shot.ms, detections, shot.name)

        def count_people(n: int) -> None:
            nonlocal n_people
            n_people += n
            bar.set_postfix(people=n_people, refresh=False)
            bar.update(1)

        return collected(seen(), on_frame=count_people)
