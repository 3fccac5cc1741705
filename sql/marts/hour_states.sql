-- name: marts/hour_states
-- One row per floor and local hour of the calendar, and one per hour over all cameras: how much of it was recorded.
-- grain: floor_id, hour_start_ms
-- reads: camera_hours, cameras
-- params: full_hour_share, partial_hour_share
-- columns:
--   floor_id           null = all cameras
--   hour_start_ms      UTC instant the local hour starts
--   local_date
--   recorded_share     of the opening time, mean over cameras that are there; of the whole hour when closed
--   cameras_down       those that recorded less than half of it
--   state              full, partial, low_data, no_data or closed
-- assumes: the state governs rates and verdicts only
with summed as (
    select
        cameras.floor_id,
        camera_hours.hour_start_ms,
        min(camera_hours.local_date) as local_date,
        max(camera_hours.open_s) as open_s,
        case
            when max(camera_hours.open_s) > 0 then sum(camera_hours.recorded_open_s) / sum(camera_hours.open_s)
            else sum(camera_hours.recorded_s) / sum(camera_hours.length_s)
        end as recorded_share,
        count(*) filter (
            where camera_hours.length_s > 0 and case
                when camera_hours.open_s > 0 then camera_hours.recorded_open_s / camera_hours.open_s
                else camera_hours.recorded_s / camera_hours.length_s
            end < params.partial_hour_share
        ) as cameras_down
    from camera_hours
    inner join cameras on camera_hours.camera_id = cameras.camera_id
    cross join params
    group by grouping sets ((cameras.floor_id, camera_hours.hour_start_ms), (camera_hours.hour_start_ms))
)

select
    summed.floor_id,
    summed.hour_start_ms,
    summed.local_date,
    summed.recorded_share,
    summed.cameras_down,
    recording_state(summed.open_s, summed.recorded_share, params.full_hour_share, params.partial_hour_share) as state
from summed
cross join params
order by summed.hour_start_ms, summed.floor_id
