"""The homography from two ratios (Aghaei et al., Single Image Human Proxemics Estimation, WACV 2021, section 3.2).

The camera has no roll and no pan. It sees a floor rectangle of the picture's shape as a trapezoid on the picture's
bottom edge. Two conventions describe the trapezoid, and the same pair of numbers means different cameras in them:

* `share`, the paper's definition: horizontal = short base / long base, vertical = height of trapezoid / rectangle.
* `inset`, the published code's: one minus these. The tables of the paper are almost surely in this convention.

The floor plane it gives has no scale: it tells proportions, not metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vsd_analytics.engine.people import Array
from vsd_analytics.errors import UsageError

Convention = Literal["inset", "share"]
SMALLEST_SHARE: Final = 1e-3
"""Below, the trapezoid has no top or no height, and the map cannot be inverted."""


@dataclass(frozen=True, slots=True)
class Ratios:
    """The two numbers of a trapezoid, with their convention.

    Attributes:
        horizontal: Of the widths, 0 to 1.
        vertical: Of the heights, 0 to 1.
        convention: What they mean.

    Raises:
        UsageError: A number is outside 0 to 1, or the trapezoid has no area (E101).
    """

    horizontal: float
    vertical: float
    convention: Convention = "inset"

    def __post_init__(self) -> None:
        shares = self._shares()
        if not all(SMALLEST_SHARE <= share <= 1 for share in shares):
            raise UsageError(
                f"the ratios {self.horizontal:g} and {self.vertical:g} make no trapezoid",
                why="as inset both must be at least 0 and less than 1, as share more than 0 and at most 1",
                fix="--ratios 0.7,0.7 --convention inset",
            )

    def _shares(self) -> tuple[float, float]:
        if self.convention == "share":
            return self.horizontal, self.vertical
        return 1 - self.horizontal, 1 - self.vertical

    def homography(self, size_px: tuple[int, int]) -> Array:
        """Return the map from picture to floor plane, 3x3; the plane's unit is a pixel at the picture's bottom edge.

        With w = share of the widths, h = share of the heights and s = 1 - y/H, the floor point (x, y) of the W x H
        rectangle is seen at x' = W/2 + (x - W/2) / (1 + k s), y' = H - h (H - y) / w / (1 + k s), k = 1/w - 1.

        Args:
            size_px: Width W and height H of the picture.
        """
        width, height = (float(side) for side in size_px)
        w, h = self._shares()
        k = 1 / w - 1
        # third row times (x, y, 1) is 1 + k (1 - y/H); the first two follow from x' and y' above
        third = np.array([0.0, -k / height, 1 + k])
        first = np.array([1.0, 0.0, -width / 2]) + width / 2 * third
        second = height * third - (h / w) * np.array([0.0, -1.0, height])
        return np.asarray(np.linalg.inv(np.stack([first, second, third])))

    def __str__(self) -> str:
        return f"{self.convention} {self.horizontal:g}/{self.vertical:g}"
