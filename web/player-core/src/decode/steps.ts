// The ladder of quantiser steps: step k is 2^(-k/8), the same number everywhere. Beside coding/steps.py.

export const LEVELS = 200;
const EIGHTHS = [4294967296, 3938502376, 3611622603, 3311872529, 3037000500, 2784941738, 2553802834, 2341847524];

/** The step of a level; both factors of the product are exact, so is it. */
export function stepOf(level: number): number {
  return EIGHTHS[level % 8] * 2 ** (-32 - Math.floor(level / 8));
}
