"""A tracker or a foot that wanders: a rigid motion of all measurements, linear in the time since the campaign began.

Catalogue row 23.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "frame_drift", "drift"
WORDS = "drift of the tracker or of the robot's foot"
_PARAMETERS = (
    *(Parameter(f"d{axis}", "m/h", 2e-4) for axis in "xyz"),
    *(Parameter(f"r{axis}", "rad/h", 1e-4) for axis in "xyz"),
)
_HOUR_S = 3600.0


def candidates(sites):
    """One candidate, at the foot."""

    def displacement(conditions):
        hours = conditions.time_s / _HOUR_S
        return [{coordinate: hours} for coordinate in sites.base]

    return [Candidate(NAME, FAMILY, (), "", _PARAMETERS, displacement, frozenset({"time"}), of_setup=True)]
