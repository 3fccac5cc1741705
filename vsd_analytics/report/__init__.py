"""The weekly report: what it knows (model), what it says (headline, things, titles), how it is drawn and written."""
