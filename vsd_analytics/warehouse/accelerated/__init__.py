"""Relations that numpy computes in a fraction of the time of their queries, and the same rows.

The query in `sql/` says what a relation is, and is what its readers need. A relation with a row for almost every record
has a function here as well, which walks through records that are sorted once. The query runs where there is no
function, where the function returns None, and after DuckDB failed inside.
`tests/warehouse/test_accelerated_against_sql.py` compares the rows of both. So a change of a query is a change of its
function; facts become stale by the query. No rule has its number here: settings and rules come from `params`, which the
queries read too. Whoever only wants to know what a fact is need not read this folder: `switch.py` turns it off.
"""
