-- name: staging/in_violation
-- One row per person and instant with at least one neighbour closer than distance_m.
-- grain: camera_id, ts_ms, member
-- reads: pairs, cameras, owner_cells
-- params: distance_mm, owner_cell_mm
-- columns:
--   camera_id
--   ts_ms           milliseconds since 1970, UTC
--   member          number of the person, as in pairs
--   track_id        null when the engine does not track
--   n_others        others closer than distance_m, at least 1
--   n_named         those with a track id
--   first_other_id  least track id of them, null without any
--   last_other_id   greatest track id of them
--   x_mm            floor millimetres, null when unknown
--   y_mm            floor millimetres
--   weight_ms       person-time: that of the instant
--   is_owned        false where another camera counts, because it sees the place better; without a position, that of the pairs
-- steps:
--   persons  one row per person however many neighbours are close: person-time is counted once
-- assumes: a person with three close neighbours is one person in violation
with sides as (
    select
        p.camera_id,
        p.ts_ms,
        p.member_a as member,
        p.track_a as track_id,
        p.track_b as other_id,
        p.x_a_mm as x_mm,
        p.y_a_mm as y_mm,
        p.weight_ms,
        p.is_owned
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
    union all
    select
        p.camera_id,
        p.ts_ms,
        p.member_b as member,
        p.track_b as track_id,
        p.track_a as other_id,
        p.x_b_mm as x_mm,
        p.y_b_mm as y_mm,
        p.weight_ms,
        p.is_owned
    from pairs as p
    cross join params as s
    where p.distance_mm < s.distance_mm
),

persons as (
    select
        camera_id,
        ts_ms,
        member,
        min(track_id) as track_id,
        count(*) as n_others,
        count(other_id) as n_named,
        min(other_id) as first_other_id,
        max(other_id) as last_other_id,
        min(x_mm) as x_mm,
        min(y_mm) as y_mm,
        min(weight_ms) as weight_ms,
        bool_or(is_owned) as is_owned
    from sides
    group by camera_id, ts_ms, member
)

select
    p.camera_id,
    p.ts_ms,
    p.member,
    p.track_id,
    p.n_others,
    p.n_named,
    p.first_other_id,
    p.last_other_id,
    p.x_mm,
    p.y_mm,
    p.weight_ms,
    case when p.x_mm is null then p.is_owned else coalesce(owner_cells.camera_id = p.camera_id, true) end as is_owned
from persons as p
cross join params as s
left join cameras on p.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and p.ts_ms >= owner_cells.from_ms
        and p.ts_ms < owner_cells.to_ms
        and cast(floor(p.x_mm / s.owner_cell_mm) as integer) = owner_cells.cx
        and cast(floor(p.y_mm / s.owner_cell_mm) as integer) = owner_cells.cy
