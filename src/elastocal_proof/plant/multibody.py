"""An arm as a MuJoCo model [1], and where it comes to rest.

Each drive is a commanded hinge and, in series, a hinge that springs; foot, bearings and
flange spring too, and elastic links are Timoshenko beams [2] lumped into segments.
Kinematics and forces are MuJoCo's; what springs yield is the plant's own law.

[1] Todorov, E., Erez, T. and Tassa, Y., MuJoCo: a physics engine for model-based control, IEEE/RSJ International Conference on
    Intelligent Robots and Systems, 2012.
[2] Timoshenko, S. P., On the correction for shear of the differential equation for transverse vibrations of prismatic bars,
    Philosophical Magazine 41, 1921.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal_proof.plant.arm import Arm, Link, LinkMass, to_rotation_matrix

# MuJoCo wants mass in each moving body; this weighs nothing beside a load of newtons.
_NOTHING = {
    "ipos": (0.0, 0.0, 0.0),
    "mass": 1e-12,
    "inertia": [1e-12] * 3,
    "explicitinertial": True,
}
_SWEEPS = 60
_POSES = 64
# Share of the largest torque below which a weight does not turn a joint.
_NO_TORQUE = 0.003
_SHORTEST_LINK_M = 0.1
# Of an elastic link.
SEGMENTS = 6
# Of the largest deflection: a hundredth of a picometre of millimetres.
_TOLERANCE = 1e-11
_NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TaperedTube:
    """An elastic link: a thin-walled tube that gets thinner towards its far end.

    E I, G J, E A and k G A at its near end; of the last two inf where it does not
    stretch or shear. `taper`: share of the diameter that is lost at the far end; E I
    and G J go with its third power, E A and k G A with itself.
    """

    bending_Nm2: float
    torsion_Nm2: float
    axial_N: float = np.inf
    shear_N: float = np.inf
    taper: float = 0.0


@dataclass(frozen=True)
class Structure:
    """Everything of an arm that its robot file does not declare. The default is an arm
    of drives alone.

    `base`: compliances of the foot along x, y, z (m/N) and about x, y, z (rad/(N m)).
    `flange`: the same between the last stretch and the flange, in the flange's frame.
    `bearings`: of a joint, from 1: compliances of its tilts across its axis, rad/(N m),
    in the order of the remaining axes, along which only a law lets it shift. `tubes`:
    elastic stretches. `payload`: its centre counts from the flange, in its frame.
    `compensator`: a coil spring from the carousel to the upper arm: its fixed and its
    moving end, m, from the shoulder, in the frames that turn with joints 1 and 2; its
    stiffness, N/m; its free length, m. `wrong`: by how much a stretch's vector (m) and
    its far end's rotation vector (rad) differ from the robot file. `gravity_m_s2`: in
    the axes of the base.
    """

    base: tuple[float, ...] = ()
    flange: tuple[float, ...] = ()
    bearings: dict[int, tuple[float, ...]] = field(default_factory=dict)
    tubes: dict[int, TaperedTube] = field(default_factory=dict)
    masses: tuple[LinkMass, ...] = ()
    payload: LinkMass | None = None
    compensator: tuple[tuple[float, ...], tuple[float, ...], float, float] | None = None
    wrong: dict[int, tuple[ArrayLike, ArrayLike]] = field(default_factory=dict)
    gravity_m_s2: tuple[float, ...] = (0.0, 0.0, -standard_gravity)


@dataclass(frozen=True)
class MultibodyModel:
    """A compiled model and where in it what is.

    `drive`, `gear` (n,) of int: coordinates that are commanded, and those that spring
    behind them. `springs`: structural coordinates by name, such as ``base_x``,
    ``tilt2_0``, ``link3_bend0_4``. `compliance` (coordinates,): of structural springs,
    m/N or rad/(N m); zero elsewhere. `sites` (points,) of int: measuring points, the
    flange last. `body_stretch`, `site_stretch` (bodies,), (all sites,) of int: of whose
    vector the place of each body and site is a part.
    """

    model: mujoco.MjModel
    drive: np.ndarray
    gear: np.ndarray
    springs: dict[str, int]
    compliance: np.ndarray
    sites: np.ndarray
    body_stretch: np.ndarray
    site_stretch: np.ndarray

    def forces(
        self,
        coordinates: np.ndarray,
        growth: np.ndarray,
        wrench: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Generalized forces of weight, compensator and a wrench on all coordinates,
        and where the measuring points are.

        `coordinates` (S, coordinates). `growth` (S, n + 1): relative growth of all
        lengths of each stretch. `wrench` (S, 6): at the flange, base axes. Returns
        `force` (S, coordinates), N m, N; `position`, `rotation` (S, points, 3), (S,
        points, 3, 3).
        """
        model, data, flange = self.model, mujoco.MjData(self.model), self.sites[-1]
        count = len(coordinates)
        body = model.site_bodyid[flange]
        force = np.empty((count, model.nv))
        weight = np.empty(model.nv)
        push = np.zeros(model.nv)
        position = np.empty((count, model.nsite, 3))
        rotation = np.empty((count, model.nsite, 9))
        bodies = model.body_pos.copy()
        sites = model.site_pos.copy()
        changed = np.any(np.diff(growth, axis=0, prepend=0.0), axis=1).tolist()
        # MuJoCo's own arrays, seen through views that follow each call.
        place = data.qpos
        points = data.site_xpos
        turns = data.site_xmat
        springs = data.qfrc_passive
        try:
            for state, row in enumerate(coordinates):
                if changed[state]:
                    model.body_pos[:] = bodies * (
                        1.0 + growth[state, self.body_stretch, None]
                    )
                    model.site_pos[:] = sites * (
                        1.0 + growth[state, self.site_stretch, None]
                    )
                place[:] = row
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_rne(model, data, 0, weight)
                if model.ntendon:
                    mujoco.mj_tendon(model, data)
                    mujoco.mj_passive(model, data)
                position[state] = points
                rotation[state] = turns
                if wrench is not None:
                    push[:] = 0.0
                    mujoco.mj_applyFT(
                        model,
                        data,
                        wrench[state, :3],
                        wrench[state, 3:],
                        points[flange],
                        body,
                        push,
                    )
                force[state] = push + springs - weight
        finally:
            model.body_pos[:] = bodies
            model.site_pos[:] = sites
        return (
            force,
            position[:, self.sites],
            rotation.reshape(count, -1, 3, 3)[:, self.sites],
        )


