"""Two robots that nothing in the project was tuned on, in simulated cells that write
files as a tracker and a controller do.

The physics are MuJoCo's, from the URDF alone: nothing here reads a robot file of the
project, or shares code with its simulated robot. The arms have data sheets' masses, and
springs that no file states.
"""

import re
from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np
from made_urdf import joint, link, robot
from scipy.spatial.transform import Rotation

GRAVITY_M_S2 = 9.80665
# Fixed-point steps until a deflection of milliradians is exact to a nanoradian.
_STEPS = 8
# Where the tracker stands, on which its noise depends; base axes.
_STAND_M = np.array([4.0, -1.5, 1.0])
_EXTENSION = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'


@dataclass(frozen=True)
class Link:
    """A link and the joint that moves it: lengths in m, limits in degrees."""

    xyz: tuple
    axis: tuple
    limits_deg: tuple
    mass_kg: float
    centre: tuple


@dataclass(frozen=True)
class Unseen:
    """A robot, its hidden errors and its tracker.

    Attributes
    ----------
    name, links, flange_xyz, flange_rpy : what the data sheet and the URDF state.
    compliance : (n,) rad/(N m) of the gears, tilt : of their bearings across the axis.
    offset : (n,) rad of the encoders' zeros.
    waves : (joint from 0, order, rad, phase) of the gears.
    geometry_m, masses : standard deviations of the links' errors, m and relative.
    balance : None, or anchor and arm of a spring beside joint 2 (m), its preload (N) and
        its stiffness (N/m).
    repeatability_rad : standard deviation of each joint at each approach.
    noise_m, noise_m_per_m : of the tracker in a coordinate.
    station : position and rotation vector of the tracker in the base frame; zeros if its
        frame is that of the base.
    moved : the same of the second block, relative to the first.
    caliper_m : error of the declared offsets of the reflectors, flange axes.
    """

    name: str
    links: tuple
    flange_xyz: tuple
    flange_rpy: tuple
    compliance: np.ndarray
    tilt: float
    offset: np.ndarray
    waves: tuple
    geometry_m: float
    masses: float
    balance: tuple | None
    repeatability_rad: float
    noise_m: float
    noise_m_per_m: float
    station: np.ndarray
    moved: np.ndarray
    caliper_m: np.ndarray

    def write_urdf(self, path):
        """Write the URDF that the maker gives away."""
        parts = [_EXTENSION, link("base_link", 100.0)]
        parent = "base_link"
        for number, part in enumerate(self.links, 1):
            limits = tuple(np.radians(part.limits_deg).round(4))
            child = f"link_{number}"
            parts.append(
                joint(
                    f"axis_{number}",
                    parent,
                    child,
                    xyz=part.xyz,
                    axis=part.axis,
                    limits=limits,
                )
            )
            parts.append(link(child, part.mass_kg, part.centre))
            parent = child
        parts.append(link("flange"))
        parts.append(
            joint(
                "mount",
                parent,
                "flange",
                "fixed",
                xyz=self.flange_xyz,
                rpy=self.flange_rpy,
            )
        )
        path.write_text(robot(*parts, name=self.name), encoding="utf-8")


