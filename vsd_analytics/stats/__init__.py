"""Levels, changes and their intervals: pure functions, arrays in, frozen dataclasses out, nothing read or written."""
