"""Connected components: the one step of facts that SQL cannot do in a fixed number of joins."""

from __future__ import annotations

import numpy as np
import pyarrow as pa


def components(edges: pa.Table) -> pa.Table:
    """Return the nodes of many graphs, each with the least node it is connected to.

    Args:
        edges: One row per edge. The last two columns, `node_a` and `node_b`, are integers; an edge from a node to
            itself adds a node without neighbours. The columns before them identify the graph: nodes of different graphs
            are never connected.

    Returns:
        The graph's columns, `node` and `component`; one row per graph and node.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    *keys, _, _ = edges.column_names
    ends = [edges[name].to_numpy().astype(np.int64) for name in ("node_a", "node_b")]
    node, n_edges = np.concatenate(ends), edges.num_rows
    low = int(node.min()) if n_edges else 0
    span = int(node.max()) - low + 1 if n_edges else 1
    # Number the graphs, then number (graph, node) as one integer: one sparse matrix holds all graphs of an hour, so
    # scipy is called once instead of once per frame.
    graph = np.zeros(n_edges, dtype=np.int64)
    for name in keys:
        values = edges[name].combine_chunks().dictionary_encode()
        graph = graph * max(1, len(values.dictionary)) + values.indices.to_numpy()
    _, seen_at, of = np.unique(np.tile(graph, 2) * span + (node - low), return_index=True, return_inverse=True)
    ones = np.ones(n_edges, dtype=np.int8)
    matrix = coo_matrix((ones, (of[:n_edges], of[n_edges:])), shape=(len(seen_at), len(seen_at)))
    label = connected_components(matrix, directed=False)[1]
    _, first = np.unique(label, return_index=True)  # np.unique sorted the nodes of a graph, so the first is the least
    at = seen_at % max(1, n_edges)
    found: dict[str, pa.ChunkedArray | pa.Array] = {name: edges[name].take(pa.array(at)) for name in keys}
    values = {"node": node[seen_at], "component": node[seen_at][first[label]]}
    return pa.table({**found, **{name: pa.array(v, pa.int64()) for name, v in values.items()}})
