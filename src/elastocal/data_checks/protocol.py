"""What a fault of the data is: a name, what the data resemble in plain words, and how
much better they fit without it."""

from __future__ import annotations

from dataclasses import dataclass

# Family of faults of the data among the effects of a verdict.
DATA_FAMILY = "data"


@dataclass(frozen=True)
class Value:
    """One number that describes a fault; `unit`: "–" where it has none."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Fault:
    """A fault that the measurements show, and that must be mended before anything is
    traced.

    `joints`: joints concerned, counted from 1; empty where there are none. `detail`:
    one sentence in plain words. `evidence`: RMS residual as written and with the
    correction, m. Where only orientations show the fault: of a point 1 m away.
    `alternatives`: what would explain the measurements as well, in plain words.
    """

    name: str
    joints: tuple[int, ...]
    detail: str
    parameters: tuple[Value, ...]
    evidence: tuple[float, float]
    alternatives: tuple[str, ...] = ()
