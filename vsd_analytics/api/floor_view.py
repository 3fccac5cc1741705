"""What lies over the cells of a map: the ink of a floor, or a camera's picture."""

from __future__ import annotations

import io
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import UsageError
from vsd_analytics.figures.week.model_map import FloorMap, MapImage
from vsd_analytics.geometry import camera_views
from vsd_analytics.geometry.embedded_pictures import picture_image
from vsd_analytics.geometry.homography import to_image
from vsd_analytics.report.draw.cell_map import floor_ink
from vsd_analytics.site.model import Calibration, Camera, Floor, Site

INK_PX: Final = 2000
"""Width of a plan that is drawn over an array."""


def ink(shown: FloorMap) -> NDArray[np.uint8]:
    """Return the plan, fixtures and areas of a floor as a picture on clear ground, shape (height, width, 4)."""
    import matplotlib as mpl
    import resvg_py
    from PIL import Image

    font = Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    png = resvg_py.svg_to_bytes(
        svg_string=str(floor_ink(shown)),
        width=INK_PX,
        font_files=[str(font)],
        font_family="DejaVu Sans",
        skip_system_fonts=True,
    )
    with Image.open(io.BytesIO(bytes(png))) as opened:
        return np.asarray(opened.convert("RGBA"))


def picture_view(site: Site, camera_id: str, *, floor: Floor, until: date) -> PictureView:
    """Return the picture of a camera with the calibration in force at the end of a day.

    Raises:
        UsageError: E101, the floor has no such camera, or the camera has no picture or no calibration.
    """
    cameras = {c.camera_id: c for c in site.cameras if c.floor_id == floor.floor_id}
    if camera_id not in cameras:
        fix = f'over="plan", or a camera: {", ".join(cameras)}'
        raise UsageError(f"a map cannot be drawn over {camera_id!r}", fix=fix)
    camera = cameras[camera_id]
    end = _end_of(until, site)
    known = [c for c in camera.calibrations if c.valid_from is None or c.valid_from < end]
    if camera.picture is None or not known:
        lacks = "picture" if camera.picture is None else "calibration"
        raise UsageError(f"{camera.name} has no {lacks}", fix=f"name its {lacks} in vsd.toml")
    if camera.planes:
        why = "its picture shows several planes, and the map is of one"
        raise UsageError(f"a map cannot be drawn over the picture of {camera.name}", why=why, fix='over="plan"')
    return PictureView(camera, known[-1])


class PictureView:
    """A camera's picture, and where places of the floor are in it.

    Args:
        camera: The camera; it has a picture.
        calibration: Its calibration.
    """

    def __init__(self, camera: Camera, calibration: Calibration) -> None:
        assert camera.picture is not None
        uri, size = picture_image(camera.picture, width_px=1280)
        self.camera = camera
        self._calibration = calibration
        self.size_px = camera.picture_px or size
        extent = (0.0, 0.0, float(self.size_px[0]), float(self.size_px[1]))
        image = MapImage(data_uri=uri, extent=extent)
        self.shown = FloorMap(kind="picture", title=camera.name, extent=extent, image=image)

    def pixels(self) -> Any:
        """Return the picture as an array, shape (height, width, 3)."""
        from PIL import Image

        assert self.camera.picture is not None
        with Image.open(self.camera.picture) as opened:
            return np.asarray(opened.convert("RGB"))

    def corners_px(self, corners_m: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Return which cells the camera sees whole, and the corners of these in its picture.

        Args:
            corners_m: Corners of cells in floor metres, shape (n, 4, 2).

        Returns:
            Shape (n,), and pixels of shape (number of cells seen, 4, 2).
        """
        import shapely

        view = camera_views.view_polygon(self.camera, calibration=self._calibration)
        homography = self._calibration.homography
        inside = shapely.contains_xy(view, corners_m[..., 0], corners_m[..., 1]).all(axis=1)
        px = to_image(homography, corners_m[inside].reshape(-1, 2), picture_px=self.size_px).reshape(-1, 4, 2)
        return inside, px


def _end_of(day: date, site: Site) -> datetime:
    return datetime.combine(day + timedelta(days=1), time(), tzinfo=site.zone) - timedelta(seconds=1)
