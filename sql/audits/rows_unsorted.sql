-- name: audits/rows_unsorted
-- One row per part whose rows are not in the order in which a fold writes them.
-- grain: stored_table, part
-- reads: part_frames, part_observations, part_pairs
-- columns:
--   stored_table  frames, observations or pairs
--   part          number of the part
--   n_rows        rows that are not where sorting puts them
--   first_row     first of them, counted from 0
-- assumes: a part is sorted by its columns from left to right, missing values last; equal rows have no order
with placed_frames as (
    select
        part,
        part_row,
        row_number() over (
            partition by part
            order by
                camera_id,
                ts,
                n_persons,
                n_pairs,
                seq
        ) - 1 as sorted_row
    from part_frames
),

placed_observations as (
    select
        part,
        part_row,
        row_number() over (
            partition by part
            order by
                camera_id,
                ts,
                person,
                track_id,
                x_mm,
                y_mm,
                u_px,
                v_px,
                quality,
                is_staff
        ) - 1 as sorted_row
    from part_observations
),

placed_pairs as (
    select
        part,
        part_row,
        row_number() over (
            partition by part
            order by
                camera_id,
                ts,
                person_a,
                person_b,
                track_a,
                track_b,
                x_a_mm,
                y_a_mm,
                x_b_mm,
                y_b_mm,
                distance_mm,
                distance_sd_mm,
                quality
        ) - 1 as sorted_row
    from part_pairs
)

select
    'frames' as stored_table,
    part,
    count(*) as n_rows,
    min(part_row) as first_row
from placed_frames
where part_row <> sorted_row
group by part
union all
select
    'observations' as stored_table,
    part,
    count(*) as n_rows,
    min(part_row) as first_row
from placed_observations
where part_row <> sorted_row
group by part
union all
select
    'pairs' as stored_table,
    part,
    count(*) as n_rows,
    min(part_row) as first_row
from placed_pairs
where part_row <> sorted_row
group by part
order by stored_table, part
