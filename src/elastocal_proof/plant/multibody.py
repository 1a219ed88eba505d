"""Build an arm as a MuJoCo model [1]_ and find where it comes to rest.

Each drive is a commanded hinge in series with an elastic one, its gear. The foot, the
bearings and the flange are elastic too, and elastic links are Timoshenko beams [2]_
lumped into segments. MuJoCo computes kinematics and forces; how far a spring yields is
the simulation's own law.

References
----------
.. [1] Todorov, E., Erez, T. and Tassa, Y., MuJoCo: a physics engine for model-based
   control, IEEE/RSJ International Conference on Intelligent Robots and Systems, 2012.
.. [2] Timoshenko, S. P., On the correction for shear of the differential equation for
   transverse vibrations of prismatic bars, Philosophical Magazine 41, 1921.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError
from elastocal_proof.plant.arm import Arm, Link, LinkMass, to_rotation_matrix

# MuJoCo wants a mass in each moving body. This one is negligible against forces of some
# newtons.
_MASSLESS = {
    "ipos": (0.0, 0.0, 0.0),
    "mass": 1e-12,
    "inertia": [1e-12] * 3,
    "explicitinertial": True,
}
# Upper bound on the sweeps of the fixed-point iteration, and its tolerance relative to
# the largest deflection: a hundredth of a picometre of some millimetres.
_MAX_SWEEPS = 60
_TOLERANCE = 1e-11
# Number of poses over which the typical gravity torque is averaged.
_TYPICAL_POSES = 64
# A weight does not load a joint if its torque is below this share of the largest one.
_MIN_TORQUE_SHARE = 0.003
# Shorter links do not bend.
_MIN_FLEXIBLE_LENGTH_M = 0.1
# Number of segments of an elastic link.
SEGMENTS = 6
_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TaperedTube:
    """An elastic link: a thin-walled tube that gets thinner towards its far end.

    Attributes
    ----------
    bending_Nm2, torsion_Nm2, axial_N, shear_N
        E I, G J, E A and k G A at its near end; the last two are infinite if the tube
        does not stretch or shear.
    taper
        Share of the diameter that is lost at the far end. E I and G J are proportional
        to the third power of the diameter, E A and k G A to the diameter.
    """

    bending_Nm2: float
    torsion_Nm2: float
    axial_N: float = np.inf
    shear_N: float = np.inf
    taper: float = 0.0


@dataclass(frozen=True)
class Structure:
    """Properties of an arm that its robot file does not declare.

    The default is rigid and massless apart from its gears.

    Attributes
    ----------
    base
        Compliances of the foot along x, y, z (m/N) and about x, y, z (rad/(N m)).
    flange
        The same between the last link and the flange, in the flange's frame.
    bearings
        By joint, from 1: compliances of its tilts about the two axes across its own,
        rad/(N m), in the order of these axes. Only a defect lets a bearing shift along
        them.
    tubes
        Elastic links by number.
    masses
        True masses of the links.
    payload
        Its centre counts from the flange, in the flange's frame.
    compensator
        A coil spring from the carousel to the upper arm: its fixed and its moving end,
        m, from the shoulder, in the frames that turn with joints 1 and 2; its
        stiffness, N/m; its free length, m.
    geometry_errors
        By link: differences from the robot file of its vector, m, and of the rotation
        vector at its far end, rad.
    gravity_m_s2
        In the axes of the base.
    """

    base: tuple[float, ...] = ()
    flange: tuple[float, ...] = ()
    bearings: dict[int, tuple[float, ...]] = field(default_factory=dict)
    tubes: dict[int, TaperedTube] = field(default_factory=dict)
    masses: tuple[LinkMass, ...] = ()
    payload: LinkMass | None = None
    compensator: tuple[tuple[float, ...], tuple[float, ...], float, float] | None = None
    geometry_errors: dict[int, tuple[ArrayLike, ArrayLike]] = field(
        default_factory=dict
    )
    gravity_m_s2: tuple[float, ...] = (0.0, 0.0, -standard_gravity)


@dataclass(frozen=True)
class MultibodyModel:
    """A compiled MuJoCo model of an arm of n joints, and indices into it.

    Attributes
    ----------
    model : MjModel
    drive, gear : (n,) int arrays
        Coordinates that are commanded, and elastic ones behind them.
    springs : dict
        Structural coordinates by name, such as ``base_x``, ``tilt2_0`` or
        ``link3_bend0_4``.
    compliance : (coordinates,) array
        Of structural springs, m/N or rad/(N m); zero for other coordinates.
    sites : (points,) int array
        Measuring points, the flange last.
    body_link, site_link : (bodies,) and (sites,) int arrays
        Number of the link along whose vector the body or site lies.
    """

    model: mujoco.MjModel
    drive: np.ndarray
    gear: np.ndarray
    springs: dict[str, int]
    compliance: np.ndarray
    sites: np.ndarray
    body_link: np.ndarray
    site_link: np.ndarray

    def compute_forces(
        self,
        coordinates: np.ndarray,
        growth: np.ndarray,
        wrench: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute generalized forces of S states, and poses of the measuring points.

        Parameters
        ----------
        coordinates : (S, coordinates) array
        growth : (S, n + 1) array
            Relative growth of all lengths of each link.
        wrench : (S, 6) array, optional
            External load at the flange, base axes, N and N m.

        Returns
        -------
        force : (S, coordinates) array
            Sum of weight, compensator and wrench on each coordinate, N or N m.
        position, rotation : (S, points, 3) and (S, points, 3, 3) arrays
            Measuring points, m, base frame.
        """
        model = self.model
        data = mujoco.MjData(model)
        flange = self.sites[-1]
        flange_body = model.site_bodyid[flange]
        force = np.zeros((len(coordinates), model.nv))
        weight = np.empty(model.nv)
        position = np.empty((len(coordinates), model.nsite, 3))
        rotation = np.empty((len(coordinates), model.nsite, 9))
        body_pos = model.body_pos.copy()
        site_pos = model.site_pos.copy()
        grows = np.any(np.diff(growth, axis=0, prepend=0.0), axis=1).tolist()
        try:
            for state, (row, load) in enumerate(zip(coordinates, force, strict=True)):
                if grows[state]:
                    scale = 1.0 + growth[state]
                    model.body_pos[:] = body_pos * scale[self.body_link, None]
                    model.site_pos[:] = site_pos * scale[self.site_link, None]
                data.qpos[:] = row
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_rne(model, data, 0, weight)
                position[state] = data.site_xpos
                rotation[state] = data.site_xmat
                if wrench is not None:
                    mujoco.mj_applyFT(
                        model,
                        data,
                        wrench[state, :3],
                        wrench[state, 3:],
                        position[state, flange],
                        flange_body,
                        load,
                    )
                if model.ntendon:
                    mujoco.mj_tendon(model, data)
                    mujoco.mj_passive(model, data)
                    load += data.qfrc_passive
                load -= weight
        finally:
            model.body_pos[:] = body_pos
            model.site_pos[:] = site_pos
        rotation = rotation.reshape(len(coordinates), -1, 3, 3)
        return force, position[:, self.sites], rotation[:, self.sites]


