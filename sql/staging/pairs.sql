-- name: staging/pairs
-- One row per unordered pair of persons within pair_max_m of each other in one frame: as the engine sent it, else derived from positions.
-- grain: camera_id, ts_ms, member_a, member_b
-- reads: located, instants, stored_frames, stored_pairs, cameras, owner_cells, staff
-- params: pair_max_mm, owner_cell_mm, people
-- columns:
--   hour         UTC hour number
--   camera_id
--   ts_ms        milliseconds since 1970, UTC
--   member_a     number of the first person within camera and instant, as in located; negative for a person who is in sent pairs only
--   member_b     number of the second person
--   track_a      track id of the first person, the lesser one where both are known
--   track_b      track id of the second person
--   x_a_mm       floor millimetres, null when unknown
--   y_a_mm       floor millimetres
--   x_b_mm       floor millimetres
--   y_b_mm       floor millimetres
--   distance_mm  whole millimetres, rounded down: strictly closer than D metres is distance_mm < 1000 D, exactly
--   weight_ms    time that the frame represents
--   is_owned     false where another camera counts it, because it sees the midpoint better
--   is_derived   true when the engine sends no pairs and this one was measured here
-- steps:
--   reported      a frame with n_pairs was reported with its pairs, also when it has none: deriving some would count people that the
--                 engine ruled out
--   unreported    people of all other frames that have a floor position
--   crowds        up to 40 people, comparing all pairs costs less than the squares below
--   reaching      within a square each pair is found once (after_member), between squares once as only half of the neighbours are
--                 visited
--   derived       members in order of their numbers, and the distance rounded down: distance_mm < 1000 D then says exactly "closer than
--                 D metres"
--   named         a pair that an engine sends has no reference to observations, so its persons get a name that is the same in all pairs
--                 of the frame; only of two people who are counted: a visitor and staff are no pair of visitors
--   sent_persons  the member number of the observation with the same track id; without one a negative number, so that both kinds never
--                 collide
--   sent          positions of the observations fill in for positions that the pair lacks
-- assumes: an engine that sends pairs for a frame sends all of them, so none are derived from its positions
with reported as (
    select
        camera_id,
        unix_millis(ts) as ts_ms
    from stored_frames
    where n_pairs is not null
    union
    select
        camera_id,
        unix_millis(ts) as ts_ms
    from stored_pairs
),

unreported as (
    select
        l.camera_id,
        l.ts_ms,
        l.member,
        l.track_id,
        l.x_mm,
        l.y_mm,
        l.weight_ms
    from located as l
    left join reported on l.camera_id = reported.camera_id and l.ts_ms = reported.ts_ms
    where l.x_mm is not null and reported.ts_ms is null
),

-- up to 40 people are compared each with each; more stand in squares of side pair_max, so that work grows with people, not pairs
crowds as (
    select
        camera_id,
        ts_ms
    from unreported
    group by camera_id, ts_ms
    having count(*) > 40
),

standing as (
    select
        u.camera_id,
        u.ts_ms,
        u.member,
        u.track_id,
        u.x_mm,
        u.y_mm,
        u.weight_ms,
        c.ts_ms is not null as is_crowded,
        case when c.ts_ms is null then 0 else cast(floor(u.x_mm / s.pair_max_mm) as integer) end as gx,
        case when c.ts_ms is null then 0 else cast(floor(u.y_mm / s.pair_max_mm) as integer) end as gy
    from unreported as u
    cross join params as s
    left join crowds as c on u.camera_id = c.camera_id and u.ts_ms = c.ts_ms
),

-- two people within pair_max stand in the same or in neighbouring squares; half the neighbours reach every pair once
neighbours as (
    select
        1 as dx,
        0 as dy
    union all
    select
        -1 as dx,
        1 as dy
    union all
    select
        0 as dx,
        1 as dy
    union all
    select
        1 as dx,
        1 as dy
),

reaching as (
    select
        camera_id,
        ts_ms,
        member,
        track_id,
        x_mm,
        y_mm,
        gx,
        gy,
        member as after_member
    from standing
    union all
    select
        u.camera_id,
        u.ts_ms,
        u.member,
        u.track_id,
        u.x_mm,
        u.y_mm,
        u.gx + n.dx as gx,
        u.gy + n.dy as gy,
        0 as after_member
    from standing as u
    cross join neighbours as n
    where u.is_crowded
),

candidates as (
    select
        a.camera_id,
        a.ts_ms,
        a.member < b.member as is_ordered,
        a.member as member_1,
        a.track_id as track_1,
        a.x_mm as x_1_mm,
        a.y_mm as y_1_mm,
        b.member as member_2,
        b.track_id as track_2,
        b.x_mm as x_2_mm,
        b.y_mm as y_2_mm,
        b.weight_ms,
        cast(a.x_mm - b.x_mm as bigint) * (a.x_mm - b.x_mm) + cast(a.y_mm - b.y_mm as bigint) * (a.y_mm - b.y_mm) as square_mm2
    from reaching as a
    inner join standing as b
        on a.camera_id = b.camera_id and a.ts_ms = b.ts_ms and a.gx = b.gx and a.gy = b.gy and a.after_member < b.member
),

