"""The Python API for analysts: open a project, choose days, read tables, maps and comparisons."""
