"""Measurements: points become rows, each in a fresh process."""
