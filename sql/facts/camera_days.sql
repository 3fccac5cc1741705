-- name: facts/camera_days
-- One row per camera and UTC day with records: its frame interval, and what its engine reports.
-- unit: day
-- grain: utc_day, camera_id
-- reads: stored_frames, stored_observations, stored_pairs, cameras
-- columns:
--   utc_day        UTC days since 1970
--   camera_id
--   interval_ms    frame interval: 1000 / hz of vsd.toml, else the median time between frames of the day; 1000 when the day has one frame
--   has_heartbeat  frames were reported, not only records of people
--   has_persons    people were reported, not only pairs, so that no person record means nobody
--   has_tracks     most of its records carry track ids, so that records can be joined to violations; true where nobody was seen
--   sends_pairs    the engine measures pairs itself
-- figure: M29 Data quality
--   definition   share of records without ids, seen twice, or without a place; lives of ids; lost messages; inferred time;
--                recalibrations; other rules; frame intervals
--   unit         list
--   denominator  person records
--   needs        always shown
--   uncertainty  none
--   by           vsd_analytics.figures.catalogue.recording_figures.quality
-- steps:
--   told       per day, because an engine may start to send ids or pairs after an update
--   announced  an engine that reports n_pairs sends pairs, also on a day without any
--   spaced     the median ignores outages; 1200000 ms (20 minutes) is the longest interval, so that an hour needs no more than its
--              neighbours
-- assumes: a whole UTC day of stored records is loaded; a longer interval than 20 minutes counts as 20 minutes
with seen as (
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        1 as is_frame,
        case when n_persons is null then 0 else 1 end as is_person
    from stored_frames
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        0 as is_frame,
        1 as is_person
    from stored_observations
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        0 as is_frame,
        0 as is_person
    from stored_pairs
),

instants as (
    select
        camera_id,
        ts_ms,
        cast(floor(ts_ms / 86400000) as bigint) as utc_day,
        max(is_frame) as is_frame,
        max(is_person) as is_person
    from seen
    group by camera_id, ts_ms
),

identified as (
    select
        camera_id,
        cast(floor(unix_millis(ts) / 86400000) as bigint) as utc_day,
        case when track_id is null then 0 else 1 end as is_tracked,
        0 as is_pair
    from stored_observations
    union all
    select
        camera_id,
        cast(floor(unix_millis(ts) / 86400000) as bigint) as utc_day,
        case when track_a is null or track_b is null then 0 else 1 end as is_tracked,
        1 as is_pair
    from stored_pairs
),

told as (
    select
        camera_id,
        utc_day,
        2 * sum(is_tracked) >= count(*) as has_tracks,
        max(is_pair) = 1 as sends_pairs
    from identified
    group by camera_id, utc_day
),

announced as (
    select distinct
        camera_id,
        cast(floor(unix_millis(ts) / 86400000) as bigint) as utc_day
    from stored_frames
    where n_pairs is not null
),

spaced as (
    select
        utc_day,
        camera_id,
        is_frame,
        is_person,
        ts_ms - lag(ts_ms) over (partition by camera_id, utc_day order by ts_ms) as since_ms
    from instants
)

select
    spaced.utc_day,
    spaced.camera_id,
    least(
        coalesce(
            max(cameras.interval_ms),
            cast(round(percentile_cont(0.5) within group (order by spaced.since_ms)) as bigint),
            1000
        ),
        1200000
    ) as interval_ms,
    max(spaced.is_frame) = 1 as has_heartbeat,
    max(spaced.is_person) = 1 as has_persons,
    coalesce(bool_and(told.has_tracks), true) as has_tracks,
    coalesce(bool_or(told.sends_pairs), false) or count(announced.camera_id) > 0 as sends_pairs
from spaced
inner join cameras on spaced.camera_id = cameras.camera_id
left join told on spaced.camera_id = told.camera_id and spaced.utc_day = told.utc_day
left join announced on spaced.camera_id = announced.camera_id and spaced.utc_day = announced.utc_day
group by spaced.utc_day, spaced.camera_id
order by spaced.utc_day, spaced.camera_id
