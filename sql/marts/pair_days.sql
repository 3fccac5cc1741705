-- name: marts/pair_days
-- One row per pair of tracks and site day in which they were closer than distance_m, with whether they move together.
-- stored_by: site_day
-- grain: camera_id, site_day, track_a, track_b
-- reads: track_pairs, track_days, site_days
-- params: together_share, together_walk_mm, together_min_ms, together_min_records
-- columns:
--   camera_id
--   site_day        day in the site's zone that starts at day_starts; track ids end with it
--   track_a         the lesser track id
--   track_b         the greater track id
--   n_records       violation records
--   violation_s     time in violation
--   standing_s      that in windows in which they stand in one company
--   near_share      share of the violation records at most together_m apart
--   life_share      violation records / records that have either of them; null where no persons are sent
--   walked_m        from the midpoint of the first violation record to that of the last; null without positions
--   moves_together  near_share at least half, life_share and walked_m as set, close for 2 s and in 3 records; null where either is
-- steps:
--   joined  n_either counts records with at least one of the two; the midpoint is half of the sum of both places, hence / 2
-- assumes: an hour's row belongs to the site day of its first violation record, which needs its place; without, of the hour's start
with days as (
    select
        track_pairs.camera_id,
        site_days.site_day,
        track_pairs.track_a,
        track_pairs.track_b,
        sum(track_pairs.n_records)::bigint as n_records,
        sum(track_pairs.n_near)::bigint as n_near,
        sum(track_pairs.violation_ms)::bigint as violation_ms,
        coalesce(sum(track_pairs.standing_ms), 0)::bigint as standing_ms,
        max_by(track_pairs.last_x2_mm, track_pairs.last_ms) - min_by(track_pairs.first_x2_mm, track_pairs.first_ms) as x2_mm,
        max_by(track_pairs.last_y2_mm, track_pairs.last_ms) - min_by(track_pairs.first_y2_mm, track_pairs.first_ms) as y2_mm
    from track_pairs
    inner join site_days on floor(coalesce(track_pairs.first_ms, track_pairs.hour * 3600000) / 900000) = site_days.quarter
    group by track_pairs.camera_id, site_days.site_day, track_pairs.track_a, track_pairs.track_b
),

joined as (
    select
        days.camera_id,
        days.site_day,
        days.track_a,
        days.track_b,
        days.n_records,
        days.n_near,
        days.violation_ms,
        days.standing_ms,
        a.n_records + b.n_records - days.n_records as n_either,
        sqrt(days.x2_mm * days.x2_mm + days.y2_mm * days.y2_mm) / 2 as walked_mm
    from days
    left join track_days as a
        on days.camera_id = a.camera_id and days.site_day = a.site_day and days.track_a = a.track_id
    left join track_days as b
        on days.camera_id = b.camera_id and days.site_day = b.site_day and days.track_b = b.track_id
)

select
    joined.camera_id,
    joined.site_day,
    joined.track_a,
    joined.track_b,
    joined.n_records,
    joined.violation_ms / 1000 as violation_s,
    joined.standing_ms / 1000 as standing_s,
    joined.n_near / joined.n_records as near_share,
    joined.n_records / joined.n_either as life_share,
    joined.walked_mm / 1000 as walked_m,
    case
        when joined.n_either is not null and joined.walked_mm is not null
            then
                2 * joined.n_near >= joined.n_records
                and joined.n_records >= params.together_share * joined.n_either
                and joined.walked_mm >= params.together_walk_mm
                and joined.n_records >= params.together_min_records
                and joined.violation_ms >= params.together_min_ms
    end as moves_together
from joined
cross join params
order by joined.site_day, joined.camera_id, joined.track_a, joined.track_b
