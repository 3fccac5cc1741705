-- name: marts/line_counts
-- One row per counting line and quarter-hour of the calendar in its life: who crossed it in either direction, as far as recorded.
-- grain: line_id, quarter
-- reads: line_crossings, count_lines, line_parts, coverage, camera_days, calendar
-- params: full_hour_share, partial_hour_share, line_lost_ms
-- columns:
--   floor_id
--   line_id        line of vsd.toml
--   line_no        its position in vsd.toml
--   quarter        UTC quarter-hours since 1970
--   hour_start_ms  UTC instant the local hour starts
--   local_date
--   local_hour     0 to 23
--   is_open        opening time
--   recorded_s     recorded seconds of the camera of this line that recorded least
--   state          full, partial, low_data or no_data, of that camera
--   can_count      every camera of this line that recorded gives track ids, and a frame in 10 s at least
--   n_to_left      crossings to the left, seen from the line's first point; null where nothing was recorded or crossings cannot be counted
--   n_to_right     likewise to the right
-- figure: M57 Crossings
--   definition   people who cross each counting line, by direction: from 0.25 m on one side to 0.25 m on the other, each way back too
--   unit         crossings
--   denominator  recorded hours
--   needs        positions with track ids, a frame in 10 s at least
--   uncertainty  none: a count; the net number is given only where all opening hours were recorded
--   by           vsd_analytics.figures.lines.line_answers
-- figure: M58 People inside by the doors
--   definition   people in less people out since the last empty hour, over lines with inside: mean of recorded opening time, the most
--                at the end of a quarter-hour; drift: those still inside when the day is over, which should be 0
--   unit         people; people per 1,000 crossings
--   denominator  opening hours in which the number is known
--   needs        [doors] empty_at; every door recorded in full since then
--   uncertainty  the drift shows it: a count that nobody corrects
--   by           vsd_analytics.figures.doors.door_answers
-- steps:
--   seers  a line that several cameras see is recorded only where all of them recorded
-- assumes: a quarter-hour without a crossing is 0 where all cameras of the line recorded, unknown where one did not at all
with quarters_of_lines as (
    select
        count_lines.floor_id,
        count_lines.line_id,
        count_lines.line_no,
        calendar.quarter,
        calendar.hour_start_ms,
        calendar.local_date,
        calendar.local_hour,
        calendar.is_open
    from calendar
    inner join count_lines
        on calendar.quarter * 900000 >= count_lines.from_ms and calendar.quarter * 900000 < count_lines.to_ms
),

seers as (
    select distinct
        q.line_id,
        q.quarter,
        line_parts.camera_id
    from quarters_of_lines as q
    inner join line_parts
        on
            q.line_id = line_parts.line_id
            and q.quarter * 900000 >= line_parts.from_ms
            and q.quarter * 900000 < line_parts.to_ms
),

recorded as (
    select
        seers.line_id,
        seers.quarter,
        min(coalesce(coverage.recorded_ms, 0)) / 1000 as recorded_s,
        bool_and(coalesce(camera_days.has_tracks and camera_days.interval_ms <= params.line_lost_ms, true)) as can_count
    from seers
    cross join params
    left join coverage on seers.camera_id = coverage.camera_id and seers.quarter = coverage.quarter
    left join camera_days
        on seers.camera_id = camera_days.camera_id and cast(floor(seers.quarter / 96) as bigint) = camera_days.utc_day
    group by seers.line_id, seers.quarter
),

crossed as (
    select
        line_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        count(*) filter (where is_to_left) as n_to_left,
        count(*) filter (where not is_to_left) as n_to_right
    from line_crossings
    group by line_id, cast(floor(ts_ms / 900000) as bigint)
)

select
    q.floor_id,
    q.line_id,
    q.line_no,
    q.quarter,
    q.hour_start_ms,
    q.local_date,
    q.local_hour,
    q.is_open,
    coalesce(recorded.recorded_s, 0) as recorded_s,
    recording_state(
        900, coalesce(recorded.recorded_s, 0) / 900, params.full_hour_share, params.partial_hour_share
    ) as state,
    coalesce(recorded.can_count, true) as can_count,
    case when recorded.recorded_s > 0 and recorded.can_count then coalesce(crossed.n_to_left, 0) end as n_to_left,
    case when recorded.recorded_s > 0 and recorded.can_count then coalesce(crossed.n_to_right, 0) end as n_to_right
from quarters_of_lines as q
cross join params
left join recorded on q.line_id = recorded.line_id and q.quarter = recorded.quarter
left join crossed on q.line_id = crossed.line_id and q.quarter = crossed.quarter
order by q.quarter, q.line_no
