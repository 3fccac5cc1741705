"""`vsd.toml` -> `Site`: found upward, read with every mistake at once, each with its line, reason and fix."""
