"""Decoders of networks, one module for each family; `families` chooses one by the signature of a network."""
