"""The section of the report that says how often its verdicts are false alarms here."""

from __future__ import annotations

from vsd_analytics.figures.self_check import FloorSelfCheck
from vsd_analytics.figures.week.model_sections import FalseAlarmShare, SelfCheck
from vsd_analytics.stats.false_alarms import FalseAlarms


def section(found: FloorSelfCheck) -> SelfCheck:
    """Return the self-check as the report prints it."""
    expected, lo, hi = found.false_a_year or (None, None, None)
    return SelfCheck(
        n_weeks=found.n_weeks,
        both=_share(found.both),
        often=_share(found.often),
        risky=_share(found.risky),
        verdicts_a_year=found.verdicts_a_year,
        false_a_year=expected,
        false_a_year_lo=lo,
        false_a_year_hi=hi,
        state=found.state,
        reason=found.reason,
    )


def _share(found: FalseAlarms | None) -> FalseAlarmShare | None:
    return None if found is None else FalseAlarmShare(share=found.share, lo=found.lo, hi=found.hi)
