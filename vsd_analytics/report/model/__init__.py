"""What a weekly page knows: the numbers of the week together with the sentences chosen for them."""
