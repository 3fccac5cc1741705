"""What a site is: floors, cameras, areas, fixtures, opening hours, routes for alarms and mail."""
