-- name: exports/areas
-- One row per floor, week and area, and one for the rest of the floor.
-- grain: floor_id, week, area_id
-- reads: reports
-- columns:
--   floor_id
--   week                            ISO week, such as 2026-W46
--   area_id                         area of vsd.toml; rest for the rest of the floor
--   name                            display name
--   violations                      violations in opening hours; null where hidden
--   violations_per_open_h           violations per open hour (M15)
--   violations_per_open_h_lo        lower end of its 95 % interval
--   violations_per_open_h_hi        upper end
--   violations_per_open_h_change    relative change from the week before
--   violations_per_open_h_change_lo lower end of its interval
--   violations_per_open_h_change_hi upper end
--   verdict                         what may be said about the change
--   violations_per_person_h         violations per person-hour
--   violations_per_person_h_lo      lower end of its interval
--   violations_per_person_h_hi      upper end
--   floor_share                     share of the floor's violations
--   exposure_h                      person-hours in view
--   recorded_share                  recorded over open camera-hours of the cameras that see it
--   state                           ok, not_enough_data or not_measurable; masked or held_back where hidden
--   reason                          why numbers are hidden, or a rate is missing or has no interval
-- assumes: where state is masked or held_back, all numbers but recorded_share are null
with listed as (
    select
        floor_id,
        report ->> '$.week.iso' as week,
        unnest(cast(report -> '$.areas' as json[])) as area
    from reports
),

marked as (
    select
        floor_id,
        week,
        area,
        case
            when cast(area ->> '$.is_masked' as boolean) then 'masked'
            when cast(area ->> '$.is_held_back' as boolean) then 'held_back'
            else area ->> '$.violation_rate.state'
        end as state,
        case
            when cast(area ->> '$.is_masked' as boolean) or cast(area ->> '$.is_held_back' as boolean) then cast('{}' as json)
            else area
        end as shown
    from listed
)

select
    floor_id,
    week,
    coalesce(area ->> '$.area_id', 'rest') as area_id,
    area ->> '$.name' as name,
    cast(shown ->> '$.counted' as bigint) as violations,
    cast(shown ->> '$.violation_rate.value' as double) as violations_per_open_h,
    cast(shown ->> '$.violation_rate.lo' as double) as violations_per_open_h_lo,
    cast(shown ->> '$.violation_rate.hi' as double) as violations_per_open_h_hi,
    cast(shown ->> '$.violation_rate.change' as double) as violations_per_open_h_change,
    cast(shown ->> '$.violation_rate.change_lo' as double) as violations_per_open_h_change_lo,
    cast(shown ->> '$.violation_rate.change_hi' as double) as violations_per_open_h_change_hi,
    shown ->> '$.violation_rate.verdict' as verdict,
    cast(shown ->> '$.encounter_rate.value' as double) as violations_per_person_h,
    cast(shown ->> '$.encounter_rate.lo' as double) as violations_per_person_h_lo,
    cast(shown ->> '$.encounter_rate.hi' as double) as violations_per_person_h_hi,
    cast(shown ->> '$.share' as double) as floor_share,
    cast(shown ->> '$.exposure_h' as double) as exposure_h,
    cast(area ->> '$.recorded_share' as double) as recorded_share,
    state,
    coalesce(area ->> '$.violation_rate.reason', area ->> '$.encounter_rate.reason') as reason
from marked
order by floor_id, week, area_id
