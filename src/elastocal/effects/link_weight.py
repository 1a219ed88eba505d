"""Sag of the arm, or of one joint, under the weight of the links that it carries.

theta_i = c_i sum_k m_k tau_ik(q), with theta_i in rad, c_i the compliance (rad/(N m)), m_k a mass at the far end of link k (kg)
and tau_ik its torque on joint i (N m/kg). Given the compliances it is linear in masses and first moments [1], which turn all
joints at once; of one joint alone, in the products with its compliance. A link's own mass m at its middle counts as m/2 at
either end. Where the robot file declares masses, theirs are parameters already (`declared_weight`). Variants have the first
moments of these links across their lines (kg m) too: centres of mass are seldom on them.

[1] C. G. Atkeson, C. H. An and J. M. Hollerbach, Estimation of inertial parameters of manipulator loads and links,
    International Journal of Robotics Research 5, 1986.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "link_weight", "gravity"
MOVES_ROBOT = True
WORDS = "gravity sag"
_OFF_THE_LINE, _ALL_LINKS = "off the line", "all links"
DETAIL_WORDS = {_OFF_THE_LINE: "centres of mass off the links' axes"}
_LINKS = 2
# Of a centre of mass off the line of its link.
_OFF_M = 0.2
_OF_THE_ARM = "arm"


def candidates(sites: Sites) -> list[Candidate]:
    """Three candidates for the arm and two a joint that weight can turn: of the next two links behind it that have a length.

    Masses at their far ends; and the same with the first moments across the links, where these can turn the joint. Of the arm
    also both of all links.
    """
    if sites.masses:
        return []
    joints = [joint for joint in range(sites.joints) if not sites.prismatic[joint] and sites.carried_links(joint)]
    return [*_of_the_arm(sites, joints), *_of_joints(sites, joints)]


def _of_the_arm(sites: Sites, joints: Sequence[int]) -> Iterator[Candidate]:
    """Of the links behind the first joint that weight can turn, by which they turn all others too."""
    if not joints:
        return
    carried = sites.carried_links(joints[0])
    some = carried[:_LINKS]
    across = _across(sites, some, range(sites.joints))
    mass = size_of(NAME, "mass", sites)

    def candidate(detail: str, links: Sequence[int], axes: Sequence[tuple[int, int]]) -> Candidate:
        parameters = [Parameter(f"mass_at_end_of_link_{k}", "kg", mass) for k in links]
        parameters += [Parameter(f"moment_{'xyz'[axis]}_of_link_{k}", "kg m", _OFF_M * mass) for k, axis in axes]

        def displacement(conditions: Conditions) -> Displacements:
            torques = _torques(conditions, links, axes)
            return [dict(enumerate((torque * conditions.compliance).T)) for torque in torques]

        # Without a load the compliances are not identifiable, and nominal ones are far off.
        return Candidate(
            NAME, FAMILY, (), detail, tuple(parameters), displacement, frozenset({"external load"}), location_name=_OF_THE_ARM
        )

    yield candidate("", some, ())
    if across:
        yield candidate(_OFF_THE_LINE, some, across)
    if len(carried) > len(some):
        yield candidate(_ALL_LINKS, carried, _across(sites, carried, range(sites.joints)))


def _of_joints(sites: Sites, joints: Sequence[int]) -> Iterator[Candidate]:
    def candidate(joint: int, detail: str, links: Sequence[int], axes: Sequence[tuple[int, int]]) -> Candidate:
        product = size_of(NAME, "mass of one joint", sites, joint)
        parameters = [Parameter(f"compliance_times_mass_at_end_of_link_{k}", "rad kg/(N m)", product) for k in links]
        names = (f"compliance_times_moment_{'xyz'[axis]}_of_link_{k}" for k, axis in axes)
        parameters += [Parameter(name, "rad kg m/(N m)", _OFF_M * product) for name in names]

        def displacement(conditions: Conditions) -> Displacements:
            return [{joint: torque[:, joint]} for torque in _torques(conditions, links, axes)]

        return Candidate(NAME, FAMILY, (joint + 1,), detail, tuple(parameters), displacement)

    carried = {joint: sites.carried_links(joint)[:_LINKS] for joint in joints}
    yield from (candidate(joint, "", links, ()) for joint, links in carried.items())
    across = {joint: _across(sites, links, [joint]) for joint, links in carried.items()}
    yield from (candidate(joint, _OFF_THE_LINE, carried[joint], axes) for joint, axes in across.items() if axes)


def _across(sites: Sites, links: Sequence[int], turned: Sequence[int]) -> list[tuple[int, int]]:
    """Links, and their axes across them along which a first moment can turn some joints."""
    axes = [(k, axis) for k in links for axis in sites.transverse_axes(k)]
    return [pair for pair in axes if any(sites.moment_turns(*pair, joint) for joint in turned)]


def _torques(conditions: Conditions, links: Sequence[int], axes: Sequence[tuple[int, int]]) -> list[np.ndarray]:
    return [*(conditions.weight[k] for k in links), *(conditions.weight_moment(k, axis) for k, axis in axes)]
