"""A fault of the data: its name, a plain description, and how much better the data fit
without it."""

from __future__ import annotations

from dataclasses import dataclass

# Family of faults of the data among the effects of a verdict.
DATA_FAMILY = "data"


@dataclass(frozen=True)
class Value:
    """A number that describes a fault; its unit is "–" if it has none."""

    name: str
    value: float
    unit: str


@dataclass(frozen=True)
class Fault:
    """A fault that the measurements show, and that must be corrected before a diagnosis.

    Attributes
    ----------
    name : str
    joints : tuple of int
        Joints concerned, counted from 1; empty if there are none.
    detail : str
        One plain sentence.
    parameters : tuple of Value
    evidence : (float, float)
        RMS residual as written and with the correction, m. If only orientations show the
        fault: of a point 1 m away.
    alternatives : tuple of str
        Plain sentences on what explains the measurements as well.
    """

    name: str
    joints: tuple[int, ...]
    detail: str
    parameters: tuple[Value, ...]
    evidence: tuple[float, float]
    alternatives: tuple[str, ...] = ()
