"""Retention: purge of records by age, camera and time, and export of stored records."""
