"""The sentences of `reports/wording` in every language, and how numbers, days and reasons are written."""
