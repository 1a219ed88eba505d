"""Closed forms of effects: the displacement of every measuring point, by pinocchio.

A closed form is a function ``closed(arm, law, name, *shapes)`` of an `Arm`, a candidate,
the name of one of its parameters and one value of each of its shapes. It returns the
displacement of each measuring point per unit of the parameter, ndarray (S, P, 6): shift
and rotation in base axes.
"""

from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from support import OTHER_CHAINS, TRACK, PinocchioPoint, chain_of
from synthetic import displacements, equipped, make_states

from elastocal.campaigns.reading import read_robot
from elastocal.effects.conditions import build_conditions
from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import compute_poses_and_jacobians
from elastocal.mechanics.robot import Mass

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"
CHAINS = {"fanuc": None, "track": TRACK} | {
    name: OTHER_CHAINS[name] for name in ("fixed rotations", "seven joints", "ur10")
}
STATES = 4
# Gravity on a robot that is mounted at an angle.
GRAVITY = (3.0, -4.0, -8.0)
# Links shorter than this count as rigid.
LONG_M = 0.05
# Declared masses of a robot.
MASSES = (Mass(2, 40.0, (0.1, -0.02, 0.3), 0.1), Mass(3, 15.0, (-0.05, 0.1, 0.02), 0.1))
# Kinds of arms: under random loads, pulled by a cable, and with declared masses.
PLAIN = "plain"
PULLED = "pulled"
WEIGHED = "weighed"


class Arm:
    """A robot in some states under loads, computed by pinocchio on its own chain.

    Vectors are in base axes, ndarrays (S, ...).
    """

    def __init__(self, chain, *, pulled):
        self.chain, self.joints = chain, chain.coordinates
        # Loads range from the backlash of a gear to beyond the knee of every gear.
        self.states = make_states(self.joints, STATES, seed=1, force=1.0)
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
        """Number of transforms before each joint."""
        return [
            index
            for index, t in enumerate(self.chain.transforms)
            if t.coordinate is not None
        ]

    def far_end(self, link):
        """Number of transforms before the far end of a link; link 0 is the column."""
        return [*self.places, self.end][link]

    def frame(self, after):
        """Position, rotation and Jacobian behind a number of transforms."""
        if after not in self._frames:
            point = PinocchioPoint(self.chain, MeasuringPoint("frame", after))
            frames = [
                point.pose_and_jacobian(angles) for angles in self.states.joint_angles
            ]
            self._frames[after] = [
                np.array(values) for values in zip(*frames, strict=True)
            ]
        return self._frames[after]

    def load(self, after):
        """Force and moment of the load at a frame."""
        force, moment = np.split(self.states.wrench, 2, axis=1)
        return force, moment + np.cross(
            self.frame(self.end)[0] - self.frame(after)[0], force
        )

    @property
    def torque(self):
        return self.under(self.states.wrench) / self.compliance

    def under(self, wrench):
        """Rotations of the joints under a wrench at the end."""
        return (
            np.einsum("srj,sr->sj", self.frame(self.end)[2], wrench) * self.compliance
        )

    def turned(self, turns):
        """Displacement of each measuring point by joint deviations, ndarray (S, P,
        6)."""
        return np.stack(
            [
                np.einsum("srj,sj->sr", self.frame(point.after)[2], turns)
                for point in self.chain.points
            ],
            axis=1,
        )

    def of_joint(self, joint, amount):
        """Displacement of each measuring point by one joint, counted from 1."""
        return self.turned(np.asarray(amount)[:, None] * np.eye(self.joints)[joint - 1])

    def moved(self, after, shift, turn, first=None):
        """Displacement of each measuring point if the arm behind a frame shifts and
        rotates there; points from `first` transforms on are behind it."""
        origin = self.frame(after)[0]
        twists = np.zeros((STATES, len(self.chain.points), 6))
        for number, point in enumerate(self.chain.points):
            if point.after >= (after if first is None else first):
                carried = np.cross(turn, self.frame(point.after)[0] - origin)
                twists[:, number] = np.concatenate(
                    [shift + carried, np.broadcast_to(turn, (STATES, 3))], axis=1
                )
        return twists

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
    """Harmonic of an angle by its name, such as cos_3q."""
    kind, order = name.split("_")
    return {"cos": np.cos, "sin": np.sin}[kind](
        int(order.removesuffix("q") or 1) * angle
    )


