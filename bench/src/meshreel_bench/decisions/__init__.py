"""Measurements that docs/decisions rests on: captured and procedural frames -> rows -> the tables of its pages."""
