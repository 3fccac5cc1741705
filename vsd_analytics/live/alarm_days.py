"""Rules over stored days: their alarms, those of the same rules with more patience, and the hours that have records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from datetime import date, datetime

from vsd_analytics.figures.alarms import AlarmDays, local_hour_ms, longer_waits
from vsd_analytics.live.events import AlarmEvent, alarms_of
from vsd_analytics.live.stored_frames import replay
from vsd_analytics.site.model import AlarmRule, Site
from vsd_analytics.warehouse.stored_days import calendar_days, days_of


def alarm_days(
    site: Site,
    first: date,
    last: date,
    *,
    rules: Sequence[AlarmRule],
    now: datetime,
    on_time: Callable[[int], None] | None = None,
) -> AlarmDays:
    """Return what rules give over stored days, from one reading of the records.

    A rule with a longer `for_s` is a rule of its own on the same records, so its count is exact: an alarm that a
    cool-down held back may be in it, and is not among the alarms of the rule as it is.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        rules: Rules to apply.
        now: The clock: later records are not read.
        on_time: As for `replay`.

    Raises:
        StoreError: E302, a file of the store is damaged.
    """
    variants = {_variant_id(rule, for_s): (rule, for_s) for rule, for_s in longer_waits(rules)}
    tried = [replace(rule, alarm_id=variant_id, for_s=for_s) for variant_id, (rule, for_s) in variants.items()]
    recorded: set[tuple[str, int]] = set()

    def note(until_ms: int, cameras: Collection[str]) -> None:
        hour_ms = local_hour_ms(until_ms - 1, site)
        recorded.update((camera_id, hour_ms) for camera_id in cameras)

    events: list[AlarmEvent] = []
    runs = calendar_days(site, first, last, spare_days=0)
    for run in runs if rules else []:
        options = {"rules": rules, "variants": tried, "now": now, "on_time": on_time, "on_records": note}
        events += replay(site, run.first_day, run.last_day, **options)  # type: ignore[arg-type]
    waited = Counter({e.alarm: e.rule for e in events if e.rule in variants}.values())
    return AlarmDays(
        rules=rules,
        days=days_of(runs, first, last),
        alarms=alarms_of([e for e in events if e.rule not in variants], site.zone),
        n_waited={(rule.alarm_id, for_s): waited[variant_id] for variant_id, (rule, for_s) in variants.items()},
        recorded=recorded,
        now=now,
    )


def _variant_id(rule: AlarmRule, for_s: float) -> str:
    """Return an id that no rule of `vsd.toml` can have."""
    return f"{rule.alarm_id}/{for_s:g}"
