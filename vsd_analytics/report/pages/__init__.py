"""Pages and files for readers: the weekly page, mail, PDF, JSON, CSV, single figures."""
