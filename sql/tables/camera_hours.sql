-- name: tables/camera_hours
-- One row per camera and local hour of the days asked for; hours without data and closed hours have a row too.
-- grain: camera_id, start
-- reads: camera_hours
-- params: full_hour_share, partial_hour_share
-- columns:
--   floor_id
--   camera_id
--   start              instant the hour starts, with the site's zone
--   local_date
--   weekday            1 Monday to 7 Sunday
--   local_hour         0 to 23; twice in the night the clocks go back
--   state              full, partial, low_data, no_data or closed, of this camera
--   is_in_rates        the state is full or partial; the weekly page counts n_violations_open of these camera-hours (M8)
--   open_s             opening time in it, seconds
--   recorded_s         recorded time, seconds
--   recorded_open_s    recorded time in opening hours, seconds
--   person_records     person records that this camera owns; null where unknown
--   exposure_s         person-seconds in view; likewise
--   violation_records  violation records; likewise
--   violation_s        person-seconds in violation; likewise
--   n_violations       violations that started in it; likewise
--   n_violations_open  those that started in opening hours; null also when closed
-- assumes: what several cameras see counts for one of them, so sums over cameras count nothing twice
with of_cameras as (
    select
        camera_hours.*,
        recording_state(
            open_s, recorded_open_s / nullif(open_s, 0), params.full_hour_share, params.partial_hour_share
        ) as state
    from camera_hours
    cross join params
)

select
    floor_id,
    camera_id,
    make_timestamptz(hour_start_ms * 1000) as start,
    local_date,
    weekday,
    local_hour,
    state,
    state in ('full', 'partial') as is_in_rates,
    open_s,
    recorded_s,
    recorded_open_s,
    person_records,
    exposure_s,
    violation_records,
    violation_s,
    n_violations,
    n_violations_open
from of_cameras
order by hour_start_ms, camera_no
