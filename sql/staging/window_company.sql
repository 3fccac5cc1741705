-- name: staging/window_company
-- One row per track that is standing in company in a window: the connected component of pairs that stand together in it.
-- graph: the query gives edges (node_a, node_b); rows are their nodes, each with the least node it is connected to
-- grain: camera_id, window_ms, node
-- reads: window_pairs
-- params: together_mm, company_least_ms, company_least_records, company_reach_mm
-- columns:
--   camera_id
--   window_ms  start of the window
--   node       number of the track, as in window_tracks
--   component  least number of a track of its company
-- steps:
--   sides     each pair from both sides, close for company_least_ms and longer, and in that many records
--   around    how far one is from the other and from those near the other: people in a circle are near to all of them, people in
--             a line are not; a mean of whole numbers is compared by its sum and its number, so it is exact
-- assumes: people are together in a window or not: positions alone do not show who faces whom
with sides as (
    select
        p.camera_id,
        p.window_ms,
        p.member_a as member,
        p.member_b as other,
        p.mean_mm,
        p.close_ms >= s.company_least_ms and p.n_records >= s.company_least_records as is_long
    from window_pairs as p
    cross join params as s
    union all
    select
        p.camera_id,
        p.window_ms,
        p.member_b as member,
        p.member_a as other,
        p.mean_mm,
        p.close_ms >= s.company_least_ms and p.n_records >= s.company_least_records as is_long
    from window_pairs as p
    cross join params as s
),

near as (
    select
        sides.camera_id,
        sides.window_ms,
        sides.member,
        sides.other
    from sides
    cross join params
    where sides.is_long and sides.mean_mm <= params.together_mm
),

around as (
    select
        one.camera_id,
        one.window_ms,
        one.member,
        one.other,
        1 + count(near.other) as n,
        min(one.mean_mm)
        + coalesce(
            sum(case when near.other is not null then coalesce(known.mean_mm, params.company_reach_mm) end), 0
        ) as sum_mm
    from sides as one
    cross join params
    left join near
        on
            one.camera_id = near.camera_id
            and one.window_ms = near.window_ms
            and one.member = near.member
            and one.other <> near.other
    left join sides as known
        on
            near.camera_id = known.camera_id
            and near.window_ms = known.window_ms
            and near.other = known.member
            and one.other = known.other
    where one.is_long
    group by one.camera_id, one.window_ms, one.member, one.other
)

select
    a.camera_id,
    a.window_ms,
    a.member as node_a,
    a.other as node_b
from around as a
inner join around as b
    on a.camera_id = b.camera_id and a.window_ms = b.window_ms and a.member = b.other and a.other = b.member
cross join params as s
where a.member < a.other and a.sum_mm * b.n + b.sum_mm * a.n <= 2 * s.together_mm * a.n * b.n
