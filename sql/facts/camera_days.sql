-- name: facts/camera_days
-- One row per camera and UTC day with records: how often it reports, and whether it also reports empty frames.
-- unit: day
-- grain: camera_id, utc_day
-- reads: stored_frames, stored_observations, stored_pairs, cameras
-- columns:
--   utc_day        UTC days since 1970
--   camera_id
--   interval_ms    frame interval: 1000 / hz of vsd.toml, else the median time between frames of the day; 1000 when the day has one frame
--   has_heartbeat  frames were reported, not only records of people
-- assumes: a whole UTC day of stored records is loaded
with seen as (
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        true as is_frame
    from stored_frames
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        false as is_frame
    from stored_observations
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        false as is_frame
    from stored_pairs
),

instants as (
    select
        camera_id,
        ts_ms,
        bool_or(is_frame) as is_frame
    from seen
    group by camera_id, ts_ms
),

spaced as (
    select
        camera_id,
        ts_ms,
        is_frame,
        ts_ms - lag(ts_ms) over (partition by camera_id, cast(floor(ts_ms / 86400000) as bigint) order by ts_ms) as since_ms
    from instants
)

select
    cast(floor(spaced.ts_ms / 86400000) as bigint) as utc_day,
    spaced.camera_id,
    coalesce(
        max(cameras.interval_ms),
        cast(round(percentile_cont(0.5) within group (order by spaced.since_ms)) as bigint),
        1000
    ) as interval_ms,
    bool_or(spaced.is_frame) as has_heartbeat
from spaced
inner join cameras on spaced.camera_id = cameras.camera_id
group by 1, 2
order by 2, 1