derived as (
    select
        c.camera_id,
        c.ts_ms,
        case when c.is_ordered then c.member_1 else c.member_2 end as member_a,
        case when c.is_ordered then c.member_2 else c.member_1 end as member_b,
        case when c.is_ordered then c.track_1 else c.track_2 end as track_a,
        case when c.is_ordered then c.track_2 else c.track_1 end as track_b,
        case when c.is_ordered then c.x_1_mm else c.x_2_mm end as x_a_mm,
        case when c.is_ordered then c.y_1_mm else c.y_2_mm end as y_a_mm,
        case when c.is_ordered then c.x_2_mm else c.x_1_mm end as x_b_mm,
        case when c.is_ordered then c.y_2_mm else c.y_1_mm end as y_b_mm,
        cast(floor(sqrt(c.square_mm2)) as integer) as distance_mm,
        c.weight_ms
    from candidates as c
    cross join params as s
    where c.square_mm2 <= cast(s.pair_max_mm as bigint) * s.pair_max_mm
),

-- who is who in sent pairs: by track id, else by number and place within the frame
named as (
    select
        p.camera_id,
        unix_millis(p.ts) as ts_ms,
        p.track_a,
        p.track_b,
        p.x_a_mm,
        p.y_a_mm,
        p.x_b_mm,
        p.y_b_mm,
        p.distance_mm,
        coalesce(
            'track ' || p.track_a,
            cast(p.person_a as string) || coalesce(' at ' || cast(p.x_a_mm as string) || ' ' || cast(p.y_a_mm as string), '')
        ) as name_a,
        coalesce(
            'track ' || p.track_b,
            cast(p.person_b as string) || coalesce(' at ' || cast(p.x_b_mm as string) || ' ' || cast(p.y_b_mm as string), '')
        ) as name_b
    from stored_pairs as p
    cross join params
    left join staff as of_a
        on
            p.camera_id = of_a.camera_id
            and p.track_a = of_a.track_id
            and cast(floor(unix_millis(p.ts) / 3600000) as bigint) = of_a.hour
    left join staff as of_b
        on
            p.camera_id = of_b.camera_id
            and p.track_b = of_b.track_id
            and cast(floor(unix_millis(p.ts) / 3600000) as bigint) = of_b.hour
    where
        params.people = 'all'
        or (
            (params.people = 'staff') = (of_a.track_id is not null)
            and (params.people = 'staff') = (of_b.track_id is not null)
        )
),

names as (
    select
        camera_id,
        ts_ms,
        track_a as track_id,
        name_a as person
    from named
    union
    select
        camera_id,
        ts_ms,
        track_b as track_id,
        name_b as person
    from named
),

sent_persons as (
    select
        n.camera_id,
        n.ts_ms,
        n.person,
        coalesce(l.member, -row_number() over (partition by n.camera_id, n.ts_ms order by n.person)) as member,
        l.x_mm,
        l.y_mm
    from names as n
    left join located as l on n.camera_id = l.camera_id and n.ts_ms = l.ts_ms and n.track_id = l.track_id
),

sent as (
    select
        p.camera_id,
        p.ts_ms,
        a.member as member_a,
        b.member as member_b,
        p.track_a,
        p.track_b,
        coalesce(p.x_a_mm, a.x_mm) as x_a_mm,
        coalesce(p.y_a_mm, a.y_mm) as y_a_mm,
        coalesce(p.x_b_mm, b.x_mm) as x_b_mm,
        coalesce(p.y_b_mm, b.y_mm) as y_b_mm,
        p.distance_mm,
        i.weight_ms
    from named as p
    cross join params as s
    inner join instants as i on p.camera_id = i.camera_id and p.ts_ms = i.ts_ms
    inner join sent_persons as a on p.camera_id = a.camera_id and p.ts_ms = a.ts_ms and p.name_a = a.person
    inner join sent_persons as b on p.camera_id = b.camera_id and p.ts_ms = b.ts_ms and p.name_b = b.person
    where p.distance_mm <= s.pair_max_mm
),

every_pair as (
    select
        camera_id,
        ts_ms,
        member_a,
        member_b,
        track_a,
        track_b,
        x_a_mm,
        y_a_mm,
        x_b_mm,
        y_b_mm,
        distance_mm,
        weight_ms,
        true as is_derived
    from derived
    union all
    select
        camera_id,
        ts_ms,
        member_a,
        member_b,
        track_a,
        track_b,
        x_a_mm,
        y_a_mm,
        x_b_mm,
        y_b_mm,
        distance_mm,
        weight_ms,
        false as is_derived
    from sent
)

select
    cast(floor(p.ts_ms / 3600000) as bigint) as hour,
    p.camera_id,
    p.ts_ms,
    p.member_a,
    p.member_b,
    p.track_a,
    p.track_b,
    p.x_a_mm,
    p.y_a_mm,
    p.x_b_mm,
    p.y_b_mm,
    p.distance_mm,
    p.weight_ms,
    coalesce(owner_cells.camera_id = p.camera_id, true) as is_owned,
    p.is_derived
from every_pair as p
cross join params as s
left join cameras on p.camera_id = cameras.camera_id
left join owner_cells
    on
        cameras.floor_id = owner_cells.floor_id
        and p.ts_ms >= owner_cells.from_ms
        and p.ts_ms < owner_cells.to_ms
        and cast(floor((p.x_a_mm + p.x_b_mm) / (2 * s.owner_cell_mm)) as integer) = owner_cells.cx
        and cast(floor((p.y_a_mm + p.y_b_mm) / (2 * s.owner_cell_mm)) as integer) = owner_cells.cy
order by hour, p.camera_id, p.ts_ms, p.member_a, p.member_b, p.distance_mm
