"""The method of Aghaei et al. 2021, whole: foot points, a part of the body as measure, safe spaces that overlap."""

from __future__ import annotations

import numpy as np

from vsd_analytics.engine.body import PART_M, Part, ground_points, is_valid, part_px
from vsd_analytics.engine.people import People
from vsd_analytics.engine.ratios import Ratios
from vsd_analytics.engine.safe_space import SafeSpaces, near_pairs, safe_spaces
from vsd_analytics.engine.seen import Seen


def spaces_of(people: People, *, ratios: Ratios, size_px: tuple[int, int], part: Part, distance_m: float) -> SafeSpaces:
    """Return the safe space of each person, with a radius of half the distance."""
    return safe_spaces(
        ratios.homography(size_px),
        ground_points(people),
        part_px(people, part),
        length_m=PART_M[part],
        radius_m=distance_m / 2,
        picture_px=size_px,
    )


def valid_people(people: People) -> tuple[People, dict[str, int]]:
    """Return the persons that count by the paper's rule, and how many do not."""
    valid = is_valid(people)
    n_out = int((~valid).sum())
    return people.rows(valid), {"fewer than 13 joints, or no foot": n_out} if n_out else {}


def detect(
    people: People,
    *,
    ratios: Ratios,
    size_px: tuple[int, int],
    part: Part,
    distance_m: float = 2.0,
    within_m: float | None = None,
) -> Seen:
    """Return the pairs of people whose safe spaces overlap, with approximate distances.

    A person without the part of the body has a place and no pair.

    Args:
        people: As detected.
        ratios: The homography's two ratios.
        size_px: Width and height of the picture.
        part: What measures: torso, leg, arm, or the height of the box.
        distance_m: Two persons nearer than this violate; a safe space has half of it as its radius.
        within_m: Pairs up to this distance are returned, so that smaller ones can be studied; None = `distance_m`.
    """
    counted, left_out = valid_people(people)
    spaces = spaces_of(counted, ratios=ratios, size_px=size_px, part=part, distance_m=distance_m)
    no_part = np.isnan(part_px(counted, part))
    above = ~no_part & np.isnan(spaces.radius)
    for why, rows in ((f"no {part} to measure by: no pairs", no_part), ("at or above the horizon: no pairs", above)):
        if rows.any():
            left_out[why] = int(rows.sum())
    near = near_pairs(spaces, counted.frame, within_m=distance_m if within_m is None else within_m)
    return Seen(
        people=counted,
        uv=ground_points(counted),
        xy=None,
        a=near.a,
        b=near.b,
        distance_m=near.distance_m,
        quality="relative",
        engine=f"vsd-paper {ratios} {part}",
        left_out=left_out,
        spaces=spaces,
    )
