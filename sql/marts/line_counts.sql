-- name: marts/line_counts
-- One row per counting line and quarter-hour of the calendar in its life: who crossed it in either direction, as far as recorded.
-- grain: line_id, quarter
-- reads: line_crossings, count_lines, line_parts, counter_lines, counter_quarters, coverage, camera_days, calendar
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
--   recorded_s     recorded seconds of the camera of this line that recorded least, or seconds of which its counter sent sums
--   state          full, partial, low_data or no_data, of that camera or counter
--   can_count      every camera of this line that recorded gives track ids, and a frame in 10 s at least; a counter can
--   interval_s     longest interval of the counter's sums; those of over 900 s are spread evenly; null for lines that cameras count
--   n_to_left      crossings to the left, seen from the line's first point; null where nothing was recorded or crossings cannot be counted
--   n_to_right     likewise to the right
--   n_both         crossings either way; the only number of a counter that does not tell ways apart
-- figure: M57 Crossings
--   definition   people who cross each counting line, by direction: from 0.25 m on one side to 0.25 m on the other, each way back too;
--                or as its door counter sends them
--   unit         crossings
--   denominator  recorded hours
--   needs        positions with track ids, a frame in 10 s at least; or the sums of a door counter
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
-- figure: M59 Busiest quarter-hour at a line
--   definition   most crossings of a line in a quarter-hour that was recorded in full, both ways: people a minute, people a second and
--                metre of the line, and that as a share of 1.3, which a level door lets through
--   unit         people per minute; people per metre and second; share
--   denominator  hours recorded in full
--   needs        a quarter-hour that was recorded in full
--   uncertainty  none: a count
--   by           vsd_analytics.figures.line_peaks.line_peaks
-- figure: M60 Footfall
--   definition   crossings of a counting line, either way, per recorded open hour of the week, beside the usual range by the weeks
--                before, the change to the week before and to the week 52 weeks before, and the crossings expected next week
--   unit         crossings per open hour; relative change; crossings
--   denominator  open hours recorded in full
--   needs        lines with crossings either way; four weeks before for ranges and expectations
--   uncertainty  the usual range, and a range of the busiest hour; changes have no interval and no verdict
--   by           vsd_analytics.figures.footfall.footfall_answers
-- steps:
--   counted_lines  lines of cameras and of counters
--   seers  a line that several cameras see is recorded only where all of them recorded
-- assumes: a quarter-hour without a crossing is 0 where all cameras of the line recorded, unknown where one did not at all
with counted_lines as (
    select
        floor_id,
        from_ms,
        to_ms,
        line_id,
        line_no,
        false as is_by_counter
    from count_lines
    union all
    select
        floor_id,
        from_ms,
        to_ms,
        line_id,
        line_no,
        true as is_by_counter
    from counter_lines
),

quarters_of_lines as (
    select
        counted_lines.floor_id,
        counted_lines.line_id,
        counted_lines.line_no,
        counted_lines.is_by_counter,
        calendar.quarter,
        calendar.hour_start_ms,
        calendar.local_date,
        calendar.local_hour,
        calendar.is_open
    from calendar
    inner join counted_lines
        on calendar.quarter * 900000 >= counted_lines.from_ms and calendar.quarter * 900000 < counted_lines.to_ms
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
),

by_line as (
    select
        q.floor_id,
        q.line_id,
        q.line_no,
        q.quarter,
        q.hour_start_ms,
        q.local_date,
        q.local_hour,
        q.is_open,
        case when q.is_by_counter then coalesce(c.recorded_s, 0) else coalesce(r.recorded_s, 0) end as recorded_s,
        q.is_by_counter or coalesce(r.can_count, true) as can_count,
        c.interval_s,
        case when q.is_by_counter then c.n_to_left when r.recorded_s > 0 and r.can_count then coalesce(x.n_to_left, 0) end as n_to_left,
        case
            when q.is_by_counter then c.n_to_right when r.recorded_s > 0 and r.can_count then coalesce(x.n_to_right, 0)
        end as n_to_right,
        c.n_both
    from quarters_of_lines as q
    left join recorded as r on q.line_id = r.line_id and q.quarter = r.quarter
    left join crossed as x on q.line_id = x.line_id and q.quarter = x.quarter
    left join counter_quarters as c on q.is_by_counter and q.line_id = c.line_id and q.quarter = c.quarter
)

select
    b.floor_id,
    b.line_id,
    b.line_no,
    b.quarter,
    b.hour_start_ms,
    b.local_date,
    b.local_hour,
    b.is_open,
    b.recorded_s,
    recording_state(900, b.recorded_s / 900, params.full_hour_share, params.partial_hour_share) as state,
    b.can_count,
    b.interval_s,
    b.n_to_left,
    b.n_to_right,
    coalesce(b.n_both, b.n_to_left + b.n_to_right) as n_both
from by_line as b
cross join params
order by b.quarter, b.line_no
