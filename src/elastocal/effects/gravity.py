"""Gravity: effects that are there without a load, by weights and the compliances of the joints."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.effects.protocol import Candidate, Parameter, effect, small_form, turning_joints, waves
from elastocal.effects.sizes import RATED, SAG, TORQUE, Size

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "gravity")
_LINKS, _OFF_THE_LINE = 2, "off the line"
# Of a centre of mass off the line of its link; and of a gripper, from the flange.
_OFF_M, _LEVER_M = 0.2, 0.2
DECLARED_WEIGHT = "declared_weight"
# Links are as wide as a tenth of the arm is long (KUKA KR 270: 0.3 m of 2.7 m); motors and gears put the centre of a slender
# one so far off the line as well.
_WIDTH_OF_LENGTH, _LEAST_OFF_M = 0.1, 0.04
# A centre on its joint's axis is stated no better than as so far from it.
_LEAST_LEVER_M = 0.1


def declared_weight(sites: Sites) -> Candidate:
    """Errors of all declared masses and first moments as one candidate, each with the prior of the robot file.

    No effect, for nothing is missing: the declared model has it where the robot file has masses. theta_i = c_i tau_i(q, m) is
    linear in the error of each mass and of its first moments m c, which are what statics identifies (Atkeson, An and Hollerbach
    1986); a mass takes its declared centre with it, so that both errors are independent before the data speak.
    """

    def law(around: Conditions) -> Displacements:
        return _by_joint(around.mass_torques * around.compliance)

    width = _WIDTH_OF_LENGTH * float(np.linalg.norm(sites.link_vectors_m, axis=1).sum())
    parameters: list[Parameter] = []
    for mass in sites.masses:
        error = mass.relative_std * mass.mass_kg
        # Of a centre that is known as well as its mass is, and lies anywhere in the girth of its link (uniform distribution).
        of_girth = mass.mass_kg * max(_LEAST_OFF_M, width / 12**0.5)
        stated = error * max(float(np.linalg.norm(mass.centre_m)), _LEAST_LEVER_M)
        moment = float(np.hypot(stated, of_girth))
        parameters.append(Parameter(f"mass_error_of_link_{mass.link}", "kg", error, error))
        parameters += [Parameter(f"moment_error_{axis}_of_link_{mass.link}", "kg m", stated, moment) for axis in "xyz"]
    return Candidate(DECLARED_WEIGHT, "declared", (), "", tuple(parameters), law)


def _by_joint(turns: np.ndarray) -> Displacements:
    """Turns of the joints by each parameter, ndarray (P, S, n), without those joints that it does not turn."""
    return [{joint: turn for joint, turn in enumerate(each.T) if turn.any()} for each in turns]


@_effect(
    "gravity sag",
    Size("mass", 1.5, "an arm weighs six times what it carries, a quarter of it at the end of a link", RATED),
    Size("mass of one joint", 1.5, "the same, by the joint's turn", SAG),
    detail_words={_OFF_THE_LINE: "centres of mass off the links' axes"},
)
def link_weight(own: Effect, sites: Sites) -> Candidates:
    """Sag of the arm, or of one joint, under the weight of the links that it carries.

    theta_i = c_i sum_k m_k tau_ik(q), with theta_i in rad, c_i the compliance (rad/(N m)), m_k a mass at the far end of link k
    (kg) and tau_ik its torque on joint i (N m/kg). Given the compliances it is linear in masses and first moments (Atkeson et
    al. 1986), which turn all joints at once; of one joint alone, in the products with its compliance. A link's own mass m at
    its middle counts as m/2 at either end. Where the robot file declares masses, theirs are parameters already
    (`declared_weight`). Variants have first moments across the lines of links (kg m) too.
    """
    if sites.masses:
        return
    joints = [joint for (joint,) in turning_joints(sites) if sites.carried_links(joint)]
    near = {joint: sites.carried_links(joint)[:_LINKS] for joint in joints}

    def across(links: Sequence[int], turned: Sequence[int]) -> list[tuple[int, int]]:
        axes = [(k, axis) for k in links for axis in sites.transverse_axes(k)]
        return [pair for pair in axes if any(sites.moment_turns(*pair, joint) for joint in turned)]

    def form(joint: int | None, links: Sequence[int], axes: Sequence[tuple[int, int]], detail: str) -> Candidate:
        of, unit = ("", "{}") if joint is None else ("compliance_times_", "rad {}/(N m)")
        size = own.size("mass", sites) if joint is None else own.size("mass of one joint", sites, joint)
        masses = [Parameter(f"{of}mass_at_end_of_link_{k}", unit.format("kg"), size) for k in links]
        moments = [(f"{of}moment_{'xyz'[axis]}_of_link_{k}", unit.format("kg m"), _OFF_M * size) for k, axis in axes]
        parameters = [*masses, *(Parameter(*moment) for moment in moments)]

        def law(around: Conditions) -> Displacements:
            torques = [*(around.weight(k) for k in links), *(around.weight(k, axis) for k, axis in axes)]
            if joint is None:
                return [dict(enumerate((torque * around.compliance).T)) for torque in torques]
            return [{joint: torque[:, joint]} for torque in torques]

        if joint is None:
            # Without a load the compliances are not identifiable, and nominal ones are far off.
            return own.candidate((), parameters, law, {"external load"}, detail=detail, location_name="arm")
        return own.candidate((joint + 1,), parameters, law, detail=detail)

    # The links behind the first joint that weight can turn turn all others too.
    for first in joints[:1]:
        carried, every = sites.carried_links(first), range(sites.joints)
        yield form(None, near[first], (), "")
        if off := across(near[first], every):
            yield form(None, near[first], off, _OFF_THE_LINE)
        if len(carried) > _LINKS:
            yield form(None, carried, across(carried, every), "all links")
    yield from [form(joint, links, (), "") for joint, links in near.items()]
    yield from [form(joint, links, off, _OFF_THE_LINE) for joint, links in near.items() if (off := across(links, [joint]))]


@_effect(
    "weight of the arm beyond its declared masses",
    Size("share", 0.3, "files made of drawings lack motors, cables and dress, a third of an arm's weight"),
)
def declared_masses(own: Effect, sites: Sites) -> Candidates:
    """Declared masses that are farther off than the robot file says: all by one factor, or each by its own.

    theta_i = c_i sum_k s_k m_k tau_ik(q), with theta_i in rad, c_i the compliance (rad/(N m)), m_k the declared mass of link k
    (kg), tau_ik its torque on joint i (N m/kg) and s_k the share by which it is heavier, one for all links or each its own. A
    mass takes its declared centre with it. Without a load the compliances are free, and no factor of all masses is
    distinguishable from them.
    """
    bodies = [(number, mass) for number, mass in enumerate(sites.masses) if mass.link and mass.mass_kg]
    if not bodies:
        return
    names = [f"share_of_link_{mass.link}_from_mass_{number}" for number, mass in bodies]
    places, kilograms = [MASS_PARAMETERS * number for number, _ in bodies], np.array([mass.mass_kg for _, mass in bodies])

    def turns(around: Conditions) -> np.ndarray:
        return kilograms[:, None, None] * around.mass_torques[places] * around.compliance

    options: Mapping[str, Any] = {"needs": {"external load"}, "location_name": "arm"}
    share, shares = (own.parameters("share", each, "1", sites) for each in (["share"], names))
    yield own.candidate((), share, lambda at: _by_joint(turns(at).sum(axis=0, keepdims=True)), detail="all alike", **options)
    yield own.candidate((), shares, lambda at: _by_joint(turns(at)), detail="each", **options)


# It hangs on the flange in tasks as in the campaign, until someone takes it off: that moves the robot.
@_effect("weight of an undeclared payload", Size("mass", 0.15, "a cable package or a forgotten gripper", RATED))
def payload(own: Effect, sites: Sites) -> Candidates:
    """Weight at the flange that the model does not know: a tool, a cable package or an adapter that nobody declared.

    theta = diag(c) J^T (m g, m r x g), with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the
    Jacobian of the end-effector, g gravity (m/s^2), m the mass (kg) and r its centre from there (m). Given the compliances it
    is linear in m and in the first moments m r along the axes of the end-effector (kg m) (Atkeson et al. 1986).
    """
    mass = own.size("mass", sites)
    moments = [Parameter(f"moment_{axis}", "kg m", _LEVER_M * mass) for axis in "xyz"]

    def law(around: Conditions) -> Displacements:
        gravity, found = np.array(sites.gravity_m_s2), []
        levers = [np.zeros_like(around.wrench[:, :3]), *np.moveaxis(around.end_rotation, -1, 0)]
        for lever, kilograms in zip(levers, (1.0, 0.0, 0.0, 0.0), strict=True):
            force = np.broadcast_to(kilograms * gravity, lever.shape)
            turned = around.joint_deflections(np.concatenate([force, np.cross(lever, gravity)], axis=-1))
            found.append(dict(enumerate(turned.T)))
        return found

    # Where neither a load nor what the links weigh is known, what hangs on the flange is not distinguishable from that.
    tool = own.candidate((), [Parameter("mass", "kg", mass, carried=True), *moments], law, {"load"})
    # A mass alone is most of what a tool does.
    yield from (tool, small_form(tool, "mass", slice(1)))


def compensated_joint(sites: Sites) -> list[tuple[int]]:
    """Joint on which the gravity compensator acts, from 0; none where the robot file has none."""
    on = sites.compensator.joint if sites.compensator else 0
    return [(on - 1,)] if on and not sites.prismatic[on - 1] else []


def wave_parameters(own: Effect, quantity: str, unit: str, sites: Sites, joint: int) -> list[Parameter]:
    """Parameters of `waves` of orders 1 and 2, of which the latter are half as large."""
    each = [own.parameters(quantity, [f"cos_{k}q", f"sin_{k}q"], unit, sites, joint, over=k) for k in (1, 2)]
    return [parameter for order in each for parameter in order]


@_effect(
    "torque of the gravity compensator",
    Size("turn", 0.3, "a compensator bears a third of the weight", TORQUE),
    at=compensated_joint,
)
def compensator_torque(own: Effect, sites: Sites, joint: int) -> Candidates:
    """Torque of a spring or gas gravity compensator on the shoulder: it bears part of the arm's weight, more in some poses.

    T = -dU/dq = K a L (1 - s0/s) sin(alpha + q), U = K (s - s0)^2 / 2, s^2 = a^2 + L^2 + 2 a L cos(alpha + q),

    in N m, for a spring of stiffness K (N/m) and free length s0 (m) between a crank a on the joint and an anchor at the
    distance L (m) (Klimchik et al. 2013). For a short crank, a << L, it is a sine of q and of 2q with unknown phases, under the
    law of a gas cylinder too; the compliance of the joint turns it into theta = sum_k u_k cos(k q) + v_k sin(k q), k = 1, 2, in
    rad.
    """
    parameters = wave_parameters(own, "turn", "rad", sites, joint)
    whole = own.of_joint(joint, parameters, lambda around: waves(around.joint_angles[:, joint], 1, 2))
    yield from (whole, small_form(whole, "first order", slice(2)))
