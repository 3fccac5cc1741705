"""`vsd bench`: how fast this machine goes from stored records to heatmap and hours, beside other tools, in one run."""
