"""A force sensor that shows a force where there is none: J c J^T b wherever the robot is loaded.

Catalogue row 21. The bias is fixed in base axes, or in the flange where the sensor turns with the tool.
"""

from elastocal.effects.protocol import Parameter
from elastocal.effects.wrench_errors import at_flange_and_in_pull

NAME, FAMILY = "force_bias", "load"
WORDS = "zero error of the force sensor"
_PARAMETERS = tuple(Parameter(f"along_{axis}", "N", 10.0) for axis in "xyz")


def candidates(sites):
    """One candidate for each frame in which the sensor can sit."""
    return at_flange_and_in_pull(NAME, FAMILY, _PARAMETERS, lambda axis, wrench: axis.push(wrench))
