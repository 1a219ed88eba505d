"""What robots of a size usually have, for a robot file that does not say: joint compliances, a rated load, limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.robot import STANDARD_GRAVITY

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain

# Controllers count revolute joints within a turn either way.
UNLIMITED_DEG = (-360.0, 360.0)
# Gears of robots wind up by 3 (cycloidal) to 7 arc minutes (strain wave) under the torque that they are rated for, by their
# makers' catalogues.
_WIND_UP_RAD = 2e-3
# A rack or a ball screw of a track, 50 N/µm.
_TRACK_M_PER_N = 2e-8
# Rated loads of arms of 1 to 3 m grow with the volume that they reach: 10 kg with 1.3 m, 165 kg with 2.7 m.
_LOAD_KG_PER_M3 = 8.0
# Wrists are rated for a load whose centre lies so far from the flange at least.
_SHORTEST_LEVER_M = 0.2


def usual_payload_kg(chain: Chain) -> float:
    """A rated load that suits the reach of an arm."""
    return _LOAD_KG_PER_M3 * float(_reach_behind(chain)[0]) ** 3


def usual_compliance(chain: Chain, payload_kg: float | None = None) -> np.ndarray:
    """Joint compliances that suit the size of an arm: two milliradians under the rated load at the longest lever.

    The published ones of KUKA and FANUC robots of 165 kg are 0.5 to 5 times these: a scale for what is to be identified, no
    value to compute with.

    `payload_kg`: rated load; by `usual_payload_kg` without. Returns (n,): rad/(N m); of prismatic joints m/N.
    """
    load_N = STANDARD_GRAVITY * (usual_payload_kg(chain) if payload_kg is None else payload_kg)
    levers = np.maximum(_reach_behind(chain), _SHORTEST_LEVER_M)
    # A chain without lengths has a lever all the same, and a load of a kilogram.
    return np.where(chain.prismatic, _TRACK_M_PER_N, _WIND_UP_RAD / (max(load_N, STANDARD_GRAVITY) * levers))


def _reach_behind(chain: Chain) -> np.ndarray:
    """Lengths of the chain behind each joint, stretched out, ndarray (n,), m."""
    lengths = [abs(t.constant) if t.kind == "T" else 0.0 for t in chain.transforms]
    places = [next(p for p, t in enumerate(chain.transforms) if t.coordinate == joint) for joint in range(chain.coordinates)]
    return np.array([math.fsum(lengths[place:]) for place in places])
