"""Pages made from rows alone: one page of results, an appendix for each experiment, plots."""
