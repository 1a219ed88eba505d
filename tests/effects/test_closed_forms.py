"""Effects of the catalogue against closed forms of the displacement of every measuring
point.

Closed forms use frames, axes, Jacobians and loads of the robot's chain from pinocchio. The
closed form of a new effect is in its own test, see `helpers/closed_forms.py`.
"""

import numpy as np
import pytest
from catalogue_lists import has_own_test
from closed_forms import (
    CHAINS,
    GRAVITY,
    MASSES,
    STATES,
    check_closed_form,
    joint_angle,
    link_in,
    of_the_joint,
    six,
    wave,
)
from scipy.spatial.transform import Rotation

from elastocal.effects.catalogue import list_bundled_effects
from elastocal.effects.elastic import joint_compliance

# Nodes and weights of Gauss-Legendre integrals along a link.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
EYE = np.eye(3)


def link_geometry(arm, law, name):
    after = arm.far_end(law.joints[0])
    return six(arm, after, arm.frame(after)[1], name, 1.0)


def nest_eccentricity(arm, law, name):
    kind, axis, order = name.split("_")
    last = arm.places[-1]
    amount = wave(f"{kind}_{order}", arm.states.joint_angles[:, -1])
    return six(arm, arm.end, arm.frame(last + 1)[1], f"d{axis}", amount)


def scaled(arm, amount):
    """All positions, farther from the base by these shares."""
    displacement = np.zeros((STATES, len(arm.chain.points), 6))
    for number, point in enumerate(arm.chain.points):
        displacement[:, number, :3] = (
            arm.frame(point.after)[0] * np.broadcast_to(amount, STATES)[:, None]
        )
    return displacement


def grown(arm, amount):
    """As `scaled`, but without the travel of carriages, which castings do not change."""
    travel = np.array(
        [t.kind == "T" for t in arm.chain.transforms if t.coordinate is not None]
    )
    return scaled(arm, amount) - arm.turned(
        travel * arm.states.joint_angles * amount[:, None]
    )


def weight(arm, after, name):
    """Torques of a kilogram at a place, or of a kilogram metre along one of its
    axes."""
    _, rotation, jacobian = arm.frame(after)
    if "moment_" not in name:
        return np.einsum("srj,r->sj", jacobian[:, :3], GRAVITY)
    axis = "xyz".index(name.split("moment_")[1][0])
    return np.einsum(
        "srj,sr->sj", jacobian[:, 3:], np.cross(rotation[..., axis], GRAVITY)
    )


def link_weight(arm, law, name):
    torque = weight(arm, arm.far_end(link_in(name)), name)
    return (
        arm.of_joint(law.joints[0], torque[:, law.joints[0] - 1])
        if law.joints
        else arm.turned(torque * arm.compliance)
    )


def declared_masses(arm, law, name):
    """Torques of all declared masses, or of the one whose number is in the name."""
    torques = []
    for mass in MASSES:
        after = arm.places[mass.link - 1] + 1
        along = [
            component * weight(arm, after, f"moment_{axis}")
            for component, axis in zip(mass.centre_m, "xyz", strict=True)
        ]
        torques.append(mass.mass_kg * (weight(arm, after, "") + sum(along)))
    torque = sum(torques) if name == "share" else torques[int(name.rsplit("_", 1)[1])]
    return arm.turned(torque * arm.compliance)


def payload(arm, law, name):
    return arm.turned(weight(arm, arm.end, name) * arm.compliance)


def motor_eccentricity(arm, law, name):
    kind, order, _ = name.split("_")
    return wave(f"{kind}_{order}q", 101.0 * joint_angle(arm, law))


def bearing_runout(arm, law, name):
    motion, axis, kind, order = name.split("_")
    position = arm.places[law.joints[0] - 1]
    fixed = arm.frame(position)[1]
    amount = wave(f"{kind}_{order}", joint_angle(arm, law))
    if motion == "wobble":
        return six(arm, position + 1, fixed, f"r{axis}", amount)
    return six(arm, position + 1, fixed, f"d{axis}", amount, arm.far_end(law.joints[0]))


def bent_links(arm, law):
    return arm.long if law.detail == "one section" else list(law.joints) or [0]