class _Joint(NamedTuple):
    """A coordinate of the model. Drives and gears have no compliance, because their
    deflections follow laws of their own."""

    name: str
    axis: np.ndarray
    compliance: float | None = None
    slides: bool = False


class _PlacedMass(NamedTuple):
    """A mass at a share `along` the vector of its link, and at `aside` (3,) of it."""

    mass_kg: float
    along: float
    aside: np.ndarray


class _ModelBuilder:
    """Chain of bodies that grows from the foot to the flange.

    `body` is the last one; `position` and `rotation` are the frame, in this body, in
    which the next one is placed; `compliance` collects the springs by name.
    """

    def __init__(self, structure: Structure) -> None:
        self.spec = mujoco.MjSpec()
        self.structure = structure
        self.spec.option.gravity = list(structure.gravity_m_s2)
        self.body = self.spec.worldbody
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        self.compliance: dict[str, float] = {}

    def add_body(self, name: str, joints: Iterable[_Joint]) -> None:
        """Add a body at the current frame, with its joints."""
        quaternion = Rotation.from_matrix(self.rotation).as_quat(scalar_first=True)
        self.body = self.body.add_body(
            name=name, pos=self.position, quat=quaternion, **_MASSLESS
        )
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        hinge = mujoco.mjtJoint.mjJNT_HINGE
        for joint in joints:
            kind = slide if joint.slides else hinge
            self.body.add_joint(
                name=joint.name, type=kind, axis=joint.axis, armature=1.0
            )
            if joint.compliance is not None:
                self.compliance[joint.name] = joint.compliance

    def add_mass(self, mass_kg: float, position: np.ndarray) -> None:
        """Add a mass to the current body, in its frame, at the common centre."""
        old_kg = float(self.body.mass)
        moment = old_kg * np.array(self.body.ipos) + mass_kg * position
        self.body.ipos = moment / (old_kg + mass_kg)
        self.body.mass = old_kg + mass_kg

    def add_point(self, name: str, position: np.ndarray, rotation: np.ndarray) -> None:
        """Add a measuring point, in the frame of the current body."""
        quaternion = Rotation.from_matrix(rotation).as_quat(scalar_first=True)
        self.body.add_site(name=name, pos=position, quat=quaternion)

    def add_link(self, number: int, link: Link, skipped_point: str) -> None:
        """Add a link, from its near to its far end, without one measuring point."""
        shift, turn = self.structure.geometry_errors.get(number, (_ZERO, _ZERO))
        vector = link.vector_m + np.array(shift)
        turn = to_rotation_matrix(turn)
        tube = self.structure.tubes.get(number)
        masses = [
            _place_mass(mass, link.vector_m)
            for mass in self.structure.masses
            if mass.link == number
        ]
        start = self.position
        frame = self.rotation
        if tube is None:
            for mass_kg, along, aside in masses:
                self.add_mass(mass_kg, start + frame @ (along * vector + aside))
            self.position = start + frame @ vector
        else:
            self._add_segments(f"link{number}_", vector, tube, masses)
            frame = np.eye(3)
        for name, (position, rotation) in link.points.items():
            rotation = frame @ rotation
            # Geometry errors of a link act at its far end only.
            if np.allclose(position, link.vector_m, atol=1e-12):
                position = self.position
                rotation = rotation @ turn
            elif tube is None:
                position = start + frame @ position
            else:
                raise InputError(
                    "structure",
                    f"tubes[{number}]",
                    f"[{name}] inside it",
                    "points at the end of a link",
                )
            if name != skipped_point:
                self.add_point(name, position, rotation)
        self.rotation = frame @ link.rotation @ turn

    def _add_segments(
        self,
        name: str,
        vector: np.ndarray,
        tube: TaperedTube,
        masses: Sequence[_PlacedMass],
    ) -> None:
        """Add rigid segments with springs at the middle of each: the midpoint rule for
        the integral of M / EI along the link."""
        axis = vector / np.linalg.norm(vector)
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        second = np.cross(axis, first)
        length = float(np.linalg.norm(vector)) / SEGMENTS
        step = vector / SEGMENTS
        self.position = self.position + self.rotation @ (0.5 * step)
        for segment in range(SEGMENTS):
            middle = (segment + 0.5) / SEGMENTS
            width = 1.0 - tube.taper * middle
            springs = [
                ("bend0", first, tube.bending_Nm2 * width**3, False),
                ("bend1", second, tube.bending_Nm2 * width**3, False),
                ("twist", axis, tube.torsion_Nm2 * width**3, False),
            ]
            # A defect may bend a rigid tube, but never shear or stretch it.
            if np.isfinite(tube.axial_N):
                springs = [("axial", axis, tube.axial_N * width, True), *springs]
            if np.isfinite(tube.shear_N):
                shear = tube.shear_N * width
                springs = [
                    ("shear0", first, shear, True),
                    ("shear1", second, shear, True),
                    *springs,
                ]
            joints = [
                _Joint(f"{name}{motion}_{segment}", along, length / stiffness, slides)
                for motion, along, stiffness, slides in springs
            ]
            self.add_body(f"{name}{segment}", joints)
            for mass_kg, along, aside in masses:
                # The body's origin is the middle of the segment.
                if min(int(along * SEGMENTS), SEGMENTS - 1) == segment:
                    self.add_mass(mass_kg, (along - middle) * vector + aside)
            self.position = step if segment < SEGMENTS - 1 else 0.5 * step

    def add_compensator(self, shoulder_link: Link) -> None:
        """Add the coil spring between the bodies before and behind the shoulder."""
        if self.structure.compensator is None:
            return
        fixed, moving, stiffness, length = self.structure.compensator
        anchor = shoulder_link.vector_m + shoulder_link.rotation @ np.array(fixed)
        tendon = self.spec.add_tendon(
            name="compensator",
            stiffness=[stiffness, 0.0, 0.0],
            springlength=[length] * 2,
        )
        self.spec.body("arm1").add_site(name="anchor", pos=anchor)
        self.spec.body("arm2").add_site(name="crank", pos=moving)
        tendon.wrap_site("anchor")
        tendon.wrap_site("crank")


