"""Pages made from rows, and from nothing else: one page of results, an appendix for each experiment, plots."""