# Name, axis and compliance of a joint, None of one that is commanded or a gear, which
# has laws of its own; whether it slides.
_Joint = tuple[str, np.ndarray, float | None, bool]


# Mass, where along the vector of its stretch it is, and aside of that.
_Placed = tuple[float, float, np.ndarray]


class _Tree:
    """Bodies so far; the frame in which the next one is placed; the springs'
    compliances by name."""

    def __init__(self, structure: Structure) -> None:
        self.spec = mujoco.MjSpec()
        self.structure = structure
        self.spec.option.gravity = list(structure.gravity_m_s2)
        self.body = self.spec.worldbody
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        self.compliance: dict[str, float] = {}

    def descend(self, name: str, joints: Iterable[_Joint]) -> None:
        """New body at the current frame, with its joints."""
        turn = Rotation.from_matrix(self.rotation).as_quat(scalar_first=True)
        self.body = self.body.add_body(
            name=name, pos=self.position, quat=turn, **_NOTHING
        )
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        for word, axis, compliance, slides in joints:
            kind = (
                mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
            )
            self.body.add_joint(name=word, type=kind, axis=axis, armature=1.0)
            if compliance is not None:
                self.compliance[word] = compliance

    def weigh(self, mass: float, place: np.ndarray) -> None:
        """Put a mass on the current body, in its frame; masses add up at their common
        centre."""
        old = float(self.body.mass)
        self.body.ipos = (old * np.array(self.body.ipos) + mass * place) / (old + mass)
        self.body.mass = old + mass

    def mark(self, name: str, position: np.ndarray, rotation: np.ndarray) -> None:
        """A measuring point, in the frame of the current body."""
        self.body.add_site(
            name=name,
            pos=position,
            quat=Rotation.from_matrix(rotation).as_quat(scalar_first=True),
        )

    def walk(self, number: int, stretch: Link, elsewhere: str) -> None:
        """From the near to the far end of a stretch; one measuring point may be put
        elsewhere."""
        shift, turn = self.structure.wrong.get(number, (_NOWHERE, _NOWHERE))
        vector = stretch.vector_m + np.array(shift)
        turn = to_rotation_matrix(turn)
        tube = self.structure.tubes.get(number)
        masses = [
            _placed(mass, stretch.vector_m)
            for mass in self.structure.masses
            if mass.link == number
        ]
        start = self.position
        facing = self.rotation
        if tube is None:
            for mass_kg, along, aside in masses:
                self.weigh(mass_kg, start + facing @ (along * vector + aside))
            self.position = start + facing @ vector
        else:
            self.bend(f"link{number}_", vector, tube, masses)
            facing = np.eye(3)
        for name, (place, turns) in stretch.points.items():
            # What is wrong about a stretch is wrong at its far end.
            if np.allclose(place, stretch.vector_m, atol=1e-12):
                where = self.position
                turns = facing @ turns @ turn
            elif tube is None:
                where = start + facing @ place
                turns = facing @ turns
            else:
                raise InputError(
                    "structure",
                    f"tubes[{number}]",
                    f"[{name}] inside it",
                    "points at the end of a link",
                )
            if name != elsewhere:
                self.mark(name, where, turns)
        self.rotation = facing @ stretch.rotation @ turn

    def bend(
        self,
        name: str,
        vector: np.ndarray,
        tube: TaperedTube,
        masses: Iterable[_Placed],
    ) -> None:
        """Rigid pieces with springs at the middle of each: the midpoint rule for the
        integral of M / EI along the link."""
        along = vector / np.linalg.norm(vector)
        first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        first /= np.linalg.norm(first)
        second = np.cross(along, first)
        piece = float(np.linalg.norm(vector)) / SEGMENTS
        step = vector / SEGMENTS
        self.position = self.position + self.rotation @ (0.5 * step)
        for segment in range(SEGMENTS):
            middle = (segment + 0.5) / SEGMENTS
            width = 1.0 - tube.taper * middle
            springs = [
                ("shear0", first, tube.shear_N * width, True),
                ("shear1", second, tube.shear_N * width, True),
                ("axial", along, tube.axial_N * width, True),
                ("bend0", first, tube.bending_Nm2 * width**3, False),
                ("bend1", second, tube.bending_Nm2 * width**3, False),
                ("twist", along, tube.torsion_Nm2 * width**3, False),
            ]
            # What a rigid tube does not do but by a law of its bends needs no
            # coordinate.
            springs = [
                spring for spring in springs if np.isfinite(spring[2]) or not spring[3]
            ]
            joints = [
                (f"{name}{word}_{segment}", axis, piece / stiff, slides)
                for word, axis, stiff, slides in springs
            ]
            self.descend(f"{name}{segment}", joints)
            for mass_kg, share, aside in masses:
                # On the segment that holds its place; the body's origin is the middle
                # of the segment.
                if min(int(share * SEGMENTS), SEGMENTS - 1) == segment:
                    self.weigh(mass_kg, (share - middle) * vector + aside)
            self.position = step if segment < SEGMENTS - 1 else 0.5 * step


