"""Checks of pixels by the floor that the camera's calibration makes of them (W226)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.ingest.checks.axis_checks import AXIS_CHECKS
from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceCheck, SourceWarning, is_in_picture
from vsd_analytics.ingest.checks.frame_checks import SEVERAL_FRAMES
from vsd_analytics.ingest.checks.place_checks import UNIT_CHECK
from vsd_analytics.site.model import Camera

SKY_SHARE: Final = 0.1


def _on_the_floor(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN or not any(c.calibrations for c in case.cameras):
        return
    floor_m, is_seen = sample.floor_m.copy(), np.zeros(sample.n, dtype=bool)
    for camera in case.cameras:
        is_its = sample.camera.is_in([camera.camera_id, *camera.engine_ids])
        floor_m[is_its] = _floor_m(camera, sample.picture_px[is_its])
        if camera.calibrations:
            is_seen |= is_its & ~np.isnan(sample.picture_px[:, 0])
    if not is_seen.any():
        return
    fix = (
        "vsd check FILE --picture where.svg shows them: feet, u to the right, v downwards, in pictures of the size of "
        "the calibration; else calibrate again"
    )
    sky = float(np.isnan(floor_m[is_seen, 0]).mean())
    if sky > SKY_SHARE:
        what = f"{sky:.0%} of the positions are above the horizon of the calibration"
        yield SourceWarning(what, "nobody can be in the sky", fix, is_sure=sky > 0.5)
        return
    on_floor = replace(case, sample=replace(sample, floor_m=floor_m), head=None)
    for check in (UNIT_CHECK, *AXIS_CHECKS):
        for warning in check.find(on_floor) if check.applies(on_floor) else ():
            yield replace(warning, what=f"by the calibration, {warning.what}", fix=fix)
    yield from SEVERAL_FRAMES.warnings(on_floor)


def _floor_m(camera: Camera, uv_px: np.ndarray) -> np.ndarray:
    """Return floor metres by the camera's latest calibration, NaN in the sky and without one."""
    if not camera.calibrations or not len(uv_px):
        return np.full((len(uv_px), 2), np.nan)
    return to_floor(camera.calibrations[-1].homography, uv_px, picture_px=camera.picture_px)


CALIBRATION_CHECKS: Final = (
    SourceCheck(
        "W226",
        is_in_picture,
        _on_the_floor,
        "pixels that are outside the floor, inside fixtures or in the sky by the calibration",
    ),
)
