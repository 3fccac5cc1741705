"""From the files and messages of any engine to the store.

A record passes the folders in this order:

1. `reading/`: bytes to tables. Files, archives, cells, times, and the contract of an adapter (`reading/adapter.py`).
2. `formats/`: a file an engine. Recognises its files and streams their records as raw tables.
3. `checks/`: what looks wrong about a source, before any of it is stored.
4. `intake/`: the pipeline that joins them, quarantine, pseudonyms, and imports to the store.

`intake` imports `formats` and `checks`, each of these `reading`, and nothing the other way: a format knows no check,
and a check no format. `testing.py` is the test kit of adapters; no folder imports it.
"""
