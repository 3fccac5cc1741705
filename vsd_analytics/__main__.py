"""`python -m vsd_analytics`: the command `vsd`, where its script is not on the path."""

from vsd_analytics.cli import main

main()
