"""`vsd.toml` -> `Site`: found upward, read with every mistake at once, each with its line, reason and fix."""

from vsd_analytics.config.project import FILE, find_project, load_site

__all__ = ["FILE", "find_project", "load_site"]