def _placed(mass: LinkMass, vector: np.ndarray) -> _Placed:
    centre = np.array(mass.centre_m)
    along = mass.along
    if along is None:
        along = (
            float(np.clip(centre @ vector / (vector @ vector), 0.0, 1.0))
            if vector.any()
            else 0.0
        )
    return mass.mass_kg, along, centre - along * vector


def _six_springs(name: str, compliances: Iterable[float]) -> list[_Joint]:
    """Along and about x, y and z."""
    words = [f"{name}_{turns}{axis}" for turns in ("", "r") for axis in "xyz"]
    return [
        (words[k], np.eye(3)[k % 3], compliance, k < 3)
        for k, compliance in enumerate(compliances)
    ]


def build_model(arm: Arm, structure: Structure) -> MultibodyModel:
    """Build the model of an arm."""
    tree = _Tree(structure)
    tree.descend("foot", _six_springs("base", structure.base))
    for number, stretch in enumerate(arm.stretches, 1):
        tree.walk(number - 1, stretch, arm.points[-1] if structure.flange else "")
        if number <= arm.joints:
            axis = arm.axes[number - 1]
            across = [e for e in np.eye(3) if abs(e @ axis) < 0.5]
            tilts = structure.bearings.get(number, ())
            joints: list[_Joint] = [
                (f"{name}{number}", axis, None, False) for name in ("drive", "gear")
            ]
            joints += [
                (f"shift{number}_{which}", across[which], 0.0, True)
                for which in range(len(tilts))
            ]
            joints += [
                (f"tilt{number}_{which}", across[which], tilt, False)
                for which, tilt in enumerate(tilts)
            ]
            tree.descend(f"arm{number}", joints)
    if structure.flange:
        tree.descend("flange", _six_springs("flange", structure.flange))
        tree.mark(arm.points[-1], np.zeros(3), np.eye(3))
    if load := structure.payload:
        tree.weigh(
            load.mass_kg, tree.position + tree.rotation @ np.array(load.centre_m)
        )
    if structure.compensator:
        # From the body before the shoulder's drive to the body behind it.
        fixed, moving, stiffness, length = structure.compensator
        anchor = arm.stretches[1].vector_m + arm.stretches[1].rotation @ np.array(fixed)
        tendon = tree.spec.add_tendon(
            name="compensator",
            stiffness=[stiffness, 0.0, 0.0],
            springlength=[length] * 2,
        )
        for body, name, place in (
            ("arm1", "anchor", anchor),
            ("arm2", "crank", moving),
        ):
            tree.spec.body(body).add_site(name=name, pos=place)
            tendon.wrap_site(name)
    model = tree.spec.compile()
    at = {model.joint(j).name: int(model.jnt_qposadr[j]) for j in range(model.njnt)}
    drive, gear = (
        np.array([at[f"{name}{j + 1}"] for j in range(arm.joints)])
        for name in ("drive", "gear")
    )
    springs = {name: at[name] for name in tree.compliance}
    sites = np.array([model.site(name).id for name in arm.points])
    yields = np.zeros(model.nq)
    yields[[*springs.values()]] = [*tree.compliance.values()]
    # A body behind a drive is placed by the stretch before it.
    behind_drive = np.array(
        [model.body(number).name.startswith("arm") for number in range(model.nbody)],
        int,
    )
    within = behind_drive.cumsum()
    return MultibodyModel(
        model,
        drive,
        gear,
        springs,
        yields,
        sites,
        within - behind_drive,
        within[model.site_bodyid],
    )


