"""Clusters, links over time and sizes: against networkx, against the alarms' own, and by hand."""

from __future__ import annotations

from itertools import combinations

import gatherings_at_once
import numpy as np
import pyarrow as pa
import pytest

from vsd_analytics.live.situations import Edge, PeopleGraph
from vsd_analytics.live.situations import gatherings as live_gatherings
from vsd_analytics.stats import gatherings
from vsd_analytics.warehouse.graphs import components
from vsd_analytics.wording.reasons import reason_text

N_GRAPHS = 1000


def random_graphs(seed: int = 4) -> list[tuple[int, list[tuple[int, int]]]]:
    """Return graphs of 2 to 40 people: sparse ones, chains, cliques and all between."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(N_GRAPHS):
        n = int(rng.integers(2, 41))
        every = list(combinations(range(n), 2))
        chosen = rng.random(len(every)) < rng.choice([0.5, 1.0, 2.0, 8.0]) / n
        made.append((n, [e for e, c in zip(every, chosen.tolist(), strict=True) if c]))
    return made


def test_components_of_a_thousand_random_graphs_are_those_of_networkx() -> None:
    """All graphs at once, as frames of one camera in any order, the same people numbers in each."""
    nx = pytest.importorskip("networkx")
    graphs = random_graphs()
    edges = np.array([(k, a, b) for k, (_, edges) in enumerate(graphs) for a, b in edges])
    edges = np.random.default_rng(1).permutation(edges)
    found = components(pa.table({"frame": edges[:, 0], "node_a": edges[:, 1] - 7, "node_b": edges[:, 2] - 7}))
    truth = {
        (k, node - 7, min(c) - 7)
        for k, (_, edges) in enumerate(graphs)
        for c in nx.connected_components(nx.Graph(edges))
        for node in c
    }
    rows = list(zip(*(found[name].to_pylist() for name in ("frame", "node", "component")), strict=True))
    assert set(rows) == truth
    assert len(rows) == len(truth)


def test_no_edges_have_no_components_and_a_node_joined_to_itself_is_one() -> None:
    empty = pa.table(
        {"camera": pa.array([], pa.string()), "node_a": pa.array([], pa.int64()), "node_b": pa.array([], pa.int64())}
    )
    assert components(empty).num_rows == 0
    alone = pa.table({"node_a": [5, 6, 9], "node_b": [5, 9, 6]})
    assert components(alone).to_pydict() == {"node": [5, 6, 9], "component": [5, 6, 6]}


def test_alarms_find_the_same_clusters_as_networkx_and_the_reports() -> None:
    nx = pytest.importorskip("networkx")
    for n, edges in random_graphs(5):
        people = PeopleGraph([str(i) for i in range(n)], [None] * n, [Edge(a, b, 1000) for a, b in edges], [])
        alarms = {frozenset(map(int, s.tracks)) for s in live_gatherings(people)}
        assert alarms == {frozenset(c) for c in nx.connected_components(nx.Graph(edges))}
        a, b = np.array(edges, dtype=int).reshape(-1, 2).T
        found = gatherings_at_once.clusters(np.zeros(len(a), dtype=int), a, b)
        assert sorted(found.size.tolist()) == sorted(s.n_people for s in live_gatherings(people))


def test_links_over_time_are_those_of_networkx() -> None:
    """Two clusters are one when two people are in both within the gap, whoever of them was elsewhere meanwhile."""
    nx = pytest.importorskip("networkx")
    rng = np.random.default_rng(7)
    n_linked = 0
    for _ in range(200):
        ts, members = [], []
        for second in (0, 1, 4, 6, 11, 13, 18, 20, 25, 31, 36):  # some exactly 5 s apart
            people = rng.permutation(12)
            cuts = np.sort(rng.integers(0, 13, size=3))
            for inside in np.split(people, cuts):
                if len(inside) >= 3 and rng.random() < 0.5:
                    ts.append(1000 * second)
                    members.append(set(inside.tolist()))
        if not ts:
            continue
        graph = nx.Graph()
        graph.add_nodes_from(range(len(ts)))
        graph.add_edges_from(
            (i, j)
            for i, j in combinations(range(len(ts)), 2)
            if len(members[i] & members[j]) >= 2 and abs(ts[i] - ts[j]) <= 5000
        )
        of = np.repeat(np.arange(len(ts)), [len(m) for m in members])
        track = np.array([t for m in members for t in m])
        label = gatherings_at_once.link(of, track, ts_ms=ts, gap_ms=[5000] * len(ts))
        found = {frozenset(np.flatnonzero(label == k).tolist()) for k in set(label.tolist())}
        assert found == {frozenset(c) for c in nx.connected_components(graph)}
        n_linked += len(ts) - len(found)
    assert n_linked > 100


def test_pairs_within_groups_are_all_of_them() -> None:
    i, j = gatherings_at_once.pairs_within([0, 0, 0, 2, 3, 3])
    assert sorted(zip(i.tolist(), j.tolist(), strict=True)) == [(0, 1), (0, 2), (1, 2), (4, 5)]
    assert [len(v) for v in gatherings_at_once.pairs_within([])] == [0, 0]


def test_a_queue_of_six_is_one_long_cluster() -> None:
    found = gatherings_at_once.clusters([0] * 5, [0, 1, 2, 3, 4], [1, 2, 3, 4, 5])
    x = 1.8 * np.arange(6)
    order = np.argsort(found.of, kind="stable")
    assert found.size.tolist() == [6]
    wide = gatherings_at_once.diameters(found.of[order], np.sort(x), np.zeros(6), n_clusters=1)
    assert wide[0] == pytest.approx(9.0)
    assert np.isnan(gatherings_at_once.diameters([0, 0], [np.nan, 1.0], [0.0, 0.0], n_clusters=1)[0])


def at_each_second(n: int, *, label: list[int] | None = None, size: int = 3) -> tuple[gatherings_at_once.Lasting, ...]:
    ones = np.ones(n)
    return gatherings_at_once.lasting(
        label or [0] * n, ts_ms=1000 * np.arange(n), interval_ms=[1000] * n, size=[size] * n, weight_s=ones,
        x_m=2 * ones, y_m=ones * np.nan, diameter_m=ones,
    )  # fmt: skip


def test_ten_seconds_are_a_gathering_and_nine_are_none() -> None:
    assert at_each_second(9) == ()
    (one,) = at_each_second(10)
    assert (one.duration_s, one.n_people, one.person_s) == (10.0, 3, 30.0)
    assert (one.x_m, one.y_m, one.diameter_m) == (2.0, None, 1.0)


def test_a_gathering_in_two_clusters_has_the_people_of_both() -> None:
    ts = np.repeat(1000 * np.arange(12), 2)
    n = len(ts)
    (one,) = gatherings_at_once.lasting(
        [0] * n, ts_ms=ts, interval_ms=[1000] * n, size=[3, 4] * 12, weight_s=[1.0] * n,
        x_m=[0.0] * n, y_m=[0.0] * n, diameter_m=[1.0] * n,
    )  # fmt: skip
    assert (one.n_people, one.person_s) == (7, 84.0)


def test_sizes_are_weighted_by_time_not_by_frames() -> None:
    """The same hour, looked at every second or every fifth."""
    rng = np.random.default_rng(1)
    size = np.repeat(rng.integers(2, 12, size=360), 10)
    often = gatherings.size_distribution(size, np.ones(3600))
    seldom = gatherings.size_distribution(size[::5], np.full(720, 5.0))
    assert often == seldom
    assert sum(s.share or 0 for s in often.sizes) == pytest.approx(1)
    assert often.sizes[3].person_s == size[(size >= 5) & (size <= 7)].sum()


def test_little_time_in_clusters_has_no_shares_and_a_reason() -> None:
    found = gatherings.size_distribution([2, 3], [60.0, 60.0])
    assert {s.share for s in found.sizes} == {None}
    assert found.state == "not_enough_data"
    assert reason_text(found.reason) == "needs clusters for at least 30 min, has 2.0"
    nothing = gatherings.size_distribution([], [])
    assert (nothing.state, nothing.person_s) == ("not_enough_data", 0.0)
