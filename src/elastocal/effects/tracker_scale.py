"""A tracker that measures all lengths too long or too short, by its wavelength in warm air or by a bad absolute distance.

p' = (1 + s) p about the tracker, with p a position (m) and s the scale error (m/m) [1]. Scaled about the base positions
differ from that by a shift of the frame, which is fitted where it is unknown; and a robot whose positions are all scaled about
its base is one whose column, links and travels along a track are longer by that share. What lies behind a passive joint is no
link and is left out.

[1] B. Muralikrishnan, S. Phillips and D. Sawyer, Laser trackers for large-scale dimensional metrology: a review, Precision
    Engineering 44, 2016.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized
from elastocal.effects.thermal_growth import longer

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "tracker_scale", "geometry"
# The tracker shows lengths that the robot does not have.
MOVES_ROBOT = False
WORDS = "scale error of the tracker"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate."""

    def displacement(conditions: Conditions) -> Displacements:
        travels = {joint: conditions.joint_angles[:, joint] for joint, slides in enumerate(sites.prismatic) if slides}
        return [longer(sites, np.ones(len(conditions.joint_angles))) | travels]

    return [Candidate(NAME, FAMILY, (), "", sized(NAME, "scale", ["scale"], "m/m", sites), displacement)]
