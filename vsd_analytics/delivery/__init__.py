"""How a finished report leaves the house: as PDF, as single figures, as a mail; nothing here computes a number."""
