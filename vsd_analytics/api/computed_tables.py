"""Tables of some days that are no SQL file: figures with their statistics, the change log, added context."""

from __future__ import annotations

from typing import Final

COMPUTED_TABLES: Final = {
    "visits": "One row per area with visits = true: visits per open hour (M35) and dwell times (M36).",
    "queues": "One row per area with queue = true: people waiting (M39) and waiting times (M40).",
    "queue_hours": "The same by hour of the day.",
    "capacity": "One row per area or floor with a capacity: how full it was (M41).",
    "flow": "One row per area with visits = true and area that people go to next (M37).",
    "flow_links": "One row per estimated link over floor that no camera sees.",
    "lines": "One row per counting line: who crossed it in either direction (M57).",
    "footfall": "One row per counting line: a week beside its usual range and a year before (M60).",
    "footfall_weeks": "One row per counting line and week, of up to twelve weeks before it.",
    "footfall_next": "One row per counting line and day of the week after, with the crossings expected.",
    "hotspots": "One row per hotspot (M20) of the 28 days that end with the days asked for.",
    "changes": "One row per entry of the change log that was made in the days asked for.",
    "context": "One row per series of `vsd context add`, such as sales or weather, and local hour.",
    "context_days": "The same by local day.",
}
"""Tables that are figures with their statistics, the change log or added context: no SQL file."""
COMPUTED: Final = tuple(COMPUTED_TABLES)
