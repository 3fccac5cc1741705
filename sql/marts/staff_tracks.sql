-- name: marts/staff_tracks
-- One row per UTC hour and track of staff, and the rule that named it: a track is staff for its whole site day.
-- grain: hour, camera_id, track_id
-- reads: track_lives, area_stays, staff_tags, joined_persons, areas, calendar, site_days
-- params: staff_in_area_ms, staff_in_area_share, staff_in_view_ms, staff_closed_ms
-- columns:
--   hour       UTC hour number
--   camera_id
--   track_id   pseudonym of the engine's track number, of one site day
--   site_day   day in the site's zone that starts at day_starts; track ids end with it
--   rule       "tag", "area", "view" or "closed": the first of the four rules that names it
--   seen_ms    person-milliseconds in this hour, also those another camera counts
--   in_area_ms  person-milliseconds of the site day in areas of vsd.toml with staff = true, of this person on this camera
-- steps:
--   days    with join_views, tracks of one person: those of one camera add up, and who is staff on one camera is staff on all
--   judged  "tag" is the engine's word in more than half of the records of the site day;
--           "area" is staff_in_area_s in staff areas, and staff_in_area_share of the time in view; "view" is staff_in_view_s in view;
--           "closed" is staff_closed_s in view outside opening hours
--   lives   an hour is outside opening hours where its first and its last record are
--   inside  time inside is the share of records inside: also what another camera counts says who somebody is
-- assumes: facts of all people, of whole site days; a person whose track is cut is judged piece by piece, unless views are joined
with lives as (
    select
        site_days.site_day,
        l.hour,
        l.camera_id,
        l.track_id,
        coalesce(p.person_camera_id, l.camera_id) as person_camera_id,
        coalesce(p.person_track_id, l.track_id) as person_track_id,
        l.n_records,
        l.exposure_ms,
        case when of_first.is_open or of_last.is_open then 0 else l.exposure_ms end as closed_ms
    from track_lives as l
    inner join site_days on floor(l.first_ms / 900000) = site_days.quarter
    inner join calendar as of_first on floor(l.first_ms / 900000) = of_first.quarter
    inner join calendar as of_last on floor(l.last_ms / 900000) = of_last.quarter
    left join joined_persons as p
        on site_days.site_day = p.site_day and l.camera_id = p.camera_id and l.track_id = p.track_id
),

inside as (
    select
        area_stays.hour,
        area_stays.camera_id,
        area_stays.track_id,
        sum(area_stays.n_records) as n_records
    from area_stays
    inner join areas on area_stays.area_id = areas.area_id
    where areas.is_staff
    group by area_stays.hour, area_stays.camera_id, area_stays.track_id
),

days as (
    select
        lives.site_day,
        lives.person_camera_id,
        lives.person_track_id,
        lives.camera_id,
        2 * coalesce(sum(staff_tags.n_staff), 0) > sum(lives.n_records) as is_tagged,
        sum(lives.exposure_ms) as seen_ms,
        sum(lives.closed_ms) as closed_ms,
        sum(lives.exposure_ms * coalesce(inside.n_records, 0) / lives.n_records) as in_area_ms
    from lives
    left join inside
        on lives.hour = inside.hour and lives.camera_id = inside.camera_id and lives.track_id = inside.track_id
    left join staff_tags
        on lives.hour = staff_tags.hour and lives.camera_id = staff_tags.camera_id and lives.track_id = staff_tags.track_id
    group by lives.site_day, lives.person_camera_id, lives.person_track_id, lives.camera_id
),

judged as (
    select
        days.site_day,
        days.person_camera_id,
        days.person_track_id,
        case
            when bool_or(days.is_tagged) then 'tag'
            when bool_or(days.in_area_ms >= s.staff_in_area_ms and days.in_area_ms >= s.staff_in_area_share * days.seen_ms) then 'area'
            when bool_or(days.seen_ms >= s.staff_in_view_ms) then 'view'
            when bool_or(days.closed_ms >= s.staff_closed_ms) then 'closed'
        end as rule
    from days
    cross join params as s
    group by days.site_day, days.person_camera_id, days.person_track_id
)

select
    lives.hour,
    lives.camera_id,
    lives.track_id,
    lives.site_day,
    judged.rule,
    lives.exposure_ms as seen_ms,
    cast(round(days.in_area_ms) as bigint) as in_area_ms
from lives
inner join judged
    on
        lives.site_day = judged.site_day
        and lives.person_camera_id = judged.person_camera_id
        and lives.person_track_id = judged.person_track_id
inner join days
    on
        lives.site_day = days.site_day
        and lives.person_camera_id = days.person_camera_id
        and lives.person_track_id = days.person_track_id
        and lives.camera_id = days.camera_id
where judged.rule is not null
order by lives.hour, lives.camera_id, lives.track_id
