"""The site index: one static page over all floors, sites and weeks, written from the JSON twins of their reports.

Nothing here looks at stored data. `read` takes the twins in, `shelves` puts the reports of several projects where one
page can link to them, `headline` says what they amount to, `render` writes the page.
"""
