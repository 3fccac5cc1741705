-- name: tables/line_counts
-- One row per counting line and quarter-hour of the days asked for: who crossed it in either direction.
-- grain: line_id, start
-- reads: line_counts
-- columns:
--   floor_id
--   line_id      line of vsd.toml
--   start        instant the quarter-hour starts, with the site's zone
--   local_date
--   local_hour   0 to 23; twice in the night the clocks go back
--   is_open      opening time
--   state        full, partial, low_data or no_data, of the camera of this line that recorded least
--   recorded_s   its recorded seconds
--   n_to_left    crossings to the left of whoever walks from the line's first point to its second; null where unknown, never 0
--   n_to_right   likewise to the right
-- assumes: in a partly recorded quarter-hour people may have crossed uncounted
select
    floor_id,
    line_id,
    make_timestamptz(quarter * 900000 * 1000) as start,
    local_date,
    local_hour,
    is_open,
    state,
    recorded_s,
    n_to_left,
    n_to_right
from line_counts
order by quarter, line_no
