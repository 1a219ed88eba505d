"""A foundation that yields elastically: floor, anchors or pedestal let the foot of the robot shift and tilt under the load.

u = C (F, M + p x F), C = diag(c_h, c_h, c_v, c_t, c_t, 0), is the displacement of the foot (m, rad) in base axes under a force
F (N) and a moment M (N m) at p (m), declared masses included; c_h and c_v in m/N, c_t in rad/(N m), like a rigid footing on
springs [1]. The compliance about the vertical is that of a joint 1 that turns about it, and is not counted again.

[1] F. E. Richart, J. R. Hall and R. D. Woods, Vibrations of Soils and Foundations, Prentice-Hall, 1970.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "base_compliance", "elastic"
MOVES_ROBOT = True
WORDS = "elasticity of the foundation"


def candidates(sites: Sites) -> list[Candidate]:
    """Two candidates at the foot: all ways to give, and rocking alone, which is what most foundations do."""
    tx, ty, tz, rx, ry, _ = sites.base
    tilt = sized(NAME, "tilt", ["tilt"], "rad/(N m)", sites)
    parameters = (*sized(NAME, "shift", ["horizontal", "vertical"], "m/N", sites), *tilt)

    def displacement(conditions: Conditions) -> Displacements:
        load = conditions.total
        return [{tx: load[:, tx], ty: load[:, ty]}, {tz: load[:, tz]}, {rx: load[:, rx], ry: load[:, ry]}]

    def rocking(conditions: Conditions) -> Displacements:
        return displacement(conditions)[2:]

    load = frozenset({"load"})
    return [
        Candidate(NAME, FAMILY, (), "", parameters, displacement, load),
        Candidate(NAME, FAMILY, (), "rocking", tilt, rocking, load),
    ]
