"""Pages and pictures of docs: the tables of docs/decisions from rows that were measured, pictures from procedural data."""
