-- name: marts/together_days
-- One row per camera and site day with tracks: person-time in groups that walk or stand, and the time pairs were in violation in them.
-- stored_by: site_day
-- grain: camera_id, site_day
-- reads: track_days, track_groups, pair_days, standing_groups, site_days
-- columns:
--   camera_id
--   site_day     day in the site's zone that starts at day_starts; track ids end with it
--   n_tracks     track ids
--   exposure_s   person-seconds of them, also where another camera counts
--   together_s   person-seconds of those in groups: all of who walks in one, the windows of who is standing in one
--   n_pairs      pairs of tracks that were closer than distance_m
--   n_unknown    those of which it cannot be known whether they move together
--   violation_s  seconds that pairs were in violation, summed over pairs
--   within_s     those of pairs that walk in one group, and those in windows in which a pair is standing in one company
-- assumes: each camera is computed by itself: track ids of different cameras are unrelated
with standing as (
    select
        standing_groups.camera_id,
        site_days.site_day,
        standing_groups.track_id,
        sum(standing_groups.exposure_ms) / 1000 as standing_s
    from standing_groups
    inner join site_days on floor(standing_groups.window_ms / 900000) = site_days.quarter
    group by standing_groups.camera_id, site_days.site_day, standing_groups.track_id
),

tracks as (
    select
        track_days.camera_id,
        track_days.site_day,
        count(*) as n_tracks,
        sum(track_days.exposure_s) as exposure_s,
        sum(case when track_groups.group_id is null then coalesce(standing.standing_s, 0) else track_days.exposure_s end) as together_s
    from track_days
    inner join track_groups
        on
            track_days.camera_id = track_groups.camera_id
            and track_days.site_day = track_groups.site_day
            and track_days.track_id = track_groups.track_id
    left join standing
        on
            track_days.camera_id = standing.camera_id
            and track_days.site_day = standing.site_day
            and track_days.track_id = standing.track_id
    group by track_days.camera_id, track_days.site_day
),

pairs_of_day as (
    select
        pair_days.camera_id,
        pair_days.site_day,
        count(*) as n_pairs,
        count(*) filter (where pair_days.moves_together is null) as n_unknown,
        sum(pair_days.violation_s) as violation_s,
        sum(case when a.group_id = b.group_id then pair_days.violation_s else pair_days.standing_s end) as within_s
    from pair_days
    left join track_groups as a
        on pair_days.camera_id = a.camera_id and pair_days.site_day = a.site_day and pair_days.track_a = a.track_id
    left join track_groups as b
        on pair_days.camera_id = b.camera_id and pair_days.site_day = b.site_day and pair_days.track_b = b.track_id
    group by pair_days.camera_id, pair_days.site_day
)

select
    tracks.camera_id,
    tracks.site_day,
    tracks.n_tracks,
    tracks.exposure_s,
    tracks.together_s,
    coalesce(pairs_of_day.n_pairs, 0) as n_pairs,
    coalesce(pairs_of_day.n_unknown, 0) as n_unknown,
    coalesce(pairs_of_day.violation_s, 0) as violation_s,
    coalesce(pairs_of_day.within_s, 0) as within_s
from tracks
left join pairs_of_day on tracks.camera_id = pairs_of_day.camera_id and tracks.site_day = pairs_of_day.site_day
order by tracks.site_day, tracks.camera_id
