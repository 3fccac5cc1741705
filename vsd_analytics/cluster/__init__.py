"""Where a build runs when it runs on several machines: `vsd build --on ADDRESS`."""
