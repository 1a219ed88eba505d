"""Sag of a joint under the weight of the links that it carries.

Catalogue row 8: theta_i = sum_k (c_i m_k) tau_ik(q), with tau_ik the torque on joint i of one kilogram at the far end of link
k. Linear in the products of compliance and mass. A link's own mass m at its middle counts as m/2 at its end. Where the robot
file declares masses, theirs are parameters already (`declared_weight`). A variant has the first moments of these links across
their lines too: centres of mass are seldom on them.
"""

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "link_weight", "gravity"
WORDS = "gravity sag"
DETAIL_WORDS = {"off the line": "centre off the line"}
_LINKS = 2
# Some 200 kg on a joint of 1 urad/(N m), and their centre 0.2 m off the line of the link.
_PRODUCT, _MOMENT = 2e-4, 4e-5


def candidates(sites):
    """Two candidates a joint that weight can turn: of the next two links behind it that have a length.

    Masses at their far ends; and the same with the first moments across the links, where these can turn the joint.
    """
    if sites.masses:
        return []
    found = [
        (_candidate(sites, joint, False), _candidate(sites, joint, True))
        for joint in range(sites.joints)
        if not sites.prismatic[joint]
    ]
    return [candidate for variant in zip(*found, strict=True) for candidate in variant if candidate]


def _candidate(sites, joint, transverse):
    carried = sites.carried_links(joint)[:_LINKS]
    across = [(k, axis) for k in carried for axis in sites.transverse_axes(k) if sites.moment_turns(k, axis, joint)]
    if not carried or (transverse and not across):
        return None
    parameters = [Parameter(f"compliance_times_mass_at_end_of_link_{k}", "rad kg/(N m)", _PRODUCT) for k in carried]
    if transverse:
        names = (f"compliance_times_moment_{'xyz'[axis]}_of_link_{k}" for k, axis in across)
        parameters += [Parameter(name, "rad kg m/(N m)", _MOMENT) for name in names]

    def displacement(circumstances):
        torques = [circumstances.weight[k] for k in carried]
        if transverse:
            torques += [circumstances.weight_moment(k, axis) for k, axis in across]
        return [{joint: torque[:, joint]} for torque in torques]

    detail = "off the line" if transverse else ""
    return Candidate(NAME, FAMILY, (joint + 1,), detail, tuple(parameters), displacement)
