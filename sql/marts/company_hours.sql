-- name: marts/company_hours
-- One row per camera and local hour with anybody in violation in opening hours: time in violation, with and without other groups.
-- stored_by: local_date
-- grain: camera_id, hour_start_ms
-- reads: company_times, calendar, cameras, site_days, track_groups
-- columns:
--   camera_id
--   floor_id
--   hour_start_ms  UTC instant the local hour starts
--   local_date
--   violation_s    person-seconds in violation
--   between_s      those in which somebody closer than distance_m is neither of the person's own group nor of its company
-- figure: M30 Time too close between groups
--   definition   person-minutes with somebody of another group closer than distance_m: in all, and per stay (M6 between groups times
--                the mean time of a track id in one camera's view)
--   unit         person-minutes
--   denominator  person-hours of cameras whose ids last
--   needs        ids that last, as M9; 5 days for an interval
--   uncertainty  that of M6 between groups, over the same hours
--   by           vsd_analytics.figures.catalogue.violations.close_time
-- steps:
--   others        one row per other person; who has no group is between groups with everybody and needs no comparison
--   within_group  bool_and: one stranger close by makes the time between groups
-- assumes: a bucket's ids are of the site day it starts in; people of whom it is unknown whether they move together count as not together
with timed as materialized (
    select
        row_number() over () as row_no,
        company_times.camera_id,
        cameras.floor_id,
        calendar.hour_start_ms,
        calendar.local_date,
        site_days.site_day,
        company_times.company,
        company_times.is_standing,
        company_times.violation_ms,
        own.group_id
    from company_times
    inner join calendar on company_times.bucket_quarter = calendar.quarter
    inner join cameras on company_times.camera_id = cameras.camera_id
    left join site_days on company_times.bucket_quarter = site_days.quarter
    left join track_groups as own
        on
            company_times.camera_id = own.camera_id
            and site_days.site_day = own.site_day
            and company_times.track_id = own.track_id
    where calendar.is_open
),

others as (
    select
        row_no,
        camera_id,
        site_day,
        group_id,
        unnest(string_split(company, chr(1))) as other_id
    from timed
    where group_id is not null and company is not null and not coalesce(is_standing, false)
),

within_group as (
    select others.row_no
    from others
    left join track_groups as theirs
        on
            others.camera_id = theirs.camera_id
            and others.site_day = theirs.site_day
            and others.other_id = theirs.track_id
    group by others.row_no
    having bool_and(coalesce(others.group_id = theirs.group_id, false))
)

select
    timed.camera_id,
    timed.floor_id,
    timed.hour_start_ms,
    min(timed.local_date) as local_date,
    sum(timed.violation_ms) / 1000 as violation_s,
    sum(
        case when within_group.row_no is null and not coalesce(timed.is_standing, false) then timed.violation_ms else 0 end
    ) / 1000 as between_s
from timed
left join within_group on timed.row_no = within_group.row_no
group by timed.camera_id, timed.floor_id, timed.hour_start_ms
order by timed.hour_start_ms, timed.camera_id
