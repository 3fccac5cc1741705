-- name: audits/rows_outside_hour
-- One row per part with rows of another UTC hour than that of its name.
-- grain: stored_table, part
-- reads: part_frames, part_observations, part_pairs
-- columns:
--   stored_table  frames, observations or pairs
--   part          number of the part
--   n_rows        rows of other hours
--   first_ts      instant of the first of them, UTC
--   last_ts       of the last one
-- assumes: nothing
select
    'frames' as stored_table,
    part,
    count(*) as n_rows,
    min(ts) as first_ts,
    max(ts) as last_ts
from part_frames
where floor(unix_millis(ts) / 3600000) <> part_hour
group by part
union all
select
    'observations' as stored_table,
    part,
    count(*) as n_rows,
    min(ts) as first_ts,
    max(ts) as last_ts
from part_observations
where floor(unix_millis(ts) / 3600000) <> part_hour
group by part
union all
select
    'pairs' as stored_table,
    part,
    count(*) as n_rows,
    min(ts) as first_ts,
    max(ts) as last_ts
from part_pairs
where floor(unix_millis(ts) / 3600000) <> part_hour
group by part
order by stored_table, part
