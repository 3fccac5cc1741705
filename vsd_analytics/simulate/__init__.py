"""The seeded simulator behind `vsd demo` and most tests: a made-up shop, its engine output and its truth.

Importing its modules loads numpy and pyarrow; the command line imports them inside the commands that need them.
"""