def link_elasticity(arm, law, name, taper):
    """Integrate curvature and twist by the load on each piece of a link to its far
    end."""
    displacement = 0.0
    # The parameter is that of a uniform link with the same deflection or torsion.
    power = 2 if name.startswith("bending") else 0
    softer = (1 - taper * (NODES + 1) / 2) ** -3.0
    uniform = (
        1.0 / (power + 1) / (WEIGHTS / 2 @ (softer * (1 - (NODES + 1) / 2) ** power))
    )
    for link in bent_links(arm, law):
        after = arm.far_end(link)
        along, length = arm.link(link)
        force, moment = arm.load(after)
        shift = turn = np.zeros((STATES, 3))
        for position, weighs in zip(
            length * (NODES + 1) / 2, WEIGHTS * length / 2, strict=True
        ):
            lever = along * (length - position)
            bending_and_twist = (
                (moment + np.cross(lever, force))
                * weighs
                * uniform
                / (1 - taper * position / length) ** 3
            )
            twist = along * (bending_and_twist * along).sum(axis=1, keepdims=True)
            component = (
                bending_and_twist - twist if name.startswith("bending") else twist
            )
            shift = shift + np.cross(component, lever)
            turn = turn + component
        displacement = displacement + arm.moved(after, shift, turn)
    return displacement


def joint_tilt(arm, law, name):
    position = arm.places[law.joints[0] - 1] + 1
    rotation = arm.frame(position)[1]
    moment = arm.load(position)[1]
    return six(
        arm,
        position,
        rotation,
        f"r{name[-1]}",
        (rotation[..., "xyz".index(name[-1])] * moment).sum(axis=1),
    )


def base_compliance(arm, law, name):
    force, moment = arm.load(0)
    kept = {"horizontal": [1, 1, 0], "vertical": [0, 0, 1], "tilt": [1, 1, 0]}[name]
    none = np.zeros((STATES, 3))
    return (
        arm.moved(0, none, moment * kept)
        if name == "tilt"
        else arm.moved(0, force * kept, none)
    )


def cross_compliance(arm, law, name):
    first, second = law.joints
    return arm.of_joint(first, arm.torque[:, second - 1]) + arm.of_joint(
        second, arm.torque[:, first - 1]
    )


def torque_of(arm, law):
    return arm.torque[:, law.joints[0] - 1]


def flange_flexibility(arm, law, name):
    rotation = arm.frame(arm.end)[1]
    felt = np.split(arm.states.wrench, 2, axis=1)[name.startswith("turn")]
    return six(
        arm,
        arm.end,
        rotation,
        name,
        (rotation[..., "xyz".index(name[-1])] * felt).sum(axis=1),
    )


def stiffening(arm, law, name, meeting):
    torque = torque_of(arm, law)
    if law.detail == "two slopes":
        return np.sign(torque) * np.maximum(np.abs(torque) - meeting, 0.0)
    return torque - meeting * np.tanh(torque / meeting)


def by_wrong_wrench(change):
    """A closed form by the change of the wrench: `change(axis, force)` gives those of
    force and moment."""

    def closed(arm, law, name):
        axes = (
            np.broadcast_to(EYE, (STATES, 3, 3))
            if law.detail.startswith("base")
            else arm.frame(arm.end)[1]
        )
        force, moment = change(
            axes[..., "xyz".index(name[-1])], arm.states.wrench[:, :3]
        )
        if law.detail.endswith("in the pull"):
            moment = moment + np.cross(arm.pull, force)
        return arm.turned(arm.under(np.concatenate([force, moment], axis=1)))

    return closed


def turned_force(axis, force):
    """Central differences of a finite rotation."""
    ahead, behind = (
        Rotation.from_rotvec(sign * 1e-4 * axis).apply(force) for sign in (1, -1)
    )
    return (ahead - behind) / 2e-4, np.zeros_like(force)


def warmth(arm, law, *lag):
    if "temperature" in law.detail:
        return arm.states.temperature_c - 20.0
    elapsed = share_before(arm) if "order" in law.detail else arm.states.time_s
    return 1.0 - np.exp(-elapsed / lag[0])


def share_before(arm):
    """Share of the campaign before each row."""
    row = arm.states.row
    return (row - row.min()) / (row.max() - row.min())


def temperature_gradient(arm, law, name, *lag):
    warmer = warmth(arm, law, *lag)[:, None]
    if name == "growth_along":
        lengths = np.array([arm.link(link)[1] for link in range(arm.joints + 1)])
        middles = np.cumsum(lengths) - lengths / 2
        further = middles - np.average(middles, weights=lengths)
        none = np.zeros((STATES, 3))
        return sum(
            arm.moved(
                arm.far_end(link),
                warmer * further[link] * arm.link(link)[0] * lengths[link],
                none,
            )
            for link in range(arm.joints + 1)
        )
    link = law.joints[0] if law.joints else 0
    after, (along, length) = arm.far_end(link), arm.link(link)
    axis = arm.frame(after)[1][..., "xyz".index(name[-1])]
    curvature = warmer * (axis - along * (axis * along).sum(axis=1, keepdims=True))
    pieces = zip(length * (NODES + 1) / 2, WEIGHTS * length / 2, strict=True)
    shift = sum(
        np.cross(curvature * weighs, along * (length - position))
        for position, weighs in pieces
    )
    return arm.moved(after, shift, length * curvature)


