"""Sag of a joint under the weight of the links that it carries.

Catalogue row 8: theta_i = sum_k (c_i m_k) tau_ik(q), with tau_ik the torque on joint i of one kilogram at the far end of link
k. Linear in the products of compliance and mass. A link's own mass m at its middle counts as m/2 at its end. Where the robot
file declares masses, theirs are parameters already (`declared_weight`).
"""

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "link_weight", "gravity"
_LINKS = 2


def candidates(sites):
    """One candidate a joint that weight can turn: masses at the far ends of the next two links behind it that have a length."""
    if sites.masses:
        return []

    def at(joint):
        carried = sites.carried_links(joint)[:_LINKS]
        if not carried:
            return None
        parameters = tuple(Parameter(f"compliance_times_mass_at_end_of_link_{k}", "rad kg/(N m)", 2e-4) for k in carried)

        def displacement(circumstances):
            return [{joint: circumstances.weight[k][:, joint]} for k in carried]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement)

    return [candidate for candidate in per_joint(sites, at) if candidate]
