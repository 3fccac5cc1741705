-- name: marts/camera_hour_records
-- One row per camera and local hour of the calendar, including hours without data: recorded time, people and violation records.
-- grain: camera_id, hour_start_ms
-- reads: calendar, cameras, camera_days, coverage, exposure, violation_time
-- columns:
--   camera_id
--   camera_no            position in vsd.toml
--   floor_id
--   hour_start_ms        UTC instant the local hour starts
--   local_date
--   local_hour           0 to 23
--   fold                 1 in the second of two equal local hours
--   weekday              1 Monday to 7 Sunday
--   length_s             length of the local hour while the camera is there (`from` and `to` of vsd.toml)
--   open_s               opening time in it
--   recorded_s           recorded time
--   recorded_open_s      recorded time in opening hours
--   is_inferred          recorded time is inferred from silences; null without data
--   person_records       person records; null also where the engine sends pairs only
--   exposure_s           person-seconds in view; likewise
--   exposure_open_s      person-seconds in opening hours
--   violation_records    violation records; null also where people have pixels only and the camera no calibration
--   violation_s          person-seconds in violation; likewise
--   violation_open_s     person-seconds in violation in opening hours; likewise
--   counts_violations       whether violations that started in it can be known: recorded, with distances and track ids
--   counts_violations_open  the same, recorded in opening hours
-- steps:
--   spine     every camera and quarter-hour of the calendar, so that an hour without data has a row; where no camera of a floor
--             is there, all are missing
--   per_hour  900 s is a quarter-hour; has_distances: pairs were sent, or at least half of the records have a floor position
-- assumes: where nothing was recorded, or a count cannot be known, it is null, never 0
with spine as (
    select
        cameras.camera_id,
        cameras.camera_no,
        cameras.floor_id,
        calendar.quarter,
        calendar.hour_start_ms,
        calendar.local_date,
        calendar.local_hour,
        calendar.fold,
        calendar.weekday,
        cameras.from_ms <= calendar.quarter * 900000 and calendar.quarter * 900000 < cameras.to_ms as is_in_life,
        is_in_life or not bool_or(is_in_life) over (partition by cameras.floor_id, calendar.quarter) as is_there,
        calendar.is_open and is_there as is_open
    from calendar
    cross join cameras
),

per_quarter as (
    select
        spine.camera_id,
        spine.camera_no,
        spine.floor_id,
        spine.hour_start_ms,
        spine.local_date,
        spine.local_hour,
        spine.fold,
        spine.weekday,
        spine.is_there,
        spine.is_open,
        camera_days.has_persons,
        camera_days.has_tracks,
        camera_days.sends_pairs,
        coalesce(coverage.recorded_ms, 0) as recorded_ms,
        coverage.is_inferred,
        coalesce(exposure.person_records, 0) as person_records,
        coalesce(exposure.exposure_ms, 0) as exposure_ms,
        coalesce(exposure.person_records + exposure.n_doubled, 0) as n_seen,
        coalesce(exposure.n_unlocated, 0) as n_unlocated,
        coalesce(violation_time.violation_records, 0) as violation_records,
        coalesce(violation_time.violation_ms, 0) as violation_ms
    from spine
    left join coverage on spine.camera_id = coverage.camera_id and spine.quarter = coverage.quarter
    left join exposure on spine.camera_id = exposure.camera_id and spine.quarter = exposure.quarter
    left join violation_time on spine.camera_id = violation_time.camera_id and spine.quarter = violation_time.quarter
    left join camera_days on spine.camera_id = camera_days.camera_id and floor(spine.quarter / 96) = camera_days.utc_day
),

per_hour as (
    select
        camera_id,
        camera_no,
        floor_id,
        hour_start_ms,
        min(local_date) as local_date,
        min(local_hour) as local_hour,
        min(fold) as fold,
        min(weekday) as weekday,
        count(*) filter (where is_there) * 900 as length_s,
        count(*) filter (where is_open) * 900 as open_s,
        sum(recorded_ms) / 1000.0 as recorded_s,
        coalesce(sum(recorded_ms) filter (where is_open), 0) / 1000.0 as recorded_open_s,
        bool_or(is_inferred) as is_inferred,
        coalesce(bool_or(has_persons), false) as has_persons,
        coalesce(bool_and(has_tracks), true) as has_tracks,
        coalesce(bool_or(sends_pairs), false) or 2 * sum(n_unlocated) <= sum(n_seen) as has_distances,
        sum(person_records)::bigint as person_records,
        sum(exposure_ms) / 1000.0 as exposure_s,
        coalesce(sum(exposure_ms) filter (where is_open), 0) / 1000.0 as exposure_open_s,
        sum(violation_records)::bigint as violation_records,
        sum(violation_ms) / 1000.0 as violation_s,
        coalesce(sum(violation_ms) filter (where is_open), 0) / 1000.0 as violation_open_s
    from per_quarter
    group by camera_id, camera_no, floor_id, hour_start_ms
)

select
    per_hour.camera_id,
    per_hour.camera_no,
    per_hour.floor_id,
    per_hour.hour_start_ms,
    per_hour.local_date,
    per_hour.local_hour,
    per_hour.fold,
    per_hour.weekday,
    per_hour.length_s,
    per_hour.open_s,
    per_hour.recorded_s,
    per_hour.recorded_open_s,
    per_hour.is_inferred,
    case when per_hour.recorded_s > 0 and per_hour.has_persons then per_hour.person_records end as person_records,
    case when per_hour.recorded_s > 0 and per_hour.has_persons then per_hour.exposure_s end as exposure_s,
    case when per_hour.recorded_open_s > 0 and per_hour.has_persons then per_hour.exposure_open_s end as exposure_open_s,
    case when per_hour.recorded_s > 0 and per_hour.has_distances then per_hour.violation_records end as violation_records,
    case when per_hour.recorded_s > 0 and per_hour.has_distances then per_hour.violation_s end as violation_s,
    case when per_hour.recorded_open_s > 0 and per_hour.has_distances then per_hour.violation_open_s end as violation_open_s,
    per_hour.recorded_s > 0 and per_hour.has_distances and per_hour.has_tracks as counts_violations,
    per_hour.recorded_open_s > 0 and per_hour.has_distances and per_hour.has_tracks as counts_violations_open
from per_hour
order by per_hour.hour_start_ms, per_hour.camera_no