def _place_mass(mass: LinkMass, vector: np.ndarray) -> _PlacedMass:
    centre = np.array(mass.centre_m)
    along = mass.along
    if along is None:
        along = 0.0
        if vector.any():
            along = float(np.clip(centre @ vector / (vector @ vector), 0.0, 1.0))
    return _PlacedMass(mass.mass_kg, along, centre - along * vector)


def _list_six_springs(name: str, compliances: Iterable[float]) -> list[_Joint]:
    """Springs along and about x, y and z."""
    motions = ("x", "y", "z", "rx", "ry", "rz")
    return [
        _Joint(f"{name}_{motions[k]}", np.eye(3)[k % 3], compliance, k < 3)
        for k, compliance in enumerate(compliances)
    ]


def _list_drive_joints(
    joint: int, axis: np.ndarray, tilts: tuple[float, ...]
) -> list[_Joint]:
    """Drive, gear, and the bearing's shifts and tilts across the axis, if it has any."""
    across = [unit for unit in np.eye(3) if abs(unit @ axis) < 0.5]
    shifts = [
        _Joint(f"shift{joint}_{k}", across[k], 0.0, slides=True)
        for k in range(len(tilts))
    ]
    return [
        _Joint(f"drive{joint}", axis),
        _Joint(f"gear{joint}", axis),
        *shifts,
        *(_Joint(f"tilt{joint}_{k}", across[k], tilt) for k, tilt in enumerate(tilts)),
    ]


