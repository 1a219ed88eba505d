"""A foundation that gives: shift and tilt of the foot under the load.

Catalogue row 7: [I, -[p]x] C_b (F, p x F). Its compliance about the vertical is that of joint 1 and not counted again.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "base_compliance", "elastic"
WORDS = "elasticity of the foundation"
_PARAMETERS = (
    Parameter("horizontal", "m/N", 2e-8, sign=1),
    Parameter("vertical", "m/N", 2e-8, sign=1),
    Parameter("tilt", "rad/(N m)", 1e-7, sign=1),
)


def candidates(sites):
    """Two candidates at the foot: all ways to give, and rocking alone, which is what most foundations do."""
    tx, ty, tz, rx, ry, _ = sites.base

    def displacement(conditions):
        load = conditions.total
        return [{tx: load[:, tx], ty: load[:, ty]}, {tz: load[:, tz]}, {rx: load[:, rx], ry: load[:, ry]}]

    def rocking(conditions):
        return displacement(conditions)[2:]

    load = frozenset({"load"})
    return [
        Candidate(NAME, FAMILY, (), "", _PARAMETERS, displacement, load),
        Candidate(NAME, FAMILY, (), "rocking", _PARAMETERS[2:], rocking, load),
    ]
