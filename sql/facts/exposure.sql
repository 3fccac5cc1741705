-- name: facts/exposure
-- One row per camera and UTC quarter-hour in which anybody was seen: person records and person-time.
-- stored_by: utc_day
-- grain: camera_id, quarter
-- reads: located
-- columns:
--   hour             UTC hour number
--   camera_id
--   quarter          UTC quarter-hours since 1970
--   person_records   person records counted by this camera (where views overlap, one camera counts)
--   n_doubled        person records left to another camera that sees the place better
--   n_unlocated      person records without a floor position
--   exposure_ms      person-milliseconds in view: sum of the weights of person_records
-- figure: M3 People exposure
--   definition   person-seconds in camera-hours that enter rates / 3600
--   unit         person-hours
--   denominator  recorded open camera-hours
--   needs        persons sent, not pairs only
--   uncertainty  that of M5 over the same hours: what weeks like this one have
--   by           vsd_analytics.figures.person_time.person_time
-- figure: M5 Mean and peak people in view
--   definition   sum over cameras of person-hours / recorded open hours of that camera; and the fullest quarter-hour
--   unit         people
--   denominator  recorded open camera-hours
--   needs        persons sent; 5 recorded days for an interval
--   uncertainty  day-clustered 95 % interval of the mean; none of the peak
--   by           vsd_analytics.figures.person_time.person_time
-- assumes: a record without a floor position is counted by its own camera
with records as (
    select
        camera_id,
        cast(floor(ts_ms / 900000) as bigint) as quarter,
        is_owned,
        x_mm,
        weight_ms
    from located
)

select
    cast(floor(quarter / 4) as bigint) as hour,
    camera_id,
    quarter,
    count(*) filter (where is_owned) as person_records,
    count(*) filter (where not is_owned) as n_doubled,
    count(*) filter (where x_mm is null) as n_unlocated,
    cast(sum(case when is_owned then weight_ms else 0 end) as bigint) as exposure_ms
from records
group by camera_id, quarter
order by hour, camera_id, quarter
