"""From records to the store: imports, quarantine, pseudonyms, refused times."""
