"""One file per engine format, the adapter protocol, and the way from their records to the store."""
