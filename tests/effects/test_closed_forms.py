"""Every effect of the catalogue against its closed form: what a unit of each parameter
makes of every measuring point.

Closed forms are written with the robot's own chain as pinocchio sees it: places, axes,
Jacobians and loads carried to a place by hand. A new effect is here by itself, and
fails until its closed form is added to `CLOSED_FORMS`.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import OTHER_CHAINS, TRACK, PinocchioPoint, chain_of
from synthetic import displacements, equipped, made_states

from elastocal.effects import catalogue
from elastocal.effects.conditions import conditions_of
from elastocal.effects.elastic import joint_compliance
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.robot import Mass

CHAINS = {"fanuc": None, "track": TRACK} | {
    name: OTHER_CHAINS[name] for name in ("fixed rotations", "seven joints", "ur10")
}
# Of a robot that hangs askew.
STATES = 4
GRAVITY = (3.0, -4.0, -8.0)
# Nodes of an integral along a link.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
LONG_M = 0.05
# Of a robot whose file says what its links weigh.
MASSES = (Mass(2, 40.0, (0.1, -0.02, 0.3), 0.1), Mass(3, 15.0, (-0.05, 0.1, 0.02), 0.1))
EYE = np.eye(3)
# Arms under loads anywhere, in a pull, and with declared masses.
PLAIN = "plain"
PULLED = "pulled"
WEIGHED = "weighed"


class Arm:
    """A robot in some states under loads, by pinocchio on its own chain; vectors in
    base axes, ndarrays (S, ...)."""

    def __init__(self, chain, pulled=False):
        self.chain, self.joints = chain, chain.coordinates
        # From a load that play takes up to one beyond the knee of every gear.
        self.states = made_states(self.joints, STATES, seed=1, force=1.0)
        self.states.wrench[:] *= np.geomspace(10.0, 2e4, STATES)[:, None]
        self.compliance = 1e-6 * np.arange(1, self.joints + 1)
        self._frames = {}
        self.pull = np.zeros((STATES, 3))
        if pulled:
            self.pull = self.frame(self.end)[1] @ [0.1, 0.4, -0.2]
            moment = np.cross(self.pull, self.states.wrench[:, :3])
            self.states = replace(
                self.states,
                wrench=np.concatenate([self.states.wrench[:, :3], moment], axis=1),
            )

    @property
    def end(self):
        return len(self.chain.transforms)

    @cached_property
    def places(self):
        """How many transforms come before each joint."""
        return [
            index
            for index, t in enumerate(self.chain.transforms)
            if t.coordinate is not None
        ]

    def far_end(self, link):
        """How many transforms come before the far end of a link, 0 the column."""
        return [*self.places, self.end][link]

    def frame(self, after):
        """Position, rotation and Jacobian behind so many transforms."""
        if after not in self._frames:
            one = PinocchioPoint(self.chain, MeasuringPoint("here", after))
            seen = [
                one.pose_and_jacobian(angles) for angles in self.states.joint_angles
            ]
            self._frames[after] = [np.array(part) for part in zip(*seen, strict=True)]
        return self._frames[after]

    def load(self, after):
        """Force and moment of the load at a place."""
        force, moment = np.split(self.states.wrench, 2, axis=1)
        return force, moment + np.cross(
            self.frame(self.end)[0] - self.frame(after)[0], force
        )

    @property
    def torque(self):
        return self.under(self.states.wrench) / self.compliance

    def under(self, wrench):
        """Turns of the joints under a wrench at the end."""
        return (
            np.einsum("srj,sr->sj", self.frame(self.end)[2], wrench) * self.compliance
        )

    def turned(self, turns):
        """Twist of each measuring point when the joints move: ndarray (S, P, 6)."""
        return np.stack(
            [
                np.einsum("srj,sj->sr", self.frame(point.after)[2], turns)
                for point in self.chain.points
            ],
            axis=1,
        )

    def of_joint(self, joint, amount):
        """The same when one joint moves, from 1."""
        return self.turned(np.asarray(amount)[:, None] * np.eye(self.joints)[joint - 1])

    def moved(self, after, shift, turn, first=None):
        """The same when all behind a place shifts and turns there; points from `first`
        transforms on are behind it."""
        here = self.frame(after)[0]
        found = np.zeros((STATES, len(self.chain.points), 6))
        for number, point in enumerate(self.chain.points):
            if point.after >= (after if first is None else first):
                carried = np.cross(turn, self.frame(point.after)[0] - here)
                found[:, number] = np.concatenate(
                    [shift + carried, np.broadcast_to(turn, (STATES, 3))], axis=1
                )
        return found

    def link(self, link):
        """Unit vector along a link and its length, from behind the joint before it."""
        vector = (
            self.frame(self.far_end(link))[0]
            - self.frame(self.places[link - 1] + 1 if link else 0)[0]
        )
        length = np.linalg.norm(vector, axis=1)[0]
        return vector / max(length, 1e-12), length

    @property
    def long(self):
        return [link for link in range(self.joints + 1) if self.link(link)[1] > LONG_M]


def link_in(name):
    return int(name.split("_")[-1])


def wave(name, angle):
    """cos_3q and the like of an angle."""
    kind, order = name.split("_")
    return {"cos": np.cos, "sin": np.sin}[kind](
        int(order.removesuffix("q") or 1) * angle
    )


def joint_angle(arm, law):
    return arm.states.joint_angles[:, law.joints[0] - 1]


def of_the_joint(amount):
    """A closed form of one joint's own: `amount(arm, law, name, *shapes)`."""
    return lambda arm, law, name, *shapes: arm.of_joint(
        law.joints[0], amount(arm, law, name, *shapes)
    )


