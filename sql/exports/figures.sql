-- name: exports/figures
-- One row per floor, week and figure of the catalogue (M0, M1, ...).
-- grain: floor_id, week, metric
-- reads: reports
-- columns:
--   floor_id
--   week          ISO week, such as 2026-W46
--   metric        id in the catalogue, such as M6
--   unit          unit in words
--   value         the figure; null where it is missing or a list
--   lo            lower end of its 95 % interval
--   hi            upper end
--   denominator   what it was divided by
--   verdict       what may be said about its change
--   state         ok, not_enough_data or not_measurable
--   reason        why it is missing
-- assumes: the rows of a figure that is a list are in figure_rows
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
        json_extract(figures, '$.' || metric) as figure
    from listed
)

select
    floor_id,
    week,
    metric,
    figure ->> '$.unit' as unit,
    cast(figure ->> '$.value' as double) as value,
    cast(figure ->> '$.lo' as double) as lo,
    cast(figure ->> '$.hi' as double) as hi,
    cast(figure ->> '$.denominator' as double) as denominator,
    figure ->> '$.verdict' as verdict,
    figure ->> '$.state' as state,
    figure ->> '$.reason' as reason
from found
order by floor_id, week, cast(substr(metric, 2) as integer)
