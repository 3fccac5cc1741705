"""The sentences of the pages: the wording catalogue, and the rules that choose from it."""
