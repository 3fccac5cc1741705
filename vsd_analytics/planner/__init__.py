"""The planner's page: what a floor's two weeks hold, packed into one file that a browser can ask."""
