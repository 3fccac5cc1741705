"""The rules of facts that are no settings: each number is written here once, for queries and for numpy alike.

Queries read them from `params`, next to the settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

RULES: Final[Mapping[str, int]] = {
    # A gap of up to 2.5 frame intervals is bridged whatever the settings say: one frame may be lost.
    # Proven over frame rates: docs/statistics.md.
    "gap_half_intervals": 5,
    # The next frame is at most 2 frame intervals off; beyond, a frame counts as one interval.
    "next_half_intervals": 4,
    # An hour depends on its neighbours alone, so a longer frame interval than 20 minutes counts as 20 minutes.
    "longest_interval_ms": 1_200_000,
    # Frame interval of a camera with one frame a day.
    "unknown_interval_ms": 1000,
    # More people than this are too many for all pairs: what bounds the time, not a figure.
    "crowd_people": 40,
    # A pair that was closer than distance_m has parted 0.3 m beyond it: three times a usual error of a place.
    "parting_mm": 300,
    # How well two cameras agree on a place; proven on real recordings (tests/realdata/prove_cameras.py).
    "same_place_mm": 500,
    # How far a place may be carried on to the next record: after 4 s people may be anywhere.
    "same_step_ms": 4000,
    # How long a pair stays where it was last seen.
    "same_stay_ms": 1000,
    # Two tracks of two cameras are one person where both place it within 0.35 m for 3 s, and a third track is 0.3 m
    # farther away. Cameras whose nearest tracks are more than 0.25 m apart in the middle join nothing: their places or
    # clocks disagree. Proven on real and simulated cameras (tests/realdata/prove_joined_views.py).
    "view_place_mm": 350,
    "view_margin_mm": 300,
    "view_error_mm": 250,
    "view_seconds": 3,
    # A person has two tracks of one camera at once for no longer than this.
    "view_twice_ms": 1000,
    # A cut track id begins again within 1.5 frame intervals, from 1 s to 10 s.
    "cut_half_intervals": 3,
    "cut_least_ms": 1000,
    "cut_most_ms": 10_000,
    # How well a camera knows a place, and how far a walker leaves its straight way in a second.
    "cut_place_mm": 500,
    "cut_mm_per_s": 300,
    # The speed at either end of a track is that of its last second; over a cut it changes by less than a turn round.
    "cut_speed_ms": 1000,
    "cut_turn_mm_per_s": 1000,
    # An id that stays within 0.35 m of another one in 4 of 5 of its records is a second id of that person: bodies are
    # as deep. No pair of true ids of nine recordings does (tests/realdata/prove_recorded_encounters.py).
    "double_mm": 350,
    "double_thousandths": 800,
    "double_records": 3,
    # Who is standing together is judged by windows of 2 minutes, an hour has a whole number: 3 or 4 find as much.
    "company_window_ms": 120_000,
    # Closer than 2 m for 30 s of them: who passes by is gone sooner.
    "company_least_ms": 30_000,
    "company_least_records": 3,
    # Farther apart than 2 m counts as 2 m, whatever distance_m is.
    "company_reach_mm": 2000,
    # A counting line is crossed from 0.25 m on one side to 0.25 m on the other: nearer, places waver around it. An id
    # that ends within 2 m of a line goes on in one that begins within 10 s, 0.5 m and 0.5 m/s off its way.
    # With 4 minutes on the line an hour needs no more than 5 minutes of its neighbours (tests/realdata/prove_lines.py).
    "line_margin_mm": 250,
    "line_near_mm": 2000,
    "line_lost_ms": 10_000,
    "line_stand_ms": 240_000,
    "line_place_mm": 500,
    "line_mm_per_s": 500,
    # A step over a line that nobody can run is an id that went to somebody else.
    "line_leap_mm_per_s": 5000,
    # After 5 minutes of silence over an hour's edge, message_gaps decides whether a lower number is a new count.
    "number_silence_ms": 300_000,
}
"""Rule to number, in the unit that its name ends with."""