def build_model(arm: Arm, structure: Structure) -> MultibodyModel:
    """Build and compile the MuJoCo model of an arm."""
    builder = _ModelBuilder(structure)
    builder.add_body("foot", _list_six_springs("base", structure.base))
    # An elastic flange carries the last measuring point on a body of its own.
    elastic_point = arm.points[-1] if structure.flange else ""
    builder.add_link(0, arm.links[0], elastic_point)
    for joint in range(1, arm.joints + 1):
        tilts = structure.bearings.get(joint, ())
        builder.add_body(
            f"arm{joint}", _list_drive_joints(joint, arm.axes[joint - 1], tilts)
        )
        builder.add_link(joint, arm.links[joint], elastic_point)
    if structure.flange:
        builder.add_body("flange", _list_six_springs("flange", structure.flange))
        builder.add_point(elastic_point, np.zeros(3), np.eye(3))
    if payload := structure.payload:
        centre = builder.rotation @ np.array(payload.centre_m)
        builder.add_mass(payload.mass_kg, builder.position + centre)
    builder.add_compensator(arm.links[1])
    model = builder.spec.compile()
    coordinate_of = {
        model.joint(joint).name: int(model.jnt_qposadr[joint])
        for joint in range(model.njnt)
    }
    springs = {name: coordinate_of[name] for name in builder.compliance}
    compliance = np.zeros(model.nq)
    compliance[[*springs.values()]] = [*builder.compliance.values()]
    # A body behind a drive is placed by the vector of the link before it.
    behind_drive = np.array(
        [model.body(number).name.startswith("arm") for number in range(model.nbody)],
        int,
    )
    link_of_body = behind_drive.cumsum()
    joints = range(1, arm.joints + 1)
    return MultibodyModel(
        model=model,
        drive=np.array([coordinate_of[f"drive{joint}"] for joint in joints]),
        gear=np.array([coordinate_of[f"gear{joint}"] for joint in joints]),
        springs=springs,
        compliance=compliance,
        sites=np.array([model.site(name).id for name in arm.points]),
        body_link=link_of_body - behind_drive,
        site_link=link_of_body[model.site_bodyid],
    )


