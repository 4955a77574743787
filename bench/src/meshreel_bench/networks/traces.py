"""Network traces in the style of fixed broadband (FCC) and of 5G: drawn from a seed, not measured.

A line has states, which it leaves at random, and in each its rate wanders around that of the state. In: the numbers
below, which are guesses. Out: the text of a file that the player's study page takes (docs/player.md, "A study").
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from random import Random
from statistics import NormalDist, mean

DURATION = 240  # s
SLOW = 1.0  # Mbit/s: each file says for how long it has less


@dataclass(frozen=True, slots=True)
class State:
    """State of a line."""

    rate: float  # relative to that of other states
    stay: float  # s, on average


@dataclass(frozen=True, slots=True)
class Trace:
    """Statistics from which a trace is drawn."""

    what: str
    seed: int
    step: float  # s, from a rate to the next
    mbps: float  # mean of the whole trace
    spread: float  # standard deviation of the logarithm of the rate within a state
    memory: float  # s, after which the correlation of that logarithm has fallen to 1/e
    states: tuple[State, ...]


_BROADBAND = (State(1, 40), State(0.35, 4))  # as it is, and while others of the house use it
_WALK = (State(1, 20), State(0.3, 6), State(0.002, 2))  # in sight of the mast, in a shadow, cut off
_DRIVE = (State(1, 6), State(0.25, 5), State(0.002, 3))
TRACES = {
    "fixed_3": Trace("fixed broadband (FCC)", 1, 1.0, 3.0, 0.25, 5.0, _BROADBAND),
    "fixed_12": Trace("fixed broadband (FCC)", 2, 1.0, 12.0, 0.2, 5.0, _BROADBAND),
    "5g_walk": Trace("5G, on foot", 3, 0.2, 150.0, 0.4, 2.0, _WALK),
    "5g_drive": Trace("5G, in a car", 4, 0.2, 60.0, 0.6, 1.0, _DRIVE),
}


def rates(trace: Trace) -> list[float]:
    """Return the rate of each step, Mbit/s, with the mean that the trace states."""
    random, count = Random(trace.seed), round(DURATION / trace.step)
    kept = math.exp(-trace.step / trace.memory)
    fresh = trace.spread * math.sqrt(1 - kept**2)
    noise = (NormalDist(0, fresh).inv_cdf(_inside(random)) for _ in range(count))
    wander = accumulate(noise, lambda before, step: kept * before + step)
    found = [state.rate * math.exp(value) for state, value in zip(_states(trace, random, count), wander, strict=False)]
    scale = trace.mbps / mean(found)
    return [scale * rate for rate in found]


def _states(trace: Trace, random: Random, count: int) -> Iterator[State]:
    """Yield the state of each step; it begins in the first, and all others are as likely to follow."""
    state = trace.states[0]
    for _ in range(count):
        yield state
        if random.random() < trace.step / state.stay:
            state = random.choice([other for other in trace.states if other is not state])


def _inside(random: Random) -> float:
    """Return a number above 0 and below 1."""
    return (random.getrandbits(52) + 0.5) / 2**52


def as_csv(trace: Trace) -> str:
    """Return the text of a trace's file: comments, a head, and from each time on the rate until the next."""
    values = [round(rate, 3) for rate in rates(trace)]
    slow = sum(value < SLOW for value in values) / len(values)
    lines = [
        f"# Network trace in the style of {trace.what}: drawn by python -m meshreel_bench.networks, not measured.",
        f"# seed {trace.seed}, {DURATION} s, mean {mean(values):.3g} Mbit/s, least {min(values):.3g}, most "
        f"{max(values):.3g}, below {SLOW:g} for {100 * slow:.1f} % of the time",
        "seconds,mbps",
        *(f"{step * trace.step:g},{value:g}" for step, value in enumerate(values)),
    ]
    return "\n".join(lines) + "\n"
