-- name: marts/message_gaps
-- One row per run of an engine's messages that never arrived (or are in quarantine), found by a gap in the running number,
-- and one per restart of its count.
-- grain: camera_id, run, first_missing
-- reads: sequence_runs, cameras, calendar
-- params: number_silence_ms
-- columns:
--   camera_id
--   camera_no      position in vsd.toml
--   run            number of the count, from 1 in the time that is loaded: an engine that restarts begins a new one
--   started_ms     last message before, milliseconds since 1970, UTC
--   ended_ms       first message after
--   is_restart     the engine began a new count: what it sent and lost around that is unknown
--   first_missing  first running number that is missing; null for a restart
--   last_missing   last one; null for a restart
--   n_missing      messages missing; null for a restart, as it is not known
-- steps:
--   compared   a lower number after five minutes of silence is a restart, after less a clock that was set
--   stretches  the greatest number of all earlier stretches, since stretches may overlap when a clock was set back
-- assumes: gaps and restarts that touch the calendar count; what is lost before the first and after the last message is not known
with runs as (
    select
        hour,
        camera_id,
        restarts,
        min(first_seq) as least_seq,
        max(last_seq) as most_seq,
        min(first_ms) as first_ms,
        max(last_ms) as last_ms
    from sequence_runs
    group by hour, camera_id, restarts
),

compared as (
    select
        hour,
        camera_id,
        restarts,
        first_ms,
        lag(last_ms) over in_time as before_ms,
        case
            when lag(hour) over in_time is null then 1
            when restarts > 0 then 1
            when first_ms - lag(last_ms) over in_time > params.number_silence_ms and least_seq < lag(most_seq) over in_time then 1
            else 0
        end as is_start
    from runs
    cross join params
    window
        in_time as (partition by camera_id order by hour, restarts)
),

numbered as (
    select
        hour,
        camera_id,
        restarts,
        first_ms,
        before_ms,
        is_start,
        sum(is_start) over (
            partition by camera_id order by hour, restarts rows between unbounded preceding and current row
        )::bigint as run
    from compared
),

stretches as (
    select
        numbered.camera_id,
        numbered.run,
        sequence_runs.first_seq,
        sequence_runs.first_ms,
        max(sequence_runs.last_seq) over earlier as before_seq,
        lag(sequence_runs.last_ms) over in_order as before_ms
    from sequence_runs
    inner join numbered
        on
            sequence_runs.camera_id = numbered.camera_id
            and sequence_runs.hour = numbered.hour
            and sequence_runs.restarts = numbered.restarts
    window
        in_order as (partition by numbered.camera_id, numbered.run order by sequence_runs.first_seq, sequence_runs.first_ms),
        earlier as (in_order rows between unbounded preceding and 1 preceding)
),

found as (
    select
        camera_id,
        run,
        least(before_ms, first_ms) as started_ms,
        greatest(before_ms, first_ms) as ended_ms,
        false as is_restart,
        before_seq + 1 as first_missing,
        first_seq - 1 as last_missing
    from stretches
    where first_seq > before_seq + 1
    union all
    select
        camera_id,
        run,
        before_ms as started_ms,
        first_ms as ended_ms,
        true as is_restart,
        null as first_missing,
        null as last_missing
    from numbered
    where is_start = 1 and before_ms is not null
),

bounds as (
    select
        min(quarter) * 900000 as first_ms,
        (max(quarter) + 1) * 900000 as end_ms
    from calendar
)

select
    found.camera_id,
    cameras.camera_no,
    found.run,
    found.started_ms,
    found.ended_ms,
    found.is_restart,
    found.first_missing,
    found.last_missing,
    found.last_missing - found.first_missing + 1 as n_missing
from found
inner join cameras on found.camera_id = cameras.camera_id
inner join bounds on found.ended_ms >= bounds.first_ms and found.started_ms < bounds.end_ms
order by found.started_ms, cameras.camera_no, found.run, found.first_missing
