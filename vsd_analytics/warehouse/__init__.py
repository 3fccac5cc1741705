"""The SQL files, the incremental facts, and the warehouse of a range."""
