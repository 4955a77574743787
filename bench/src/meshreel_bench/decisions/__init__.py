"""Tables of docs/decisions, made from rows that were measured, and pictures of docs, drawn from procedural data."""
