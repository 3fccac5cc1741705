-- name: marts/episode_areas
-- One row per episode: the area in which most of its person-time in violation lies.
-- grain: camera_id, track_a, track_b, started_ms
-- reads: episodes, camera_episodes, joined_segments, shared_episodes, episode_cells, area_cells, cameras
-- columns:
--   camera_id     the camera that counts it, as in episodes
--   track_a       the lesser track id
--   track_b       the greater track id
--   started_ms    milliseconds since 1970, UTC, as in episodes
--   local_date
--   area_id       area of vsd.toml; null for the rest of the floor, which is one place beside the areas
--   share         share of the episode's person-time in violation that lies there, above 0 to 1; null where only its middle is known
-- steps:
--   members  as in episodes: the camera that counts an episode gives its key, and members that own no record are left out where another
--            member owns one
--   stood    both people of all members, each where they stand
--   ranked   of places with equal time the one with the episode's middle, as in a frame in which one person stands on either side of a
--            border; else the first by id
-- assumes: where the cells are unknown (hours sealed by older versions) the area of the cell of its mean midpoint
with numbered as (
    select
        e.camera_id,
        e.track_a,
        e.track_b,
        e.from_ms,
        e.n_records,
        e.number,
        e.is_owned,
        coalesce(shared_episodes.first, e.number) as episode,
        bool_or(e.is_owned) over (partition by coalesce(shared_episodes.first, e.number)) as any_owned
    from camera_episodes as e
    left join shared_episodes on e.number = shared_episodes.number
),

members as (
    select
        number,
        camera_id,
        is_owned,
        first_value(camera_id) over by_rank as counting_camera_id,
        first_value(track_a) over by_rank as counted_track_a,
        first_value(track_b) over by_rank as counted_track_b,
        min(from_ms) over (partition by episode) as counted_from_ms
    from numbered
    where is_owned = any_owned
    window
        by_rank as (partition by episode order by n_records desc, number asc)
),

stood as (
    select
        m.counting_camera_id as camera_id,
        m.counted_track_a as track_a,
        m.counted_track_b as track_b,
        m.counted_from_ms as started_ms,
        area_cells.area_id,
        sum(case when m.is_owned then c.owned_ms else c.violation_ms end) as violation_ms
    from members as m
    inner join cameras on m.camera_id = cameras.camera_id
    inner join joined_segments as j on m.number = j.number
    inner join episode_cells as c
        on
            j.camera_id = c.camera_id
            and j.track_a = c.track_a
            and j.track_b = c.track_b
            and j.started_ms = c.started_ms
    left join area_cells
        on
            cameras.floor_id = area_cells.floor_id
            and c.cx = area_cells.cx
            and c.cy = area_cells.cy
            and m.counted_from_ms >= area_cells.from_ms
            and m.counted_from_ms < area_cells.to_ms
    group by
        m.counting_camera_id, m.counted_track_a, m.counted_track_b, m.counted_from_ms, area_cells.area_id
),

middles as (
    select
        episodes.camera_id,
        episodes.track_a,
        episodes.track_b,
        episodes.started_ms,
        episodes.local_date,
        area_cells.area_id as middle_area_id
    from episodes
    inner join cameras on episodes.camera_id = cameras.camera_id
    left join area_cells
        on
            cameras.floor_id = area_cells.floor_id
            and episodes.cx = area_cells.cx
            and episodes.cy = area_cells.cy
            and episodes.started_ms >= area_cells.from_ms
            and episodes.started_ms < area_cells.to_ms
),

ranked as (
    select
        m.camera_id,
        m.track_a,
        m.track_b,
        m.started_ms,
        m.local_date,
        case when stood.violation_ms > 0 then stood.area_id else m.middle_area_id end as area_id,
        stood.violation_ms / nullif(sum(stood.violation_ms) over episode, 0) as share,
        row_number() over (
            partition by m.camera_id, m.track_a, m.track_b, m.started_ms
            order by
                stood.violation_ms desc nulls last,
                (coalesce(stood.area_id, '') = coalesce(m.middle_area_id, '')) desc,
                stood.area_id asc nulls last
        ) as rank
    from middles as m
    left join stood
        on
            m.camera_id = stood.camera_id
            and m.track_a = stood.track_a
            and m.track_b = stood.track_b
            and m.started_ms = stood.started_ms
    window
        episode as (partition by m.camera_id, m.track_a, m.track_b, m.started_ms)
)

select
    camera_id,
    track_a,
    track_b,
    started_ms,
    local_date,
    area_id,
    share
from ranked
where rank = 1
order by started_ms, camera_id, track_a, track_b