@dataclass(frozen=True)
class EquilibriumProblem:
    """What determines where an arm of n joints comes to rest in S states.

    Attributes
    ----------
    drive : (S, n) array
        True angles of the drives, rad.
    growth : (S, n + 1) array
        Relative growth of all lengths of each link.
    applied_wrench : callable
        Wrench (S, 6) on the flange at its deflected origin, base axes, N and N m, from
        the flange's rotations (S, 3, 3) before anything yields.
    gear_deflection : callable
        Deflections (S, n) of the gears, rad, from the torques (S, n) on them now and
        before the wrench was applied, N m.
    spring_laws : sequence
        First letters of the names of structural springs, and how far these yield
        beyond their compliance under a force (S,).
    """

    drive: np.ndarray
    growth: np.ndarray
    applied_wrench: Callable[[np.ndarray], np.ndarray]
    gear_deflection: Callable[[np.ndarray, np.ndarray], np.ndarray]
    spring_laws: Sequence[tuple[str, Callable[[np.ndarray], np.ndarray]]] = ()


class Equilibrium(NamedTuple):
    """Arm at rest in S states.

    Attributes
    ----------
    coordinates : (S, coordinates) array
        In rad and m.
    force : (S, coordinates) array
        Generalized forces that the springs transmit, N m and N.
    position, rotation : (S, points, 3) and (S, points, 3, 3) arrays
        Measuring points, m, base frame.
    """

    coordinates: np.ndarray
    force: np.ndarray
    position: np.ndarray
    rotation: np.ndarray


