"""A tracker that measures all lengths too long or too short, by its wavelength in warm air or by a bad absolute distance.

Every position is scaled about the tracker (Muralikrishnan, Phillips and Sawyer 2016). Scaled about the base they differ from
that by a shift of the frame, which is fitted where it is unknown; and a robot whose positions are all scaled about its base is
one whose column and links are longer by that share.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.effects.thermal_growth import longer

NAME, FAMILY = "tracker_scale", "geometry"
WORDS = "scale error of the tracker"
# Twenty kelvins or 70 hPa of air that nobody told the tracker of.
_PARAMETERS = (Parameter("scale", "m/m", 2e-5),)


def candidates(sites):
    """One candidate."""

    def displacement(conditions):
        return [longer(sites, np.ones(len(conditions.joint_angles)))]

    return [Candidate(NAME, FAMILY, (), "", _PARAMETERS, displacement)]
