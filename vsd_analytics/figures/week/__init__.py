"""The numbers of one floor and week: what the weekly page, its JSON and the planner show."""
