-- name: marts/count_hours
-- One row per place that asks for its number of people, local hour and number present: the recorded opening time with so many.
-- grain: floor_id, area_id, hour_start_ms, n_people
-- reads: area_counts, calendar
-- columns:
--   floor_id
--   area_id          area of vsd.toml; null is the whole floor
--   hour_start_ms    UTC instant the local hour starts
--   local_date
--   n_people         people present at once, 0 included
--   recorded_open_s  seconds in opening hours in which every camera that counts somebody there in the hour recorded
-- figure: M39 People waiting
--   definition   number of people in each area with queue = true, over recorded open time: mean, and the number not exceeded for 90 %
--                of the time; for the days and by hour of day
--   unit         people
--   denominator  open hours in which all cameras that see the area recorded; they count for the same hours of the week that
--                were not recorded
--   needs        positions; 5 recorded days for an interval, with all hours of the day but 5 % of the open time among them
--   uncertainty  mean as M5; limits of the 90 % quantile where those of the share of time with more people cross 10 %
--   by           vsd_analytics.figures.queues.queues
-- figure: M41 Capacity used
--   definition   of each area or floor with a capacity: share of open time with at least 60 %, at least 100 %, and more than it; people
--                beyond it on average; person-time by floor for each person, in the levels of service of M33 (areas only), and
--                in IATA's of a queue (areas with `queue`): from 1.2 m² over-design, from 1.0 m² optimum, below it sub-optimum
--   unit         share of time; people; share of person-time
--   denominator  open hours in which all cameras that see the place recorded; they count for the same hours of the week that
--                were not recorded
--   needs        positions; 5 recorded days for an interval, with all hours of the day but 5 % of the open time among them
--   uncertainty  that of M5, over seconds instead of person-seconds
--   by           vsd_analytics.figures.capacities.capacity
-- assumes: an hour without a row is 0 people where all cameras recorded, unknown where one did not
select
    area_counts.floor_id,
    area_counts.area_id,
    calendar.hour_start_ms,
    min(calendar.local_date) as local_date,
    area_counts.n_people,
    sum(area_counts.recorded_ms) / 1000.0 as recorded_open_s
from area_counts
inner join calendar on area_counts.bucket_quarter = calendar.quarter
where calendar.is_open
group by area_counts.floor_id, area_counts.area_id, calendar.hour_start_ms, area_counts.n_people
order by calendar.hour_start_ms, area_counts.floor_id, area_counts.area_id, area_counts.n_people
