"""Pages made from rows, and from nothing else: rate-distortion curves, tables and sheets of pictures.

In -> out: JSON rows -> results.md and index.html, a part an experiment, and plots as PNG and SVG. Nothing is typed by
hand: what is not in a row is not shown, but for reference curves, which are named as such. Same rows, same bytes.
"""

from __future__ import annotations

from .pages import write_report
from .tables import bd_table, comparable_table, ranked_table

__all__ = ["bd_table", "comparable_table", "ranked_table", "write_report"]