HEAVY = Unseen(
    "Aurochs 205",
    (
        Link((0, 0, 0.715), (0, 0, -1), (-180, 180), 330.0, (0.12, -0.03, -0.18)),
        Link((0.37, 0, 0), (0, 1, 0), (-75, 80), 205.0, (0.02, 0.06, 0.52)),
        Link((0, 0, 1.19), (0, 1, 0), (-70, 120), 190.0, (0.05, 0.01, 0.11)),
        Link((0.40, 0, 0.135), (-1, 0, 0), (-350, 350), 74.0, (0.42, 0, 0)),
        Link((0.91, 0, 0), (0, 1, 0), (-120, 120), 38.0, (0.03, 0, 0)),
        Link((0, 0, 0), (-1, 0, 0), (-350, 350), 11.0, (0.18, 0, 0)),
    ),
    (0.235, 0, 0),
    (0, np.pi / 2, 0),
    compliance=1e-6 * np.array([0.85, 0.41, 0.62, 2.9, 3.3, 4.2]),
    tilt=4e-8,
    offset=1e-3 * np.array([0.0, 0.6, -0.8, 0.9, -0.5, 0.7]),
    waves=((2, 2, 9e-5, 0.4), (0, 1, 6e-5, 1.9)),
    geometry_m=3e-4,
    masses=0.07,
    balance=((-0.19, -0.42), (0.0, 0.47), 5500.0, 26000.0),
    repeatability_rad=6e-6,
    noise_m=1.5e-5,
    noise_m_per_m=6e-6,
    station=np.array([4.1, -1.7, 0.9, 0.002, -0.003, 2.4]),
    moved=np.array([0.9, 1.1, 0.02, 0.001, 0.002, 0.35]),
    caliper_m=np.array([1.6e-4, -2.1e-4, 1.4e-4]),
)
LIGHT = Unseen(
    "Wren 5",
    (
        Link((0, 0, 0.158), (0, 0, 1), (-360, 360), 3.9, (0, 0.02, -0.03)),
        Link((0, 0.132, 0), (0, 1, 0), (-175, 175), 7.6, (0, 0.01, 0.17)),
        Link((0, -0.118, 0.41), (0, 1, 0), (-165, 165), 2.7, (0, 0, 0.16)),
        Link((0, 0, 0.372), (0, 1, 0), (-200, 200), 1.3, (0, 0.09, 0)),
        Link((0, 0.109, 0), (0, 0, 1), (-360, 360), 1.3, (0, 0, 0.09)),
        Link((0, 0, 0.101), (0, 1, 0), (-360, 360), 0.34, (0, 0.07, 0)),
    ),
    (0, 0.094, 0),
    (-np.pi / 2, 0, 0),
    compliance=1e-6 * np.array([16.0, 19.0, 24.0, 61.0, 68.0, 85.0]),
    tilt=1e-6,
    offset=1e-3 * np.array([0.0, -1.1, 1.6, 0.9, -1.4, 1.2]),
    waves=((1, 2, 2.2e-4, 0.9), (2, 1, 1.5e-4, 2.2)),
    geometry_m=2e-4,
    masses=0.07,
    balance=None,
    repeatability_rad=1.2e-5,
    noise_m=1.2e-5,
    noise_m_per_m=5e-6,
    station=np.zeros(6),
    moved=1e-5 * np.array([4.0, -3.0, 2.0, 3.0, -4.0, 5.0]),
    caliper_m=np.array([-1.5e-4, 2.2e-4, 1.3e-4]),
)


