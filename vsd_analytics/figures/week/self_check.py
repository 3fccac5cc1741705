"""The section of the report that says how often its verdicts are false alarms here."""

from __future__ import annotations

from vsd_analytics.figures.self_check import FloorSelfCheck
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_sections import FalseAlarmShare, SelfCheck


def section(found: FloorSelfCheck) -> SelfCheck:
    """Return the self-check as the report prints it."""
    measured = {"both": found.both, "violation_rate": found.violation_rate, "encounter_rate": found.encounter_rate}
    shares = {
        name: None if of is None else same_fields(FalseAlarmShare, of, share=of.value) for name, of in measured.items()
    }
    expected, lo, hi = found.false_a_year or (None, None, None)
    return same_fields(SelfCheck, found, **shares, false_a_year=expected, false_a_year_lo=lo, false_a_year_hi=hi)