# Coordinates (S, coordinates), rad, m; generalized forces that their springs transmit,
# the same, N m, N; positions, m, and rotations of the measuring points, (S, points, 3),
# (S, points, 3, 3), base frame.
Equilibrium = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def solve_equilibrium(
    machine: MultibodyModel,
    drive: np.ndarray,
    felt: Callable[[np.ndarray], np.ndarray],
    growth: np.ndarray,
    gear_deflection: Callable[[np.ndarray, np.ndarray], np.ndarray],
    laws: Iterable[tuple[str, Callable[[np.ndarray], np.ndarray]]] = (),
    start: np.ndarray | None = None,
) -> Equilibrium:
    """Where the arm comes to rest in S states, by fixed-point iteration.

    `drive` (S, n): angles at which the drives really stand, rad. `felt`: wrench (S, 6)
    that the flange really feels, at its deflected origin, base axes, N, N m, by its
    rotations (S, 3, 3) before anything yields. `growth` (S, n + 1): relative growth of
    all lengths of each stretch. `gear_deflection`: of the torques on the gears now and
    before the wrench came on, (S, n), N m: their deflections (S, n), rad. `laws`:
    starts of the names of structural springs, and what they yield beyond their
    compliance under a force (S,). `start` (S, n): deflections of the gears to begin
    with, such as those of a robot that differs little.

    The forces depend on the deflections only through the geometry, by the share (force
    times arm) / stiffness, a thousandth or so, so that each sweep gains about three
    digits. With linear springs it is the modified Newton method with their stiffness as
    tangent. Raises `RuntimeError` where the iteration does not settle to 1e-11 of the
    largest deflection.
    """
    gear = machine.gear
    beyond = [
        (index, law)
        for start, law in laws
        for name, index in machine.springs.items()
        if name.startswith(start)
    ]
    coordinates = np.zeros((len(drive), machine.model.nq))
    coordinates[:, machine.drive] = drive
    unloaded, _, facing = machine.forces(coordinates, growth)
    unloaded = unloaded[:, gear]
    wrench = felt(facing[:, -1])
    if start is not None:
        coordinates[:, gear] = start
    for _ in range(_SWEEPS):
        force, position, rotation = machine.forces(coordinates, growth, wrench)
        following = force * machine.compliance
        following[:, machine.drive] = drive
        following[:, gear] = gear_deflection(force[:, gear], unloaded)
        for index, law in beyond:
            following[:, index] += law(force[:, index])
        change = np.abs(following - coordinates)
        size = np.abs(following)
        change[:, machine.drive] = size[:, machine.drive] = 0.0
        # The poses are those of `coordinates`; once the next would be the same they
        # need no further sweep.
        if change.max(initial=0.0) <= _TOLERANCE * max(size.max(initial=0.0), 1e-9):
            return coordinates, force, position, rotation
        coordinates = following
    raise RuntimeError(
        f"no equilibrium after {_SWEEPS} sweeps: the last moved by {change.max():.3g}"
    )


