"""Shared by the tests of the product and of the bench: recorded durations, and the order that follows from them."""

pytest_plugins = ["tests.durations"]
