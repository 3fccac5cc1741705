-- name: exports/hotspots
-- One row per floor, week and numbered spot of the page.
-- grain: floor_id, week, number
-- reads: reports
-- columns:
--   floor_id
--   week                  ISO week, such as 2026-W46
--   number                1 first
--   kind                  tested: a hotspot of a test over 28 days (M20); busiest: the busiest area, without a test
--   name                  area it lies in
--   area_id               area of vsd.toml; null outside areas
--   peak_x_m              middle of its cell with the most, floor metres, x to the right
--   peak_y_m              y up
--   ratio                 time too close over what the crowd of the place explains
--   ratio_lo              lower end of its 95 % interval
--   ratio_hi              upper end
--   ratio_state           ok, not_enough_data or not_measurable
--   excess_min_per_week   person-minutes too close a week over what the crowd explains
--   is_new                not there the week before; null where nobody can tell
--   sureness              high, medium or low
-- assumes: a spot whose counts are hidden has no figures
with cards as (
    select
        floor_id,
        report ->> '$.week.iso' as week,
        report ->> '$.spots.kind' as kind,
        unnest(cast(coalesce(report -> '$.spots.cards', cast('[]' as json)) as json[])) as card
    from reports
)

select
    floor_id,
    week,
    cast(card ->> '$.number' as integer) as number,
    kind,
    card ->> '$.name' as name,
    card ->> '$.area_id' as area_id,
    cast(card ->> '$.at[0]' as double) as peak_x_m,
    cast(card ->> '$.at[1]' as double) as peak_y_m,
    cast(card ->> '$.ratio.value' as double) as ratio,
    cast(card ->> '$.ratio.lo' as double) as ratio_lo,
    cast(card ->> '$.ratio.hi' as double) as ratio_hi,
    card ->> '$.ratio.state' as ratio_state,
    cast(card ->> '$.excess_min_per_week' as double) as excess_min_per_week,
    cast(card ->> '$.is_new' as boolean) as is_new,
    card ->> '$.evidence.sureness' as sureness
from cards
order by floor_id, week, number