def compute_typical_gravity_torque(
    arm: Arm, masses: Iterable[LinkMass], gravity_m_s2: tuple[float, ...]
) -> np.ndarray:
    """Root mean square torque of the links' weight on each drive over the arm's range
    of angles, (n,), N m."""
    low, high = arm.limits.T
    machine = build_model(
        arm, Structure(masses=tuple(masses), gravity_m_s2=gravity_m_s2)
    )
    coordinates = np.zeros((_POSES, machine.model.nq))
    # The same poses for all, of no campaign.
    coordinates[:, machine.drive] = low + (high - low) * np.random.default_rng(
        0
    ).random((_POSES, arm.joints))
    torque = machine.forces(coordinates, np.zeros((_POSES, arm.joints + 1)))[0][
        :, machine.gear
    ]
    return np.sqrt((torque**2).mean(axis=0))


def list_flexible_links(arm: Arm) -> list[tuple[int, ...]]:
    """Links, each by the joint before it, from 1, that are long enough to bend."""
    return [
        (link,)
        for link in range(1, arm.joints + 1)
        if arm.lengths_m[link] > _SHORTEST_LINK_M
    ]


def find_distinguishable_weights(arm: Arm) -> dict[tuple[int, ...], int | None]:
    """The upper arm, the forearm, and None for all links, by the joints, from 1, that
    they turn on an upright arm."""

    def turned_by(*masses: LinkMass) -> tuple[int, ...]:
        torque = compute_typical_gravity_torque(
            arm, masses, (0.0, 0.0, -standard_gravity)
        )
        return tuple(
            int(joint) + 1
            for joint in np.flatnonzero(torque > _NO_TORQUE * torque.max())
        )

    found: dict[tuple[int, ...], int | None] = {}
    for (link,) in list_flexible_links(arm):
        joints = turned_by(
            LinkMass(link, 1.0, tuple(0.5 * arm.stretches[link].vector_m))
        )
        # Of links that turn the same joints the first counts, and of all links two: the
        # hand's weight is like a tool's.
        if joints and joints[-1] == link and len(found) < 2:
            found[joints] = link
    found.setdefault(turned_by(*arm.masses), None)
    return found
