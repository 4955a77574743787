"""Web server of the player for `meshreel play` and `meshreel serve`: needs the extra `play`."""
