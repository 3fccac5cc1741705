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
--   state        full, partial, low_data or no_data, of the camera of this line that recorded least, or of its counter
--   recorded_s   its recorded seconds
--   interval_s   longest interval of the sums of the line's counter; those of over 900 s are spread evenly; null for cameras
--   n_to_left    crossings to the left of whoever walks from the line's first point to its second; null where unknown, never 0
--   n_to_right   likewise to the right
--   n_both       crossings either way; the only number of a counter that does not tell ways apart
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
    interval_s,
    n_to_left,
    n_to_right,
    n_both
from line_counts
order by quarter, line_no
