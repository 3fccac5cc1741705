"""The soak's outcome as Markdown."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from soak_producer import Load
from soak_truth import Ranges, Sums


@dataclass
class Life:
    """One incarnation of the listener."""

    pid: int
    began_s: float
    ended_s: float = 0.0
    status: dict[str, Any] = field(default_factory=dict)
    peak_mb: float = 0.0
    end: str = "running"
    folds: dict[int, tuple[float, float]] = field(default_factory=dict)


@dataclass
class Event:
    """A fault and what it took to get over it."""

    kind: str
    at_share: float
    at_s: float = 0.0
    worst_lag_s: float = 0.0
    recovered_s: float | None = None


@dataclass
class Outcome:
    """What the soak found."""

    command: str
    load: Load
    n_each: int
    lives: Sequence[Life]
    faults: Sequence[Event]
    crashes: Sequence[Event]
    sending_s: float
    sigterm_s: float
    truth: Sums
    found: Sums
    tracks: tuple[int, int]
    gaps: Ranges
    lost: Ranges

    @property
    def is_exact(self) -> bool:
        return self.found == self.truth and self.tracks[0] == self.tracks[1]

    @property
    def is_reported(self) -> bool:
        return self.gaps == self.lost


def spread(values: Sequence[float], unit: str, *, digits: int = 1) -> str:
    """Return "median, most" of some values."""
    ordered = sorted(values)
    if not ordered:
        return "none"
    return f"median {ordered[len(ordered) // 2]:.{digits}f}, most {ordered[-1]:.{digits}f} {unit}"


def n_of(ranges: Ranges) -> int:
    return sum(last - first + 1 for each in ranges.values() for first, last in each)


def rows(outcome: Outcome) -> list[tuple[str, str]]:
    """Return the summary, what and how much."""
    load, lives = outcome.load, outcome.lives
    n_messages = outcome.n_each * load.n_cameras
    n_records = n_messages * (1 + load.n_people)
    per_s, times = n_messages / outcome.sending_s, outcome.n_each * load.step_ms / 1000 / outcome.sending_s
    received = sum(life.status.get("received", 0) for life in lives)
    again = sum(life.status.get("redelivered", 0) for life in lives)
    folds = [fold for life in lives for fold in life.folds.values()]
    told = [
        ("sent, acknowledged by the broker", f"{n_messages:,} messages, {n_messages * load.n_people:,} observations"),
    ]
    for table, truth in outcome.truth.items():
        same = "count, xor and sum of hashes agree" if outcome.found[table] == truth else f"WRONG, {truth[0]:,} sent"
        told.append((f"stored `{table}`", f"{outcome.found[table][0]:,}: {same}"))
    told += [
        ("tracks stored, true", "{:,}, {:,}".format(*outcome.tracks)),
        ("sent = stored, each once", "yes" if outcome.is_exact else "**NO**"),
        ("time", f"{outcome.sending_s:,.0f} s, {times:.0f} times real time"),
        ("sustained, faults included", f"{per_s:,.0f} messages/s, {per_s * n_records / n_messages:,.0f} records/s"),
        ("received; marked as sent before", f"{received:,}; {again:,} (killed listeners: as of their last heartbeat)"),
        ("peak memory of a listener", spread([life.peak_mb for life in lives if life.peak_mb], "MB", digits=0)),
        ("folds beside receipt", f"{len(folds)} seen; {spread([took_s for took_s, _ in folds], 's')}"),
        ("peak memory of a fold", spread([mb for _, mb in folds], "MB", digits=0)),
        ("SIGTERM to exit code 0", f"{outcome.sigterm_s:.2f} s"),
    ]
    for kind in sorted({e.kind for e in outcome.faults}):
        same_kind = [e for e in outcome.faults if e.kind == kind]
        lag = spread([e.worst_lag_s for e in same_kind], "s")
        back = spread([e.recovered_s for e in same_kind if e.recovered_s is not None], "s")
        open_ends = sum(e.recovered_s is None for e in same_kind)
        unknown = f"; {open_ends} overtaken by the next fault" if open_ends else ""
        told.append((f"{len(same_kind)} x {kind}", f"longest lag {lag}; caught up after {back}{unknown}"))
    n_lost, n_ranges = n_of(outcome.lost), sum(map(len, outcome.lost.values()))
    told += [
        (
            f"then {len(outcome.crashes)} x broker kill -9",
            f"lost {n_lost:,} messages it had acknowledged ({n_ranges} gaps)",
        ),
        (
            "of these told by `vsd coverage`",
            f"{n_of(outcome.gaps):,}: {'the same' if outcome.is_reported else '**OTHERS**'}",
        ),
    ]
    return told


def print_report(outcome: Outcome) -> None:
    """Print the outcome."""
    print(f"`{outcome.command}`, {platform.machine()}, {os.cpu_count()} cores\n\n| what | measured |\n|---|---|")
    for what, measured in rows(outcome):
        print(f"| {what} | {measured} |")
    print("\n| listener | lived s | peak MB | received | redelivered | folds | end |\n|--:|--:|--:|--:|--:|--:|---|")
    for i, life in enumerate(outcome.lives, 1):
        got, again, n_folds = (life.status.get(k, 0) for k in ("received", "redelivered", "folds"))
        lived_s = life.ended_s - life.began_s
        print(f"| {i} | {lived_s:.0f} | {life.peak_mb:.0f} | {got:,} | {again:,} | {n_folds} | {life.end} |")
    print("\n| fault | at | longest lag s | caught up after s |\n|---|--:|--:|--:|")
    for events in (outcome.faults, outcome.crashes):
        for event in sorted(events, key=lambda e: e.at_share):
            back = "-" if event.recovered_s is None else f"{event.recovered_s:.1f}"
            print(f"| {event.kind} | {event.at_share:.1%} | {event.worst_lag_s:.1f} | {back} |")
