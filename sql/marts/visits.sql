-- name: marts/visits
-- One row per stay of a track in an area that asks for visits: when it came, when it went, and whether either was seen.
-- grain: camera_id, track_id, area_id, started_ms
-- reads: area_stays, areas, calendar
-- columns:
--   floor_id
--   area_id         area of vsd.toml
--   camera_id
--   track_id        pseudonym of the engine's track number, of one site day
--   started_ms      first record inside, milliseconds since 1970, UTC
--   ended_ms        last record inside
--   local_date      of the first record
--   hour_start_ms   UTC instant the local hour of the first record starts
--   is_open         the first record lies in opening hours
--   has_entry       the entry was seen: the track was outside before, or the area is a door, where people come from nowhere
--   has_exit        the exit was seen: the track was outside afterwards, or the area is a door
--   dwell_s         from the entry to the exit, or to the last record inside; see `stitched`
--   is_counted      this camera counts the place of the first record; else another camera counts the visit
--   is_exit_counted this camera counts the place of the last record
-- figure: M35 Visits
--   definition   visits of each area with visits = true whose entry was seen, in opening hours
--   unit         visits per open hour
--   denominator  recorded open hours
--   needs        5 recorded days and 5 visits for an interval
--   uncertainty  interval as M0
--   by           vsd_analytics.figures.visits.visits
-- figure: M36 Dwell time
--   definition   time from entry to exit; Kaplan-Meier over visits whose entry was seen, lost tracks censored; beside it Little's law
--   unit         seconds; share of visits
--   denominator  visits
--   needs        30 visits; 5 days with visits for an interval
--   uncertainty  day-clustered 95 % interval of the curve (Ying and Wei), means by jackknife over days
--   by           vsd_analytics.stats.dwell.dwell
-- steps:
--   marked    a stay goes on over the hour where it does not stop for longer than gap_ms
--   numbered  a running number per visit of a track to an area
--   stitched  an entry is half way between the last frame outside and the first inside, an exit likewise; in a door it is half a frame
--             interval before the first record, or after the last
-- assumes: segments of the hours around a range are loaded, so that a visit is whole; a track is a person's time in one camera's view
with marked as (
    select
        camera_id,
        track_id,
        area_id,
        started_ms,
        ended_ms,
        before_ms,
        after_ms,
        interval_ms,
        is_entry_owned,
        is_exit_owned,
        case when started_ms - max(ended_ms) over earlier <= gap_ms then 0 else 1 end as is_start
    from area_stays
    window
        earlier as (
            partition by camera_id, track_id, area_id order by started_ms
            rows between unbounded preceding and 1 preceding
        )
),

numbered as (
    select
        camera_id,
        track_id,
        area_id,
        started_ms,
        ended_ms,
        before_ms,
        after_ms,
        interval_ms,
        is_entry_owned,
        is_exit_owned,
        is_start,
        sum(is_start) over (
            partition by camera_id, track_id, area_id order by started_ms
            rows between unbounded preceding and current row
        ) as visit_no
    from marked
),

stitched as (
    select
        camera_id,
        track_id,
        area_id,
        min(started_ms) as started_ms,
        max(ended_ms) as ended_ms,
        min(before_ms) as before_ms,
        max(after_ms) as after_ms,
        max(interval_ms) as interval_ms,
        min_by(is_entry_owned, started_ms) as is_entry_owned,
        max_by(is_exit_owned, started_ms) as is_exit_owned
    from numbered
    group by camera_id, track_id, area_id, visit_no
)

select
    areas.floor_id,
    stitched.area_id,
    stitched.camera_id,
    stitched.track_id,
    stitched.started_ms,
    stitched.ended_ms,
    calendar.local_date,
    calendar.hour_start_ms,
    calendar.is_open,
    stitched.before_ms is not null or areas.is_door as has_entry,
    stitched.after_ms is not null or areas.is_door as has_exit,
    (
        stitched.ended_ms - stitched.started_ms
        + coalesce(stitched.after_ms - stitched.ended_ms, case when areas.is_door then stitched.interval_ms else 0 end) / 2
        + coalesce(stitched.started_ms - stitched.before_ms, case when areas.is_door then stitched.interval_ms else 0 end) / 2
    ) / 1000 as dwell_s,
    stitched.is_entry_owned as is_counted,
    stitched.is_exit_owned as is_exit_counted
from stitched
inner join areas on stitched.area_id = areas.area_id
inner join calendar on floor(stitched.started_ms / 900000) = calendar.quarter
order by stitched.started_ms, stitched.camera_id, stitched.track_id, stitched.area_id
