-- name: facts/sequence_runs
-- One row per camera, UTC hour and unbroken stretch of the engine's running number: which messages arrived.
-- The engine has started a new count when the number falls after a minute of silence; when all numbers of a minute are below all those
-- of the minute before; or when it falls to 0 or 1, with no higher number right after. Any other fall is a clock that was set: then the
-- numbers give the order.
-- stored_by: utc_day
-- grain: hour, camera_id, restarts, first_seq
-- reads: stored_frames
-- params: number_silence_ms
-- columns:
--   hour        UTC hour number
--   camera_id
--   restarts    new counts of the engine in this hour so far; message_gaps decides whether 0 continues the count of the hour before
--   first_seq   first running number of the stretch
--   last_seq    last one; every number between arrived
--   first_ms    earliest message of the stretch, milliseconds since 1970, UTC
--   last_ms     latest one
--   n_messages  messages of the stretch
-- steps:
--   falling      hours of a camera with a number that is not above the one before: only these need the rule above
--   edges        in all other hours each stretch begins where a number is left out, and with the hour
--   rising       a stretch ends with the message before the next stretch begins; the last one with the hour
--   unsteady     the rule looks a minute to either side; over more than five minutes of silence it says nothing
--   neighboured  60000 ms is the minute of the rule above
--   marked       over an hour with more than number_silence_ms of silence before it, message_gaps decides; a count below 5 is too short to
--                say that a fall to 0 or 1 is a new count
--   islands      number minus rank is the same for all numbers without a gap between them
-- assumes: numbers rise by one from message to message; frames without a number are ignored
with numbered as (
    select
        camera_id,
        seq,
        unix_millis(ts) as ts_ms,
        cast(floor(unix_millis(ts) / 3600000) as bigint) as hour
    from stored_frames
    where seq is not null
),

in_time as (
    select
        hour,
        camera_id,
        ts_ms,
        seq,
        lag(hour) over (partition by camera_id order by ts_ms) as before_hour,
        lag(ts_ms) over (partition by camera_id order by ts_ms) as before_ms,
        lag(seq) over (partition by camera_id order by ts_ms) as before_seq
    from numbered
),

falling as (
    select distinct
        hour,
        camera_id
    from in_time
    where seq <= before_seq
),

edges as (
    select
        t.hour,
        t.camera_id,
        t.ts_ms,
        t.seq,
        t.before_ms,
        t.before_seq
    from in_time as t
    left join falling as f on t.hour = f.hour and t.camera_id = f.camera_id
    where f.hour is null and (t.before_hour is null or t.before_hour < t.hour or t.seq > t.before_seq + 1)
),

hour_ends as (
    select
        hour,
        camera_id,
        max(ts_ms) as last_ms,
        max(seq) as last_seq
    from numbered
    group by hour, camera_id
),

rising as (
    select
        hour,
        camera_id,
        seq as first_seq,
        ts_ms as first_ms,
        lead(before_seq) over (partition by hour, camera_id order by ts_ms) as last_seq,
        lead(before_ms) over (partition by hour, camera_id order by ts_ms) as last_ms
    from edges
),

-- the hours in which a number falls, and the minutes around them
unsteady as (
    select
        n.hour,
        n.camera_id,
        n.ts_ms,
        n.seq
    from numbered as n
    inner join (
        select distinct
            f.camera_id,
            f.hour + k.beside as hour
        from falling as f
        cross join (
            select -1 as beside
            union all
            select 0 as beside
            union all
            select 1 as beside
        ) as k
    ) as h on n.camera_id = h.camera_id and n.hour = h.hour
),

neighboured as (
    select
        hour,
        camera_id,
        ts_ms,
        seq,
        lag(hour) over by_time as before_hour,
        ts_ms - (lag(ts_ms) over by_time) as silence_ms,
        lag(seq) over by_time as before_seq,
        min(seq) over (partition by camera_id order by ts_ms range between 60000 preceding and 1 preceding) as least_before,
        max(seq) over (partition by camera_id order by ts_ms range between current row and 60000 following) as most_after,
        case when (lead(ts_ms, 1) over by_time) - ts_ms <= 60000 then lead(seq, 1) over by_time else 0 end as after_1_seq,
        case when (lead(ts_ms, 2) over by_time) - ts_ms <= 60000 then lead(seq, 2) over by_time else 0 end as after_2_seq
    from unsteady
    window
        by_time as (partition by camera_id order by ts_ms)
),

marked as (
    select
        hour,
        camera_id,
        ts_ms,
        seq,
        case
            when before_seq is null or seq >= before_seq then 0
            when before_hour < hour and silence_ms > params.number_silence_ms then 0
            when silence_ms > 60000 or most_after < least_before then 1
            when seq <= 1 and before_seq >= 5 and after_1_seq < before_seq and after_2_seq < before_seq then 1
            else 0
        end as is_restart
    from neighboured
    cross join params
),

counted as (
    select
        hour,
        camera_id,
        ts_ms,
        seq,
        sum(is_restart) over (
            partition by camera_id, hour order by ts_ms rows between unbounded preceding and current row
        ) as restarts
    from marked
),

numbers as (
    select
        hour,
        camera_id,
        restarts,
        seq,
        min(ts_ms) as first_ms,
        max(ts_ms) as last_ms
    from counted
    group by hour, camera_id, restarts, seq
),

islands as (
    select
        hour,
        camera_id,
        restarts,
        seq,
        first_ms,
        last_ms,
        seq - row_number() over (partition by hour, camera_id, restarts order by seq) as island
    from numbers
),

fallen as (
    select
        i.hour,
        i.camera_id,
        cast(i.restarts as bigint) as restarts,
        min(i.seq) as first_seq,
        max(i.seq) as last_seq,
        min(i.first_ms) as first_ms,
        max(i.last_ms) as last_ms,
        count(*) as n_messages
    from islands as i
    inner join falling as f on i.hour = f.hour and i.camera_id = f.camera_id
    group by i.hour, i.camera_id, i.restarts, i.island
)

select
    r.hour,
    r.camera_id,
    cast(0 as bigint) as restarts,
    r.first_seq,
    coalesce(r.last_seq, e.last_seq) as last_seq,
    r.first_ms,
    coalesce(r.last_ms, e.last_ms) as last_ms,
    coalesce(r.last_seq, e.last_seq) - r.first_seq + 1 as n_messages
from rising as r
inner join hour_ends as e on r.hour = e.hour and r.camera_id = e.camera_id
union all
select
    hour,
    camera_id,
    restarts,
    first_seq,
    last_seq,
    first_ms,
    last_ms,
    n_messages
from fallen
order by hour, camera_id, restarts, first_seq
