-- name: exports/figure_rows
-- One row per entry of a figure that is a list: a number or a text under its name.
-- grain: floor_id, week, metric, row_no, name
-- reads: reports
-- columns:
--   floor_id
--   week          ISO week, such as 2026-W46
--   metric        id in the catalogue, such as M15
--   row_no        row of the list, from 1
--   name          name of the entry, such as violation_rate, violation_rate_lo, state
--   number        its number; null where it is missing or a text
--   text          its text; null where it is missing or a number
-- assumes: names and meanings are those of the HTTP service
with listed as (
    select
        floor_id,
        report ->> '$.week.iso' as week,
        report -> '$.figures' as figures,
        unnest(json_keys(report, '$.figures')) as metric
    from reports
),

found as (
    select
        floor_id,
        week,
        metric,
        json_extract(figures, '$.' || metric || '.rows') as entries
    from listed
),

numbered as (
    select
        floor_id,
        week,
        metric,
        unnest(range(1, cast(json_array_length(entries) as bigint) + 1)) as row_no,
        entries
    from found
    where json_type(entries) = 'ARRAY'
),

picked as (
    select
        floor_id,
        week,
        metric,
        row_no,
        json_extract(entries, '$[' || (row_no - 1) || ']') as entry
    from numbered
),

named as (
    select
        floor_id,
        week,
        metric,
        row_no,
        entry,
        unnest(json_keys(entry)) as name
    from picked
)

select
    floor_id,
    week,
    metric,
    row_no,
    name,
    case
        when json_type(entry, '$.' || name) in ('DOUBLE', 'BIGINT', 'UBIGINT')
            then cast(json_extract_string(entry, '$.' || name) as double)
    end as number,
    case
        when json_type(entry, '$.' || name) not in ('DOUBLE', 'BIGINT', 'UBIGINT')
            then json_extract_string(entry, '$.' || name)
    end as text
from named
order by floor_id, week, cast(substr(metric, 2) as integer), row_no, name
