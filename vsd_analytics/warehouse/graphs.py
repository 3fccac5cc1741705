"""Connected components: the one step of facts that SQL cannot do in a fixed number of joins."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def components(edges: pa.Table) -> pa.Table:
    """Return the nodes of many graphs, each with the least node it is connected to.

    Args:
        edges: One row per edge. The last two columns, `node_a` and `node_b`, are integers; an edge from a node to
            itself adds a node without neighbours. The columns before them identify the graph: nodes of different graphs
            are never connected.

    Returns:
        The graph's columns, `node` and `component`; one row per graph and node.
    """
    *keys, _, _ = edges.column_names
    ends = [edges[name].to_numpy().astype(np.int64) for name in ("node_a", "node_b")]
    node, n_edges = np.concatenate(ends), edges.num_rows
    low = int(node.min()) if n_edges else 0
    span = int(node.max()) - low + 1 if n_edges else 1
    # Number the graphs, then number (graph, node) as one integer: all graphs of an hour are one.
    graph = np.zeros(n_edges, dtype=np.int64)
    for name in keys:
        values = edges[name].combine_chunks().dictionary_encode()
        graph = graph * max(1, len(values.dictionary)) + values.indices.to_numpy()
    _, seen_at, numbers = np.unique(np.tile(graph, 2) * span + (node - low), return_index=True, return_inverse=True)
    least = least_connected(numbers[:n_edges], numbers[n_edges:], len(seen_at))  # np.unique sorted the nodes of a graph
    at = seen_at % max(1, n_edges)
    graph_columns: dict[str, pa.ChunkedArray | pa.Array] = {name: edges[name].take(pa.array(at)) for name in keys}
    values = {"node": node[seen_at], "component": node[seen_at][least]}
    return pa.table({**graph_columns, **{name: pa.array(v, pa.int64()) for name, v in values.items()}})


def least_connected(node_a: NDArray[np.int64], node_b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the least node that each of `n` nodes is connected to.

    Each step points nodes to the least one beside their group, then groups to the end of their chain.

    Args:
        node_a: One end of each edge, from 0 to n - 1.
        node_b: The other end.
        n: Number of nodes.
    """
    least = np.arange(n)
    while len(node_a):
        a, b = least[node_a], least[node_b]
        lower = np.minimum(a, b)
        np.minimum.at(least, a, lower)
        np.minimum.at(least, b, lower)
        while np.any((further := least[least]) != least):
            least = further
        is_apart = least[node_a] != least[node_b]
        node_a, node_b = node_a[is_apart], node_b[is_apart]
    return least