def at_the_foot(amount):
    """A closed form of the foot: dx to rz by `amount(arm, *shapes)` in base axes."""
    axes = np.broadcast_to(EYE, (STATES, 3, 3))
    return lambda arm, law, name, *shapes: six(arm, 0, axes, name, amount(arm, *shapes))


def after_row(arm, when):
    return (share_before(arm) >= when).astype(float)


def frame_drift(arm, law, name):
    elapsed = share_before(arm) if law.detail == "order" else arm.states.time_s / 3600.0
    return at_the_foot(lambda arm: elapsed)(arm, law, name)


CLOSED_FORMS = {
    "joint_offset": of_the_joint(lambda arm, law, name: np.ones(STATES)),
    "link_geometry": link_geometry,
    "nest_eccentricity": nest_eccentricity,
    "tracker_scale": lambda arm, law, name: scaled(arm, 1.0),
    "link_weight": link_weight,
    "payload": payload,
    "declared_masses": declared_masses,
    "compensator_torque": of_the_joint(
        lambda arm, law, name: wave(name, joint_angle(arm, law))
    ),
    "transmission_harmonic": of_the_joint(
        lambda arm, law, name: wave(name, joint_angle(arm, law))
    ),
    "transmission_ratio": of_the_joint(
        lambda arm, law, name: arm.states.joint_angles[
            :, int(name.removeprefix("per_q")) - 1
        ]
    ),
    "transmission_order": of_the_joint(
        lambda arm, law, name, order: {"c": np.cos, "s": np.sin}[name[0]](
            (1 + ("2" in name)) * order * joint_angle(arm, law)
        )
    ),
    "motor_eccentricity": of_the_joint(motor_eccentricity),
    "bearing_runout": bearing_runout,
    "link_elasticity": link_elasticity,
    "joint_tilt": joint_tilt,
    "base_compliance": base_compliance,
    "cross_compliance": cross_compliance,
    "joint_dependent_stiffness": of_the_joint(
        lambda arm, law, name: torque_of(arm, law) * wave(name, joint_angle(arm, law))
    ),
    "compensator_stiffness": of_the_joint(
        lambda arm, law, name: torque_of(arm, law) * wave(name, joint_angle(arm, law))
    ),
    "flange_flexibility": flange_flexibility,
    "stiffening": of_the_joint(stiffening),
    "lost_motion": of_the_joint(
        lambda arm, law, name, taken_up: np.tanh(torque_of(arm, law) / taken_up)
    ),
    "hysteresis": of_the_joint(
        lambda arm, law, name: arm.states.approach[:, law.joints[0] - 1]
    ),
    "force_misalignment": by_wrong_wrench(turned_force),
    "force_bias": by_wrong_wrench(lambda axis, force: (axis, np.zeros_like(force))),
    "application_point": by_wrong_wrench(
        lambda axis, force: (np.zeros_like(force), np.cross(axis, force))
    ),
    "force_scale": lambda arm, law, name: arm.turned(arm.under(arm.states.wrench)),
    "thermal_growth": lambda arm, law, name, *lag: grown(arm, warmth(arm, law, *lag)),
    "temperature_gradient": temperature_gradient,
    "base_placement": at_the_foot(lambda arm: 1.0),
    "frame_drift": frame_drift,
    "setup_step": at_the_foot(after_row),
}


def test_every_effect_has_a_closed_form():
    effects = list_bundled_effects()
    assert set(CLOSED_FORMS) <= set(effects)
    for name in set(effects) - set(CLOSED_FORMS):
        assert has_own_test(effects[name]), f"no closed form of {name}"


@pytest.mark.parametrize("chain_name", CHAINS)
@pytest.mark.parametrize("name", sorted(CLOSED_FORMS))
def test_effect_agrees_with_its_closed_form(name, chain_name):
    effect = list_bundled_effects()[name]
    check_closed_form(effect.candidates, CLOSED_FORMS[name], chain_name)


@pytest.mark.parametrize("chain_name", CHAINS)
def test_joint_compliances_rotate_each_joint_by_its_torque(chain_name):
    def closed(arm, law, name):
        joint = int(name.removeprefix("c"))
        turned = arm.of_joint(joint, arm.torque[:, joint - 1])
        assert turned.any()
        return turned

    check_closed_form(lambda sites: [joint_compliance(sites)], closed, chain_name)
