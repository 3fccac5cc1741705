"""A file an engine, or data set: what recognises its files and streams their records."""
