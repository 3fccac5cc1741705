-- name: exports/weeks
-- One row per floor and week: its headline numbers with 95 % intervals, and the change from the week before.
-- grain: floor_id, week
-- reads: reports
-- columns:
--   floor_id
--   week                            ISO week, such as 2026-W46
--   monday                          its first day
--   state                           no_data, too_incomplete, empty, settings_changed, first_week or normal
--   recorded_share                  recorded over open camera-hours
--   violations                      violations in opening hours; null where hidden
--   violations_per_open_h           M0, violations per open hour
--   violations_per_open_h_lo        lower end of its interval
--   violations_per_open_h_hi        upper end
--   violations_per_open_h_state     ok, not_enough_data or not_measurable
--   violations_per_open_h_reason    why there is none
--   violations_per_open_h_change    relative change from the week before; -0.2 is 20 % fewer
--   violations_per_open_h_change_lo lower end of its interval
--   violations_per_open_h_change_hi upper end
--   violations_per_open_h_verdict   clear_fall, clear_rise, about_same, no_clear_change and others: what may be said
--   close_time_share                     M6, share of person-time closer than the legal distance to somebody
--   close_time_share_lo                  lower end of its interval
--   close_time_share_hi                  upper end
--   close_time_share_state               ok, not_enough_data or not_measurable
--   close_time_share_reason              why there is none
--   people                          M4, people in view, mean over recorded open hours
--   headline                        the sentence at the top of the page
-- assumes: a number without its state ok is null, never 0
select
    floor_id,
    report ->> '$.week.iso' as week,
    cast(report ->> '$.week.monday' as date) as monday,
    report ->> '$.state' as state,
    cast(report ->> '$.coverage.share' as double) as recorded_share,
    cast(report ->> '$.level.violations' as bigint) as violations,
    cast(report ->> '$.level.violation_rate.value' as double) as violations_per_open_h,
    cast(report ->> '$.level.violation_rate.lo' as double) as violations_per_open_h_lo,
    cast(report ->> '$.level.violation_rate.hi' as double) as violations_per_open_h_hi,
    report ->> '$.level.violation_rate.state' as violations_per_open_h_state,
    report ->> '$.level.violation_rate.reason' as violations_per_open_h_reason,
    cast(report ->> '$.level.violation_rate.change' as double) as violations_per_open_h_change,
    cast(report ->> '$.level.violation_rate.change_lo' as double) as violations_per_open_h_change_lo,
    cast(report ->> '$.level.violation_rate.change_hi' as double) as violations_per_open_h_change_hi,
    report ->> '$.level.violation_rate.verdict' as violations_per_open_h_verdict,
    cast(report ->> '$.figures.M6.value' as double) as close_time_share,
    cast(report ->> '$.figures.M6.lo' as double) as close_time_share_lo,
    cast(report ->> '$.figures.M6.hi' as double) as close_time_share_hi,
    report ->> '$.figures.M6.state' as close_time_share_state,
    report ->> '$.figures.M6.reason' as close_time_share_reason,
    cast(report ->> '$.level.people.value' as double) as people,
    report ->> '$.story.headline' as headline
from reports
order by floor_id, week