def six(arm, after, axes, name, amount, first=None):
    """Shift or turn by an amount along one of the axes (S, 3, 3) at a place: dx, ry,
    shift_x, turn_x."""
    along = axes[..., "xyz".index(name[-1])] * np.broadcast_to(amount, STATES)[:, None]
    none = np.zeros((STATES, 3))
    turns = name[0] == "r" or name.startswith("turn")
    return arm.moved(after, none if turns else along, along if turns else none, first)


def link_geometry(arm, law, name):
    after = arm.far_end(law.joints[0])
    return six(arm, after, arm.frame(after)[1], name, 1.0)


def nest_eccentricity(arm, law, name):
    kind, axis, order = name.split("_")
    last = arm.places[-1]
    amount = wave(f"{kind}_{order}", arm.states.joint_angles[:, -1])
    return six(arm, arm.end, arm.frame(last + 1)[1], f"d{axis}", amount)


def scaled(arm, amount):
    """All positions further from the foot by shares."""
    found = np.zeros((STATES, len(arm.chain.points), 6))
    for number, point in enumerate(arm.chain.points):
        found[:, number, :3] = (
            arm.frame(point.after)[0] * np.broadcast_to(amount, STATES)[:, None]
        )
    return found


def grown(arm, amount):
    """The same but for the travel of carriages, whose scale and spindle are not of the
    castings."""
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
    """Of all the masses that the sites declare, or of the one that the name counts."""
    torques = []
    for mass in MASSES:
        after = arm.places[mass.link - 1] + 1
        along = [
            part * weight(arm, after, f"moment_{axis}")
            for part, axis in zip(mass.centre_m, "xyz", strict=True)
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
    place = arm.places[law.joints[0] - 1]
    fixed = arm.frame(place)[1]
    amount = wave(f"{kind}_{order}", joint_angle(arm, law))
    if motion == "wobble":
        return six(arm, place + 1, fixed, f"r{axis}", amount)
    return six(arm, place + 1, fixed, f"d{axis}", amount, arm.far_end(law.joints[0]))


def link_elasticity(arm, law, name, taper):
    """Curvature and twist under the load on each piece of the link, integrated to its
    far end."""
    links = arm.long if law.detail == "one section" else list(law.joints) or [0]
    found = 0.0
    # Of the uniform link that a force shifts, or a moment twists, as far.
    power = 2 if name.startswith("bending") else 0
    softer = (1 - taper * (NODES + 1) / 2) ** -3.0
    uniform = (
        1.0 / (power + 1) / (WEIGHTS / 2 @ (softer * (1 - (NODES + 1) / 2) ** power))
    )
    for link in links:
        after, (along, length) = arm.far_end(link), arm.link(link)
        force, moment = arm.load(after)
        shift = turn = np.zeros((STATES, 3))
        for place, weighs in zip(
            length * (NODES + 1) / 2, WEIGHTS * length / 2, strict=True
        ):
            lever = along * (length - place)
            there = (
                (moment + np.cross(lever, force))
                * weighs
                * uniform
                / (1 - taper * place / length) ** 3
            )
            twist = along * (there * along).sum(axis=1, keepdims=True)
            part = there - twist if name.startswith("bending") else twist
            shift = shift + np.cross(part, lever)
            turn = turn + part
        found = found + arm.moved(after, shift, turn)
    return found


def joint_tilt(arm, law, name):
    place = arm.places[law.joints[0] - 1] + 1
    rotation = arm.frame(place)[1]
    moment = arm.load(place)[1]
    return six(
        arm,
        place,
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
    one, other = law.joints
    return arm.of_joint(one, arm.torque[:, other - 1]) + arm.of_joint(
        other, arm.torque[:, one - 1]
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
    """By central differences of a finite turn."""
    ahead, behind = (
        Rotation.from_rotvec(sign * 1e-4 * axis).apply(force) for sign in (1, -1)
    )
    return (ahead - behind) / 2e-4, np.zeros_like(force)


def warmth(arm, law, *lag):
    if "temperature" in law.detail:
        return arm.states.temperature_c - 20.0
    return 1.0 - np.exp(-arm.states.time_s / lag[0])


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
        np.cross(curvature * weighs, along * (length - place))
        for place, weighs in pieces
    )
    return arm.moved(after, shift, length * curvature)


def at_the_foot(amount):
    """A closed form of the foot: dx to rz by `amount(arm, *shapes)` in base axes."""
    axes = np.broadcast_to(EYE, (STATES, 3, 3))
    return lambda arm, law, name, *shapes: six(arm, 0, axes, name, amount(arm, *shapes))


def after_row(arm, when):
    row = arm.states.row
    return ((row - row.min()) / (row.max() - row.min()) >= when).astype(float)


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
    "frame_drift": at_the_foot(lambda arm: arm.states.time_s / 3600.0),
    "setup_step": at_the_foot(after_row),
}


@pytest.fixture(scope="module")
def arms(fanuc):
    """Each chain of each kind, with conditions and the Jacobian of the chain with all
    its sites."""
    found = {}
    for name, text in CHAINS.items():
        chain = fanuc.chain if text is None else chain_of(text)
        for kind in PLAIN, PULLED, WEIGHED:
            arm = Arm(chain, kind == PULLED)
            masses = MASSES if kind == WEIGHED else ()
            sites = replace(equipped(chain), masses=masses, gravity_m_s2=GRAVITY)
            at = np.zeros((STATES, sites.chain.coordinates))
            at[:, : arm.joints] = arm.states.joint_angles
            points = [
                replace(point, offset_m=(0.0, 0.0, 0.0)) for point in sites.chain.points
            ]
            jacobian = np.stack(
                [poses_and_jacobians(sites.chain, at, point)[2] for point in points],
                axis=1,
            )
            found[name, kind] = (
                arm,
                conditions_of(sites, arm.compliance, arm.states),
                jacobian,
            )
    return found


def compared(arms, chain, laws, closed):
    """Key and name, what it makes of the points, and what it should, for each parameter
    of each law."""
    kind = PLAIN if laws(arms[chain, PLAIN][1].sites) else WEIGHED
    for law in laws(arms[chain, kind][1].sites):
        arm, around, jacobian = arms[
            chain, PULLED if law.detail.endswith("in the pull") else kind
        ]
        # Where a fit starts, and a quarter up the range.
        quarter = [
            shape.lowest + (shape.highest - shape.lowest) / 4 for shape in law.shapes
        ]
        for shapes in ([shape.start for shape in law.shapes], quarter)[
            : 1 + bool(quarter)
        ]:
            made = displacements(law, around, *shapes)
            for parameter, each in zip(law.parameters, made, strict=True):
                found = np.einsum("sprc,sc->spr", jacobian, each)
                yield (
                    f"{law.key} {parameter.name}",
                    found,
                    closed(arm, law, parameter.name, *shapes),
                )


def close(found, expected):
    return np.allclose(
        found, expected, rtol=0, atol=1e-7 * np.abs(expected).max() + 1e-14
    )


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("effect", sorted(catalogue.list_bundled_effects()))
def test_effect_is_its_closed_form(effect, chain, arms):
    assert effect in CLOSED_FORMS, (
        "it has no closed form: add one, by name of its parameters"
    )
    closed = CLOSED_FORMS[effect]
    laws = catalogue.list_bundled_effects()[effect].candidates
    for key, found, expected in compared(arms, chain, laws, closed):
        assert close(found, expected), (
            key,
            np.abs(found - expected).max(),
            np.abs(expected).max(),
        )
        # On an industrial arm nothing is compared with nothing.
        assert chain != "fanuc" or expected.any(), key


@pytest.mark.parametrize("chain", CHAINS)
def test_springs_of_the_declared_model_turn_each_joint_by_its_torque(chain, arms):
    def closed(arm, law, name):
        joint = int(name.removeprefix("c"))
        return arm.of_joint(joint, arm.torque[:, joint - 1])

    for key, found, expected in compared(
        arms, chain, lambda sites: [joint_compliance(sites)], closed
    ):
        assert expected.any() and close(found, expected), key