def joint_angle(arm, law):
    return arm.states.joint_angles[:, law.joints[0] - 1]


def of_the_joint(amount):
    """Make a closed form that moves the candidate's joint by `amount(arm, law, name,
    *shapes)`."""
    return lambda arm, law, name, *shapes: arm.of_joint(
        law.joints[0], amount(arm, law, name, *shapes)
    )


def six(arm, after, axes, name, amount, first=None):
    """Shift or rotate the arm behind a frame along one of the axes (S, 3, 3), which the
    name of the parameter states: dx, ry, shift_x or turn_x."""
    along = axes[..., "xyz".index(name[-1])] * np.broadcast_to(amount, STATES)[:, None]
    zero = np.zeros((STATES, 3))
    turns = name[0] == "r" or name.startswith("turn")
    return arm.moved(after, zero if turns else along, along if turns else zero, first)


@cache
def arm_on(chain_name, kind):
    """An arm, its conditions, and the Jacobian (S, P, 6, C) of its measuring points
    with respect to all coordinates of its sites."""
    text = CHAINS[chain_name]
    chain = read_robot(ROBOTS / "fanuc.yaml").chain if text is None else chain_of(text)
    arm = Arm(chain, pulled=kind == PULLED)
    masses = MASSES if kind == WEIGHED else ()
    sites = replace(equipped(chain), masses=masses, gravity_m_s2=GRAVITY)
    coordinates = np.zeros((STATES, sites.chain.coordinates))
    coordinates[:, : arm.joints] = arm.states.joint_angles
    points = [replace(point, offset_m=(0.0, 0.0, 0.0)) for point in sites.chain.points]
    jacobians = [
        compute_poses_and_jacobians(sites.chain, coordinates, point)[2]
        for point in points
    ]
    conditions = build_conditions(sites, arm.compliance, arm.states)
    return arm, conditions, np.stack(jacobians, axis=1)


def check_closed_form(list_candidates, closed, chain_name):
    """Compare the displacements of all candidates on a chain with their closed form.

    `list_candidates(sites)` lists the candidates, as `Effect.candidates` does.
    """
    kind = PLAIN if list_candidates(arm_on(chain_name, PLAIN)[1].sites) else WEIGHED
    for law in list_candidates(arm_on(chain_name, kind)[1].sites):
        in_the_pull = law.detail.endswith("in the pull")
        arm, conditions, jacobian = arm_on(chain_name, PULLED if in_the_pull else kind)
        for shapes in values_of_shapes(law):
            laws = displacements(law, conditions, *shapes)
            for parameter, displacement in zip(law.parameters, laws, strict=True):
                computed = np.einsum("sprc,sc->spr", jacobian, displacement)
                expected = closed(arm, law, parameter.name, *shapes)
                name = f"{law.key} {parameter.name}"
                scale = np.abs(expected).max()
                np.testing.assert_allclose(
                    computed, expected, rtol=0, atol=1e-7 * scale + 1e-14, err_msg=name
                )
                # On an industrial arm every effect displaces some point.
                assert chain_name != "fanuc" or expected.any(), name


def values_of_shapes(law):
    """Return the starts of the shape parameters and, if there are any, the values at a
    quarter of their ranges."""
    starts = [shape.start for shape in law.shapes]
    quarters = [
        shape.lowest + (shape.highest - shape.lowest) / 4 for shape in law.shapes
    ]
    return [starts, quarters] if law.shapes else [starts]
