-- name: marts/visits
-- One row per stay of a track, or of a person in joined ones, in an area that asks for visits: when it came and went, as far as seen.
-- grain: camera_id, track_id, area_id, started_ms
-- reads: person_stays, areas, calendar
-- columns:
--   floor_id
--   area_id         area of vsd.toml
--   camera_id       camera of the track, or of the person's first track with join_views
--   track_id        pseudonym of the engine's track number, of one site day; of joined tracks, the person's first
--   started_ms      first record inside, milliseconds since 1970, UTC
--   ended_ms        last record inside
--   local_date      of the first record
--   hour_start_ms   UTC instant the local hour of the first record starts
--   is_open         the first record lies in opening hours
--   has_entry       the entry was seen: the track was outside before, or the area is a door, where people come from nowhere
--   has_exit        the exit was seen: the track was outside afterwards, or the area is a door
--   dwell_s         from the entry to the exit, or to the last record inside; see `stitched`
--   is_counted      a camera that saw the stay counts the place of its first record there; else another camera counts the visit
--   is_exit_counted a camera that saw the stay counts the place of its last record there
--   counted_by      the camera that counts the place of the first record; of several, the first; else the first that saw the stay
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
-- figure: M50 Conversion
--   definition   value of each summed series of vsd context add, such as tickets, over visits (M35) of the same hours: those recorded in
--                full of which the value is known; a day with a value of its own alone counts whole
--   unit         the unit of the series per visit
--   denominator  visits
--   needs        30 visits; 5 days for an interval; show_context for reports
--   uncertainty  interval as M7, by days
--   by           vsd_analytics.figures.context_figures.conversion_answer
-- steps:
--   marked    a stay goes on over the hour where it does not stop for longer than gap_ms
--   numbered  a running number per visit of a track to an area
--   spanned   of a person in several views, the first view says whether the entry was seen, or one that saw them outside before it
--   stitched  an entry is half way between the last frame outside and the first inside, an exit likewise; in a door it is half a frame
--             interval before the first record, or after the last
-- assumes: segments of the hours around a range are loaded, so that a visit is whole; a track, or what join_views joins, is a person
with marked as (
    select
        camera_id,
        track_id,
        seen_by,
        seen_as,
        area_id,
        started_ms,
        ended_ms,
        before_ms,
        after_ms,
        interval_ms,
        is_entry_owned,
        is_exit_owned,
        case when started_ms - max(ended_ms) over earlier <= gap_ms then 0 else 1 end as is_start
    from person_stays
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
        seen_by,
        seen_as,
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

spanned as (
    select
        camera_id,
        track_id,
        area_id,
        visit_no,
        started_ms,
        ended_ms,
        before_ms,
        after_ms,
        interval_ms,
        is_entry_owned,
        is_exit_owned,
        seen_by,
        min(started_ms) over visit as first_ms,
        max(ended_ms) over visit as last_ms,
        started_ms = min(started_ms) over view as is_first,
        ended_ms = max(ended_ms) over view as is_last,
        (seen_by, seen_as) = first_value((seen_by, seen_as)) over (
            partition by camera_id, track_id, area_id, visit_no order by started_ms, seen_by, seen_as
        ) as began_it,
        (seen_by, seen_as) = first_value((seen_by, seen_as)) over (
            partition by camera_id, track_id, area_id, visit_no order by ended_ms desc, seen_by asc, seen_as asc
        ) as ended_it
    from numbered
    window
        visit as (partition by camera_id, track_id, area_id, visit_no),
        view as (partition by camera_id, track_id, area_id, visit_no, seen_by, seen_as)
),

stitched as (
    select
        camera_id,
        track_id,
        area_id,
        min(started_ms) as started_ms,
        max(ended_ms) as ended_ms,
        min(before_ms) filter (where began_it or before_ms < first_ms) as before_ms,
        max(after_ms) filter (where ended_it or after_ms > last_ms) as after_ms,
        max(interval_ms) as interval_ms,
        bool_or(is_entry_owned) filter (where is_first) as is_entry_owned,
        bool_or(is_exit_owned) filter (where is_last) as is_exit_owned,
        coalesce(
            min_by(seen_by, (started_ms, seen_by)) filter (where is_first and is_entry_owned),
            min_by(seen_by, (started_ms, seen_by))
        ) as counted_by
    from spanned
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
    stitched.is_exit_owned as is_exit_counted,
    stitched.counted_by
from stitched
inner join areas on stitched.area_id = areas.area_id
inner join calendar on floor(stitched.started_ms / 900000) = calendar.quarter
order by stitched.started_ms, stitched.camera_id, stitched.track_id, stitched.area_id
