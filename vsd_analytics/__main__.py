"""`python -m vsd_analytics`: the command `vsd`, where its script is not on the path."""

from vsd_analytics.cli import main

if __name__ == "__main__":  # tools that import every module of a package run no command
    main()
