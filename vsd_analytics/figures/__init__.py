"""One file per question: marts in, statistics, one frozen answer out, with its state and reason."""
