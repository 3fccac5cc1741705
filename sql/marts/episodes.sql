-- name: marts/episodes
-- One row per episode of a pair, from meeting to parting (joined_segments), over hours, midnight, id switches, doubles and cameras.
-- stored_by: local_date
-- grain: camera_id, track_a, track_b, started_ms
-- reads: whole_episodes, calendar, site_days, track_groups, standing_episodes
-- params: cell_mm
-- columns:
--   camera_id        the camera that counts it: of those that saw it, the one with most records that count
--   track_a          the lesser of the two track ids that this camera gave first
--   track_b          the greater one
--   started_ms       first violation record that counts, of any camera, milliseconds since 1970, UTC
--   ended_ms         last violation record that counts
--   duration_s       closer than distance_m, with gaps up to gap_ms; where frames do not show its ends, half a frame interval more
--   is_cut           seen in part: the frames do not show when they came closer or parted; null in hours sealed by older versions
--   n_records        violation records that count, each with the camera that owns its midpoint
--   x_m              mean midpoint, floor metres; null without positions
--   y_m              mean midpoint, floor metres
--   cx               floor(x / cell_m)
--   cy               floor(y / cell_m)
--   min_distance_m   closest approach
--   mean_distance_m  mean over records of the cameras that count any
--   is_violation     it lasted at least episode_min_s: what reports call a violation
--   is_owned         false where no record counts: another camera sees the place better
--   hour_start_ms    UTC instant of the local hour it started in; it belongs to that hour and day
--   local_date
--   local_hour       0 to 23
--   is_open          it started in opening hours
--   is_together      the two walk in one group of that site day, or stand in one company for half of it; null where unknown
-- figure: M8 Violations counted
--   definition   violations in camera-hours that enter rates, and beside them episodes of any length
--   unit         violations
--   denominator  recorded open camera-hours, with the share recorded beside
--   needs        0, or at least mask_below
--   uncertainty  none: a raw count
--   by           vsd_analytics.figures.panels.FloorHours
-- figure: M12 Close contacts
--   definition   pairs whose episodes sum to 15 minutes within 24 hours
--   unit         pairs
--   denominator  pairs with any violation record
--   needs        half of violation time in ids that can be followed for 15 minutes
--   uncertainty  a lower bound
--   by           vsd_analytics.figures.episodes.episode_figures
-- steps:
--   tracks  the groups are computed once, for both people
-- assumes: segments of the hours around the calendar are loaded, so that an episode is whole; one that began before it is left out
with tracks as materialized (
    select
        camera_id,
        site_day,
        track_id,
        group_id
    from track_groups
)

select
    s.camera_id,
    s.track_a,
    s.track_b,
    s.started_ms,
    s.ended_ms,
    s.duration_ms / 1000 as duration_s,
    s.is_cut,
    s.n_records,
    s.x_mm / 1000 as x_m,
    s.y_mm / 1000 as y_m,
    floor(s.x_mm / params.cell_mm)::int as cx,
    floor(s.y_mm / params.cell_mm)::int as cy,
    s.min_distance_mm / 1000 as min_distance_m,
    s.mean_distance_mm / 1000 as mean_distance_m,
    s.is_violation,
    s.is_owned,
    calendar.hour_start_ms,
    calendar.local_date,
    calendar.local_hour,
    calendar.is_open,
    case
        when s.x_mm is not null and a.track_id is not null and b.track_id is not null
            then coalesce(a.group_id = b.group_id, false) or standing.started_ms is not null
    end as is_together
from whole_episodes as s
cross join params
inner join calendar on floor(s.started_ms / 900000) = calendar.quarter
left join site_days on floor(s.started_ms / 900000) = site_days.quarter
left join tracks as a
    on s.camera_id = a.camera_id and site_days.site_day = a.site_day and s.track_a = a.track_id
left join tracks as b
    on s.camera_id = b.camera_id and site_days.site_day = b.site_day and s.track_b = b.track_id
left join standing_episodes as standing
    on
        s.camera_id = standing.camera_id
        and s.track_a = standing.track_a
        and s.track_b = standing.track_b
        and s.started_ms = standing.started_ms
order by s.started_ms, s.camera_id, s.track_a, s.track_b
