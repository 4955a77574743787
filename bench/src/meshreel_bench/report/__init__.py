"""Pages made from rows, and from nothing else: one page of results, an appendix for each experiment, plots."""

from __future__ import annotations

from .pages import write_report

__all__ = ["write_report"]
