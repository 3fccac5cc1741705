-- name: marts/moves
-- One row per stay of a track in an area that asks for visits: where it came from, and which area it entered next.
-- grain: camera_id, track_id, site_day, visit_no
-- reads: visits, areas, track_days, joined_persons, site_days, calendar
-- columns:
--   floor_id
--   area_id           area of vsd.toml
--   camera_id
--   track_id          pseudonym of the engine's track number, of one site day
--   site_day          day in the site's zone that starts at day_starts; track ids end with it
--   visit_no          1 for the first area of the track, 2 for the next
--   is_last           the track enters no area after it
--   local_date        of the first record
--   hour_start_ms     UTC instant the local hour of the first record starts
--   is_open           the first record lies in opening hours
--   is_arrival        the track was seen outside the area before
--   is_counted        this camera counts the place of the first record
--   left_date         local date of the last record
--   left_hour_ms      UTC instant the local hour of the last record starts
--   is_open_then      the last record lies in opening hours
--   is_departure      the track was seen outside the area afterwards
--   is_exit_counted   this camera counts the place of the last record
--   next_area_id      area that the track enters next; null where it ends before
--   until_next_s      from leaving to entering the next area, or to the end of the track
--   since_began_s     from the start of the track to its end
--   is_door           people come into the space and leave it there
--   counted_by        camera that counts the visit, as in visits
-- figure: M37 Flow between areas
--   definition   of those who leave an area, the share whose next area is this one; tracks lost on the way are censored
--   unit         share of those who leave; per open hour
--   denominator  people seen to leave
--   needs        30 who leave; 5 days for an interval
--   uncertainty  day-clustered 95 % interval, wider by the share that was not followed long enough
--   by           vsd_analytics.stats.next_area.next_areas
-- figure: M38 Routes
--   definition   sequences of areas of those who come in by a door, from door to door; tracks lost on the way are censored
--   unit         share of routes
--   denominator  tracks that begin in a door
--   needs        30 tracks that begin in a door; 5 days for an interval
--   uncertainty  as M37
--   by           vsd_analytics.stats.next_area.next_areas
-- steps:
--   stayed    a short stay within a longer one (who is back within visit_gap_s never left) is no place of the way
--   numbered  areas of a track in the order it enters them
-- assumes: an id is one person's from its first to its last record of a site day; a track that join_views does not join ends with its view
with persons as (
    select
        track_days.site_day,
        coalesce(joined_persons.person_camera_id, track_days.camera_id) as camera_id,
        coalesce(joined_persons.person_track_id, track_days.track_id) as track_id,
        min(track_days.first_ms) as first_ms,
        max(track_days.last_ms) as last_ms
    from track_days
    left join joined_persons
        on
            track_days.site_day = joined_persons.site_day
            and track_days.camera_id = joined_persons.camera_id
            and track_days.track_id = joined_persons.track_id
    group by all
),

stayed as (
    select
        visits.floor_id,
        visits.area_id,
        visits.camera_id,
        visits.track_id,
        site_days.site_day,
        visits.started_ms,
        visits.ended_ms,
        visits.local_date,
        visits.hour_start_ms,
        visits.is_open,
        visits.is_counted,
        visits.counted_by,
        visits.is_exit_counted,
        max(visits.ended_ms) over (
            partition by visits.camera_id, visits.track_id, site_days.site_day order by visits.started_ms, visits.area_id
            rows between unbounded preceding and 1 preceding
        ) as ended_before_ms
    from visits
    inner join site_days on floor(visits.started_ms / 900000) = site_days.quarter
),

numbered as (
    select
        stayed.floor_id,
        stayed.area_id,
        stayed.camera_id,
        stayed.track_id,
        stayed.site_day,
        stayed.started_ms,
        stayed.ended_ms,
        stayed.local_date,
        stayed.hour_start_ms,
        stayed.is_open,
        stayed.is_counted,
        stayed.counted_by,
        stayed.is_exit_counted,
        persons.first_ms,
        persons.last_ms,
        row_number() over way as visit_no,
        lead(stayed.area_id) over way as next_area_id,
        lead(stayed.started_ms) over way as next_ms
    from stayed
    inner join persons
        on
            stayed.camera_id = persons.camera_id
            and stayed.track_id = persons.track_id
            and stayed.site_day = persons.site_day
    where stayed.ended_before_ms is null or stayed.ended_ms > stayed.ended_before_ms
    window
        way as (
            partition by stayed.camera_id, stayed.track_id, stayed.site_day order by stayed.started_ms, stayed.area_id
        )
)

select
    numbered.floor_id,
    numbered.area_id,
    numbered.camera_id,
    numbered.track_id,
    numbered.site_day,
    numbered.visit_no,
    numbered.next_area_id is null as is_last,
    numbered.local_date,
    numbered.hour_start_ms,
    numbered.is_open,
    numbered.first_ms < numbered.started_ms as is_arrival,
    numbered.is_counted,
    calendar.local_date as left_date,
    calendar.hour_start_ms as left_hour_ms,
    calendar.is_open as is_open_then,
    numbered.last_ms > numbered.ended_ms as is_departure,
    numbered.is_exit_counted,
    numbered.next_area_id,
    greatest(coalesce(numbered.next_ms, numbered.last_ms) - numbered.ended_ms, 0) / 1000 as until_next_s,
    (numbered.last_ms - numbered.first_ms) / 1000 as since_began_s,
    areas.is_door,
    numbered.counted_by
from numbered
inner join areas on numbered.area_id = areas.area_id
inner join calendar on floor(numbered.ended_ms / 900000) = calendar.quarter
order by numbered.site_day, numbered.camera_id, numbered.track_id, numbered.visit_no