class Cell:
    """A specimen of an unseen robot with its tracker.

    Parameters
    ----------
    unseen : Unseen
    seed : int
        Seed of the specimen's links, of its repeatability and of the tracker's noise.
    urdf : path of the maker's URDF.
    """

    def __init__(self, unseen, seed, urdf):
        self.unseen = unseen
        self.declared = mujoco.MjModel.from_xml_path(str(urdf))
        self.true = mujoco.MjModel.from_xml_path(str(urdf))
        for model in (self.declared, self.true):
            model.opt.gravity[:] = (0.0, 0.0, -GRAVITY_M_S2)
        body = partial(mujoco.mj_name2id, self.true, mujoco.mjtObj.mjOBJ_BODY)
        self.flange = body("flange")
        moving = [*range(body("link_1"), self.flange + 1)]
        draws = np.random.default_rng([seed, 1])
        errors = draws.normal(size=(len(moving), 3))
        self.true.body_pos[moving] += unseen.geometry_m * errors
        errors = draws.normal(size=self.true.nbody - 1)
        self.true.body_mass[1:] *= 1.0 + unseen.masses * errors
        self.draws = np.random.default_rng([seed, 2])

    def follow(self, angles):
        """Return the poses (N, 3) and (N, 3, 3) that the URDF has at joint angles."""
        data = mujoco.MjData(self.declared)
        position, rotation = [], []
        for row in angles:
            data.qpos[:] = row
            mujoco.mj_kinematics(self.declared, data)
            position.append(data.xpos[self.flange].copy())
            rotation.append(data.xmat[self.flange].reshape(3, 3).copy())
        return np.array(position), np.array(rotation)

    def reach(self, angles, force, *, repeatable=False):
        """Return the poses of the flange (N, 3) and (N, 3, 3) in the base frame.

        Parameters
        ----------
        angles : (N, n) commanded, rad; each row is approached afresh.
        force : (N, 3) N at the flange, base axes.
        repeatable : whether the random error of an approach is left out.
        """
        unseen = self.unseen
        data = mujoco.MjData(self.true)
        position, rotation = [], []
        for row, pull in zip(angles, force, strict=True):
            drive = row + unseen.offset
            for number, order, size, phase in unseen.waves:
                drive[number] += size * np.sin(order * row[number] + phase)
            if not repeatable:
                drive += unseen.repeatability_rad * self.draws.normal(size=drive.shape)
            data.qpos[:] = drive
            for _ in range(_STEPS):
                torque = self._compute_torques(data, pull)
                data.qpos[:] = drive + unseen.compliance * torque
            place, turn = self._tilt(data, pull)
            position.append(place)
            rotation.append(turn)
        return np.array(position), np.array(rotation)

    def _compute_torques(self, data, pull):
        """Torques of weight, load and balancer on the joints, N m."""
        model = self.true
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        data.qvel[:] = 0.0
        mujoco.mj_comVel(model, data)
        bias = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 0, bias)
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, data.xpos[self.flange], self.flange)
        torque = jacobian.T @ pull - bias
        if self.unseen.balance:
            torque[1] += self._balance(data.qpos[1])
        return torque

    def _balance(self, angle):
        """Torque of the spring that pulls the upper arm up, N m."""
        anchor, arm, preload_N, stiffness = self.unseen.balance
        sine, cosine = np.sin(angle), np.cos(angle)
        x = cosine * arm[0] + sine * arm[1]
        z = -sine * arm[0] + cosine * arm[1]
        rest = np.hypot(arm[0] - anchor[0], arm[1] - anchor[1])
        along = np.array([anchor[0] - x, anchor[1] - z])
        length = np.hypot(*along)
        pull = (preload_N + stiffness * (length - rest)) * along / length
        # About +y: z of the lever times x of the force less the other product.
        return z * pull[0] - x * pull[1]

    def _tilt(self, data, pull):
        """Pose of the flange after the bearings have tilted under moments across their
        axes."""
        model = self.true
        flange = data.xpos[self.flange].copy()
        place = flange.copy()
        turn = np.zeros(3)
        for number in range(model.njnt):
            body = model.jnt_bodyid[number]
            pivot = data.xanchor[number]
            weight = model.body_subtreemass[body] * model.opt.gravity
            moment = np.cross(data.subtree_com[body] - pivot, weight)
            moment += np.cross(flange - pivot, pull)
            axis = data.xaxis[number]
            across = self.unseen.tilt * (moment - (moment @ axis) * axis)
            place += np.cross(across, flange - pivot)
            turn += across
        rotation = data.xmat[self.flange].reshape(3, 3)
        return place, Rotation.from_rotvec(turn).as_matrix() @ rotation

    def measure(self, angles, force, offsets, block):
        """Return positions (N, T, 3) of reflectors in the tracker's frame, m.

        Parameters
        ----------
        angles, force : as for `reach`.
        offsets : (T, 3) declared offsets on the flange, m, as a caliper gives them.
        block : (N,) 0 before lunch and 1 after it.
        """
        position, rotation = self.reach(angles, force)
        unseen = self.unseen
        offsets = np.array(offsets) + unseen.caliper_m
        reflectors = position[:, None] + np.einsum("nij,tj->nti", rotation, offsets)
        measured = _move_frame(reflectors, unseen.station)
        moved = _move_frame(measured, unseen.moved)
        later = np.asarray(block)[:, None, None] == 1
        measured = np.where(later, moved, measured)
        distance = np.linalg.norm(reflectors - _STAND_M, axis=-1, keepdims=True)
        noise_m = unseen.noise_m + unseen.noise_m_per_m * distance
        return measured + noise_m * self.draws.normal(size=measured.shape)


def _move_frame(points, motion):
    """Return points (..., 3) in a frame at a position and rotation vector, (6,)."""
    axes = Rotation.from_rotvec(motion[3:]).as_matrix()
    return (points - motion[:3]) @ axes


def read_program(path):
    """Return the joint angles (N, n), rad, that a controller reads from a program."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".src":
        rows = re.findall(r"PTP \{E6AXIS: ([^}]*)\}", text)
        values = [re.findall(r"A\d (-?[\d.]+)", row) for row in rows]
        return np.radians(np.array(values, float))
    rows = re.findall(r"movej\(\[([^\]]*)\]", text)
    return np.array([row.split(",") for row in rows], float)


def format_millimetres(value_m, *, comma):
    """Write a length as a tracker's software does, in mm to a micrometre."""
    text = f"{1e3 * value_m:.4f}"
    return text.replace(".", ",") if comma else text


def write_tracker_file(path, labels, position, start, *, comma, names):
    """Write what a tracker's software exports: labels, mm, and the time of day.

    Parameters
    ----------
    path : the file.
    labels : (N,) rows of label cells.
    position : (N, 3) m.
    start : time of the first point, s after midnight.
    comma : whether decimals have a comma and columns a semicolon.
    names : headers of the labels.
    """
    mark = ";" if comma else ","
    lines = [
        "Project: acceptance, job 4711",
        mark.join([*names, "X [mm]", "Y [mm]", "Z [mm]", "Time"]),
    ]
    for number, (label, point) in enumerate(zip(labels, position, strict=True)):
        seconds = int(start + 25 * number)
        clock = f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
        cells = [format_millimetres(value, comma=comma) for value in point]
        lines.append(mark.join([*map(str, label), *cells, clock]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