def solve_equilibrium(
    model: MultibodyModel, problem: EquilibriumProblem, start: np.ndarray | None = None
) -> Equilibrium:
    """Find by fixed-point iteration where the arm comes to rest.

    The forces depend on the deflections only through the geometry, by the ratio (force
    times arm) / stiffness. It is about a thousandth, so each sweep gains about three
    digits. With linear springs this is the modified Newton method with their stiffness
    as tangent.

    Parameters
    ----------
    model, problem
        The arm, its drives and loads.
    start : (S, n) array, optional
        First guess of the gears' deflections, such as those of a similar robot.

    Raises
    ------
    RuntimeError
        If the iteration does not settle to 1e-11 of the largest deflection.
    """
    drive = model.drive
    gear = model.gear
    spring_laws = [
        (index, law)
        for prefix, law in problem.spring_laws
        for name, index in model.springs.items()
        if name.startswith(prefix)
    ]
    coordinates = np.zeros((len(problem.drive), model.model.nq))
    coordinates[:, drive] = problem.drive
    unloaded, _, rotation = model.compute_forces(coordinates, problem.growth)
    wrench = problem.applied_wrench(rotation[:, -1])
    if start is not None:
        coordinates[:, gear] = start
    for _ in range(_MAX_SWEEPS):
        force, position, rotation = model.compute_forces(
            coordinates, problem.growth, wrench
        )
        updated = force * model.compliance
        updated[:, drive] = problem.drive
        updated[:, gear] = problem.gear_deflection(force[:, gear], unloaded[:, gear])
        for index, law in spring_laws:
            updated[:, index] += law(force[:, index])
        change = np.delete(np.abs(updated - coordinates), drive, axis=1)
        deflection = np.delete(np.abs(updated), drive, axis=1).max(initial=0.0)
        # The poses belong to the old coordinates, which are as good as the new ones
        # once the iteration has settled.
        if change.max(initial=0.0) <= _TOLERANCE * max(deflection, 1e-9):
            return Equilibrium(coordinates, force, position, rotation)
        coordinates = updated
    raise RuntimeError(
        f"no equilibrium after {_MAX_SWEEPS} sweeps: the last moved by"
        f" {change.max():.3g}"
    )


def compute_typical_gravity_torque(
    arm: Arm, masses: Iterable[LinkMass], gravity_m_s2: tuple[float, ...]
) -> np.ndarray:
    """Compute the root mean square gravity torque on each drive, (n,), N m, over the
    arm's range of angles."""
    structure = Structure(masses=tuple(masses), gravity_m_s2=gravity_m_s2)
    model = build_model(arm, structure)
    # A fixed seed, so that all campaigns refer to the same poses and none uses them.
    shares = np.random.default_rng(0).random((_TYPICAL_POSES, arm.joints))
    low, high = arm.limits.T
    coordinates = np.zeros((_TYPICAL_POSES, model.model.nq))
    coordinates[:, model.drive] = low + (high - low) * shares
    growth = np.zeros((_TYPICAL_POSES, arm.joints + 1))
    torque = model.compute_forces(coordinates, growth)[0][:, model.gear]
    return np.sqrt((torque**2).mean(axis=0))


def list_flexible_links(arm: Arm) -> list[tuple[int, ...]]:
    """List the links, each by the joint before it, from 1, that are long enough to
    bend."""
    return [
        (link,)
        for link in range(1, arm.joints + 1)
        if arm.lengths_m[link] > _MIN_FLEXIBLE_LENGTH_M
    ]


def find_distinguishable_weights(arm: Arm) -> dict[tuple[int, ...], int | None]:
    """Find the weights that a campaign can distinguish by the joints that they load.

    Returns the upper arm, the forearm, and None for all links together, by the joints,
    from 1, that each loads on an upright arm.
    """

    def find_loaded_joints(*masses: LinkMass) -> tuple[int, ...]:
        torque = compute_typical_gravity_torque(
            arm, masses, (0.0, 0.0, -standard_gravity)
        )
        loaded = np.flatnonzero(torque > _MIN_TORQUE_SHARE * torque.max())
        return tuple((loaded + 1).tolist())

    link_of: dict[tuple[int, ...], int | None] = {}
    for (link,) in list_flexible_links(arm):
        centre = 0.5 * arm.links[link].vector_m
        joints = find_loaded_joints(LinkMass(link, 1.0, tuple(centre)))
        # Of the links that load the same joints, take only the first. Take two links at
        # most, because the weight of the hand acts like that of a tool.
        if joints and joints[-1] == link and len(link_of) < 2:
            link_of[joints] = link
    link_of.setdefault(find_loaded_joints(*arm.masses), None)
    return link_of
