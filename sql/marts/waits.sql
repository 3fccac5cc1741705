-- name: marts/waits
-- One row per stay of a track in a queue that leads to an area: how long it waited, and how that ended.
-- grain: camera_id, track_id, area_id, started_ms
-- reads: visits, person_stays, areas
-- columns:
--   floor_id
--   area_id         the queue, an area of vsd.toml with served_in
--   camera_id
--   track_id        pseudonym of the engine's track number, of one site day
--   started_ms      first record inside, milliseconds since 1970, UTC
--   local_date      of the first record
--   hour_start_ms   UTC instant the local hour of the first record starts
--   is_open         the first record lies in opening hours
--   has_entry       the entry was seen
--   is_counted      this camera counts the place of the first record
--   was_served      the track came out of the area of service: it walks back through the queue and does not wait
--   outcome         served: it stepped into the area of service; left: it went elsewhere; cut: the track ends inside the queue
--   dwell_s         from the entry to the exit, or to the last record inside, as in visits
--   wait_s          from the entry to the first record in the area of service; else dwell_s
--   counted_by      camera that counts it, as in visits
-- figure: M40 Waiting time
--   definition   of those who enter an area with queue = true and served_in: time from the entry to reaching the area of service, median
--                and 90 % quantile of those served, share who leave before; Aalen-Johansen, those who leave are a competing end, lost
--                tracks censored; beside it Little's law
--   unit         seconds; share of those who enter
--   denominator  entries that were seen; they count for the same hours of the week that were not recorded
--   needs        30 entries, 10 of them served; 5 days with entries for an interval, with all hours of the day but 5 % of the
--                open time among them
--   uncertainty  95 % interval by jackknife over days; what lost tracks leave open is inside it
--   by           vsd_analytics.stats.waiting.waiting
-- steps:
--   ended    the last stay of a visit tells when the track was next seen, and how long it may be away
--   reached  a step over the border and back is no service: the stay there must outlast that in the queue
-- assumes: queue and area of service lie in one camera's view, or in joined ones, and touch or are at most visit_gap_s apart
with queued as (
    select
        visits.floor_id,
        visits.area_id,
        visits.camera_id,
        visits.track_id,
        visits.started_ms,
        visits.ended_ms,
        visits.local_date,
        visits.hour_start_ms,
        visits.is_open,
        visits.has_entry,
        visits.has_exit,
        visits.dwell_s,
        visits.is_counted,
        visits.counted_by,
        areas.served_in
    from visits
    inner join areas on visits.area_id = areas.area_id
    where areas.served_in is not null
),

ended as (
    select
        queued.floor_id,
        queued.area_id,
        queued.camera_id,
        queued.track_id,
        queued.started_ms,
        queued.ended_ms,
        queued.local_date,
        queued.hour_start_ms,
        queued.is_open,
        queued.has_entry,
        queued.has_exit,
        queued.dwell_s,
        queued.is_counted,
        queued.counted_by,
        queued.served_in,
        max(person_stays.gap_ms) as gap_ms,
        max(person_stays.after_ms) as after_ms
    from queued
    inner join person_stays
        on
            queued.camera_id = person_stays.camera_id
            and queued.track_id = person_stays.track_id
            and queued.area_id = person_stays.area_id
            and queued.ended_ms = person_stays.ended_ms
    group by all
),

reached as (
    select
        ended.camera_id,
        ended.track_id,
        ended.area_id,
        ended.started_ms,
        min(service.started_ms) filter (
            where service.ended_ms > ended.ended_ms and service.started_ms <= ended.ended_ms + ended.gap_ms
        ) as reached_ms,
        coalesce(bool_or(service.started_ms < ended.started_ms and service.ended_ms >= ended.started_ms - ended.gap_ms), false)
            as was_served
    from ended
    inner join visits as service
        on
            ended.camera_id = service.camera_id
            and ended.track_id = service.track_id
            and ended.served_in = service.area_id
    group by ended.camera_id, ended.track_id, ended.area_id, ended.started_ms
)

select
    ended.floor_id,
    ended.area_id,
    ended.camera_id,
    ended.track_id,
    ended.started_ms,
    ended.local_date,
    ended.hour_start_ms,
    ended.is_open,
    ended.has_entry,
    ended.is_counted,
    coalesce(reached.was_served, false) as was_served,
    case when reached.reached_ms is not null then 'served' when ended.has_exit then 'left' else 'cut' end as outcome,
    ended.dwell_s,
    ended.dwell_s + greatest(coalesce(reached.reached_ms - ended.after_ms, 0), 0) / 1000 as wait_s,
    ended.counted_by
from ended
left join reached
    on
        ended.camera_id = reached.camera_id
        and ended.track_id = reached.track_id
        and ended.area_id = reached.area_id
        and ended.started_ms = reached.started_ms
order by ended.started_ms, ended.camera_id, ended.track_id, ended.area_id
