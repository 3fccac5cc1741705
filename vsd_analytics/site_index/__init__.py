"""The site index: one static page over all floors, sites and weeks, written from the JSON files of their reports.

Nothing here looks at stored data. `read_reports` reads the JSON files, `collect_reports` copies the reports of several
projects to one place, `summary` writes headline and lead, `site_comparison` finds which floors really differ,
`compare_section` says so, `page` writes the page.
"""
