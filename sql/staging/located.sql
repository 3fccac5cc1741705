-- name: staging/located
-- One row per stored record of a person who is counted, with its floor position: as sent, or by the calibration in force.
-- grain: camera_id, ts_ms, member
-- reads: stored_observations, calibrations, cameras, owner_cells, instants, staff
-- params: coordinate_max_mm, owner_cell_mm, people
-- columns:
--   camera_id
--   ts_ms      milliseconds since 1970, UTC
--   member     number of the person within camera and instant, in a fixed order whatever file the record came in
--   track_id   null when the engine does not track
--   x_mm       floor millimetres; null when the record has pixels only and no calibration, or lies at the horizon
--   y_mm       floor millimetres
--   weight_ms  person-time of the record: that of its instant
--   is_owned   false where another camera counts it, because it sees the place better
-- steps:
--   projected  homogeneous coordinates: place = (wx, wy) / w; w_sign makes w positive on the near side of the horizon
--   placed     compared as products, not quotients: near the horizon w approaches 0 and the quotient overflows
-- assumes: who has no track id is no staff; a record with both floor millimetres and pixels uses the millimetres
with projected as (
    select
        o.camera_id,
        unix_millis(o.ts) as ts_ms,
        o.person,
        o.track_id,
        o.x_mm,
        o.y_mm,
        o.u_px,
        o.v_px,
        c.w_sign * (c.h31 * o.u_px + c.h32 * o.v_px + c.h33) as w,
        c.w_sign * 1000 * (c.h11 * o.u_px + c.h12 * o.v_px + c.h13) as wx_mm,
        c.w_sign * 1000 * (c.h21 * o.u_px + c.h22 * o.v_px + c.h23) as wy_mm
    from stored_observations as o
    left join calibrations as c
        on
            o.camera_id = c.camera_id
            and unix_millis(o.ts) >= c.from_ms
            and unix_millis(o.ts) < c.to_ms
    cross join params
    left join staff
        on
            o.camera_id = staff.camera_id
            and o.track_id = staff.track_id
            and cast(floor(unix_millis(o.ts) / 3600000) as bigint) = staff.hour
    where params.people = 'all' or (params.people = 'staff') = (staff.track_id is not null)
),

placed as (
    select
        p.camera_id,
        p.ts_ms,
        p.person,
        p.track_id,
        p.u_px,
        p.v_px,
        case
            when p.x_mm is not null then p.x_mm
            when p.w > 0 and abs(p.wx_mm) < s.coordinate_max_mm * p.w and abs(p.wy_mm) < s.coordinate_max_mm * p.w
                then cast(round(p.wx_mm / p.w) as integer)
        end as x_mm,
        case
            when p.x_mm is not null then p.y_mm
            when p.w > 0 and abs(p.wx_mm) < s.coordinate_max_mm * p.w and abs(p.wy_mm) < s.coordinate_max_mm * p.w
                then cast(round(p.wy_mm / p.w) as integer)
        end as y_mm
    from projected as p
    cross join params as s
)

select
    p.camera_id,
    p.ts_ms,
    row_number() over (
        partition by p.camera_id, p.ts_ms
        order by p.track_id nulls last, p.x_mm nulls last, p.y_mm nulls last, p.u_px nulls last, p.v_px nulls last, p.person
    ) as member,
    p.track_id,
    p.x_mm,
    p.y_mm,
    i.weight_ms,
    coalesce(owner_cells.camera_id = p.camera_id, true) as is_owned
from placed as p
cross join params as s
inner join instants as i on p.camera_id = i.camera_id and p.ts_ms = i.ts_ms
left join cameras on p.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and p.ts_ms >= owner_cells.from_ms
        and p.ts_ms < owner_cells.to_ms
        and cast(floor(p.x_mm / s.owner_cell_mm) as integer) = owner_cells.cx
        and cast(floor(p.y_mm / s.owner_cell_mm) as integer) = owner_cells.cy
