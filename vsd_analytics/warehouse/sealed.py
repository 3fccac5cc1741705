"""Sealed facts of a range: those of purged hours, and which of them were computed by other rules than today's."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from vsd_analytics.site.model import Site
from vsd_analytics.store.seals import DAY_FACT, FOLDER, Seals, UnitSeal
from vsd_analytics.warehouse.input_fingerprint import InputHashes, SiteInputs, fact_inputs, stale_reason
from vsd_analytics.warehouse.sqlfiles import relations


@dataclass(frozen=True, slots=True)
class SealedRange:
    """What is sealed of a range of UTC hours.

    Attributes:
        hours: Sealed hours by UTC hour number.
        days: The sealed fact `camera_days`, by UTC day number.
        whole_days: UTC days that are sealed as a whole. No fact of them is computed again, not even of an hour without
            records: late records for it are refused.
    """

    hours: Mapping[int, UnitSeal] = field(default_factory=dict)
    days: Mapping[int, UnitSeal] = field(default_factory=dict)
    whole_days: frozenset[int] = frozenset()

    def holds(self, hour: int) -> bool:
        """Return whether the facts of a UTC hour are sealed, so that a build must not compute them."""
        return hour in self.hours or hour // 24 in self.whole_days

    def fact_paths(
        self,
        site: Site,
        relation: str,
        *,
        first_hour: int | None = None,
        last_hour: int | None = None,
        formerly_in: str = "",
    ) -> list[tuple[int, Path]]:
        """Return the files of one sealed fact, in order, each once with its first UTC hour number in the range.

        A file of hours that were sealed together also has those beyond the ends of the range. Hours that were sealed
        before the fact existed have no file of it and are left out.

        Args:
            site: The project.
            relation: The fact.
            first_hour: First UTC hour number of the range; None = open.
            last_hour: Last one, inclusive; None = open.
            formerly_in: The fact that had its columns before: its files of hours that were sealed without the fact.
        """
        seals = Seals(site.root / FOLDER, site_id=site.site_id)
        units = {d * 24: u for d, u in self.days.items()} if relation == DAY_FACT else self.hours
        hours: dict[Path, int] = {}
        for hour, unit in sorted(units.items()):
            is_after = first_hour is None or hour >= first_hour
            name = relation if relation in unit.facts else formerly_in
            if is_after and (last_hour is None or hour <= last_hour) and name in unit.facts:
                hours.setdefault(seals.fact_path(name, hour, unit), hour)
        return [(hour, path) for path, hour in hours.items()]


def sealed_range(site: Site, first_hour: int | None, last_hour: int | None) -> SealedRange:
    """Return what is sealed of the hours in [first_hour, last_hour]; None = open.

    Raises:
        StoreError: E313, a seal is damaged.
    """
    seals = list(Seals(site.root / FOLDER, site_id=site.site_id).seals(first_hour, last_hour))
    return SealedRange(
        {
            hour: unit
            for seal in seals
            for hour, unit in seal.hours.items()
            if (first_hour is None or hour >= first_hour) and (last_hour is None or hour <= last_hour)
        },
        {seal.day: seal.camera_days for seal in seals if seal.camera_days is not None},
        frozenset(seal.day for seal in seals if seal.is_whole),
    )


class CurrentRules:
    """The rules by which facts would be computed today: SQL, settings, cameras, calibrations."""

    def __init__(self, site: Site) -> None:
        needed = fact_inputs(site, [r.name for r in relations("facts").values() if r.unit == "hour"])
        self._shared = {"sql": needed.sql, "settings": needed.settings}
        self._times = SiteInputs(site)

    def of_hour(self, hour: int, *, present: Collection[str]) -> InputHashes:
        """Return a hash of each rule for a UTC hour in which the cameras `present` had records."""
        return {**self._shared, **self._times.of_hour(hour, present=present)}

    def changed(self, hour: int, unit: UnitSeal) -> tuple[str, ...]:
        """Return the kinds of rules that changed since an hour was sealed, of `STALE_REASONS`.

        A kind that its seal does not know is one that no fact read then.
        """
        today = self.of_hour(hour, present=unit.cameras)
        return tuple(c for c in today if unit.causes.get(c, today[c]) != today[c])


@dataclass(frozen=True, slots=True)
class OtherRules:
    """A run of sealed hours that were computed by other rules than today's; without records they cannot be redone.

    Attributes:
        first_hour, last_hour: First and last of them, UTC hour numbers.
        n_hours: Number of sealed hours in the run.
        changed: Kinds of rules that changed since, of `STALE_REASONS`.
    """

    first_hour: int
    last_hour: int
    n_hours: int
    changed: tuple[str, ...]

    def warning(self, site: Site) -> str:
        """Return the warning for users, in the site's local time."""
        first, last = (
            datetime.fromtimestamp(s, tz=site.zone) for s in (self.first_hour * 3600, self.last_hour * 3600 + 3600)
        )
        hours = f"{self.n_hours:,} hour{'' if self.n_hours == 1 else 's'}"
        return (
            f"{hours} between {first:%Y-%m-%d %H:%M} and {last:%Y-%m-%d %H:%M} stand as they were sealed by a purge, "
            f"and since then: {stale_reason(self.changed)}; do not compare them with newer ones"
        )


def other_rules(site: Site, sealed: SealedRange, *, first_hour: int, last_hour: int) -> list[OtherRules]:
    """Return the runs of sealed hours in [first_hour, last_hour] that were computed by other rules than today's."""
    runs: list[OtherRules] = []
    # One run is one warning: hours in a row with the same changes. Hours under today's rules end it.
    rules, before = CurrentRules(site), tuple[str, ...]()
    for hour, unit in sorted(sealed.hours.items()):
        if not first_hour <= hour <= last_hour:
            continue
        changed = rules.changed(hour, unit)
        if changed and changed == before:
            runs[-1] = OtherRules(runs[-1].first_hour, hour, runs[-1].n_hours + 1, changed)
        elif changed:
            runs.append(OtherRules(hour, hour, 1, changed))
        before = changed
    return runs
