-- name: facts/camera_days
-- One row per camera and UTC day with records: its frame interval, and what its engine reports.
-- unit: day
-- grain: utc_day, camera_id
-- reads: stored_frames, stored_observations, stored_pairs, cameras
-- params: unknown_interval_ms, longest_interval_ms
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
--                recalibrations; other rules; frame intervals; cameras that lose or gain people beside their neighbours
--   unit         list
--   denominator  person records
--   needs        always shown
--   uncertainty  none; of the cameras' people a CUSUM of weeks
--   by           vsd_analytics.figures.catalogue.recording.recording
-- steps:
--   seen      an engine that reports n_pairs sends pairs, also on a day without any
--   reported  per day, because an engine may start to send ids or pairs after an update
--   instants  only of cameras whose frame rate vsd.toml does not say: of the others no time between frames is needed
--   spaced    the median ignores outages; 1200000 ms (20 minutes) is the longest interval, so that an hour needs no more than its
--             neighbours
-- assumes: a whole UTC day of stored records is loaded; a longer interval than 20 minutes counts as 20 minutes
with seen as (
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        1 as is_frame,
        case when n_persons is null then 0 else 1 end as is_person,
        case when n_pairs is null then 0 else 1 end as is_pair,
        0 as is_record,
        0 as is_tracked
    from stored_frames
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        0 as is_frame,
        1 as is_person,
        0 as is_pair,
        1 as is_record,
        case when track_id is null then 0 else 1 end as is_tracked
    from stored_observations
    union all
    select
        camera_id,
        unix_millis(ts) as ts_ms,
        0 as is_frame,
        0 as is_person,
        1 as is_pair,
        1 as is_record,
        case when track_a is null or track_b is null then 0 else 1 end as is_tracked
    from stored_pairs
),

reported as (
    select
        camera_id,
        cast(floor(ts_ms / 86400000) as bigint) as utc_day,
        max(is_frame) = 1 as has_heartbeat,
        max(is_person) = 1 as has_persons,
        2 * sum(is_tracked) >= sum(is_record) as has_tracks,
        max(is_pair) = 1 as sends_pairs
    from seen
    group by camera_id, cast(floor(ts_ms / 86400000) as bigint)
),

instants as (
    select distinct
        seen.camera_id,
        seen.ts_ms,
        cast(floor(seen.ts_ms / 86400000) as bigint) as utc_day
    from seen
    inner join cameras on seen.camera_id = cameras.camera_id
    where cameras.interval_ms is null
),

spaced as (
    select
        utc_day,
        camera_id,
        ts_ms - lag(ts_ms) over (partition by camera_id, utc_day order by ts_ms) as since_ms
    from instants
),

medians as (
    select
        utc_day,
        camera_id,
        cast(round(percentile_cont(0.5) within group (order by since_ms)) as bigint) as interval_ms
    from spaced
    group by utc_day, camera_id
)

select
    reported.utc_day,
    reported.camera_id,
    least(coalesce(cameras.interval_ms, medians.interval_ms, params.unknown_interval_ms), params.longest_interval_ms) as interval_ms,
    reported.has_heartbeat,
    reported.has_persons,
    reported.has_tracks,
    reported.sends_pairs
from reported
cross join params
left join cameras on reported.camera_id = cameras.camera_id
left join medians on reported.camera_id = medians.camera_id and reported.utc_day = medians.utc_day
order by reported.utc_day, reported.camera_id
