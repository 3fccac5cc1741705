"""Connected components, the one step of facts that SQL cannot do without walking a graph edge by edge."""

from __future__ import annotations

import numpy as np
import pyarrow as pa


def components(edges: pa.Table) -> pa.Table:
    """Return the nodes of a graph, each with the least node it is connected to.

    Args:
        edges: Two last columns `node_a` and `node_b`, whole numbers; an edge from a node to itself makes it one of the
            graph. What stands in front of them tells graphs apart: nodes of different ones are never connected.

    Returns:
        The columns in front, `node`, `component`; one row per node, no node twice in one graph.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    *keys, _, _ = edges.column_names
    ends = [edges[name].to_numpy().astype(np.int64) for name in ("node_a", "node_b")]
    node, n_edges = np.concatenate(ends), edges.num_rows
    low = int(node.min()) if n_edges else 0
    span = int(node.max()) - low + 1 if n_edges else 1
    graph = np.zeros(n_edges, dtype=np.int64)
    for name in keys:
        values = edges[name].combine_chunks().dictionary_encode()
        graph = graph * max(1, len(values.dictionary)) + values.indices.to_numpy()
    _, seen_at, of = np.unique(np.tile(graph, 2) * span + (node - low), return_index=True, return_inverse=True)
    ones = np.ones(n_edges, dtype=np.int8)
    matrix = coo_matrix((ones, (of[:n_edges], of[n_edges:])), shape=(len(seen_at), len(seen_at)))
    label = connected_components(matrix, directed=False)[1]
    _, first = np.unique(label, return_index=True)  # nodes of one graph stand in order: the first is the least
    at = seen_at % max(1, n_edges)
    found: dict[str, pa.ChunkedArray | pa.Array] = {name: edges[name].take(pa.array(at)) for name in keys}
    values = {"node": node[seen_at], "component": node[seen_at][first[label]]}
    return pa.table({**found, **{name: pa.array(v, pa.int64()) for name, v in values.items()}})
