"""Edits of .reel files that encode nothing again."""

from .edits import concat, cut, retime, tag, transform

__all__ = ["concat", "cut", "retime", "tag", "transform"]
