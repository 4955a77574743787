"""Writes the most expensive legal file of a form to standard output, for budget.test.ts."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

from tests.budget.test_budget import SMALL

if __name__ == "__main__":
    sys.stdout.buffer.write(SMALL[sys.argv[1]]())
