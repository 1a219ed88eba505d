"""Static equilibrium: which deflections the springs take under load and weight, by MuJoCo's kinematics.

At rest the generalized force on every sprung coordinate, tau = J^T w + gravity + compensator, is what its spring transmits, and
theta = law(tau). The forces depend on the deflections only through the geometry, by the share (force times arm) / stiffness, a
thousandth or so, so that fixed-point iteration gains about three digits a sweep. With linear springs it is the modified Newton
method with their stiffness as tangent.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import mujoco
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from elastocal_proof.plant.multibody import Machine
    from elastocal_proof.plant.structure import Compensator

    StructureLaw = tuple[str, Callable[[np.ndarray], np.ndarray]]

_SWEEPS = 60
# Of the largest deflection: a hundredth of a picometre of millimetres.
_TOLERANCE = 1e-11
# MuJoCo wants mass in each moving body; what weighs less than this is none.
_NOTHING_KG = 1e-6


@dataclass(frozen=True)
class Loading:
    """What acts on the arm in S states.

    `drive` (S, n): angles at which the drives really stand, rad. `wrench` (S, 6): that the flange really feels, at its
    deflected origin, base axes; N, N m. `growth` (S, n + 1): relative growth of all lengths of each stretch. `offsets` (S,): by
    which structural coordinates are off beside what their springs do, rad or m.
    """

    drive: np.ndarray
    wrench: np.ndarray
    growth: np.ndarray
    offsets: dict[int, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Places:
    """Where everything is, in S states; base axes, m.

    `anchor`, `axis` (S, coordinates, 3): of the joints. `mass` (S, bodies, 3): centres of mass. `body` (S, bodies, 3): origins
    of the bodies. `body_rotation` (S, bodies, 3, 3). `position`, `rotation` (S, points, 3), (S, points, 3, 3): of the measuring
    points. `spring` (S, 2, 3): fixed and moving end of the compensator; (S, 0, 3) without.
    """

    anchor: np.ndarray
    axis: np.ndarray
    mass: np.ndarray
    body: np.ndarray
    body_rotation: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    spring: np.ndarray


@dataclass(frozen=True)
class Equilibrium:
    """Where an arm came to rest, in S states.

    `coordinates` (S, coordinates): rad, m. `gear` (n,) of int: which of them are the gears' deflections. `torque` (S,
    coordinates): generalized force that each coordinate's spring transmits, N m, N.
    """

    coordinates: np.ndarray
    gear: np.ndarray
    torque: np.ndarray
    where: Places
    sweeps: int

    @property
    def position(self) -> np.ndarray:
        """Of the measuring points, ndarray (S, points, 3), base frame, m."""
        return self.where.position

    @property
    def rotation(self) -> np.ndarray:
        """Of the measuring points, ndarray (S, points, 3, 3)."""
        return self.where.rotation


def places(machine: Machine, coordinates: np.ndarray, growth: np.ndarray) -> Places:
    """MuJoCo's kinematics.

    `coordinates` (S, coordinates). `growth` (S, n + 1): relative growth of all lengths of each stretch.
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    count, joints, links, points = len(coordinates), model.njnt, model.nbody, model.nsite
    anchor, axis = np.empty((count, joints, 3)), np.empty((count, joints, 3))
    mass, body, turn = np.empty((count, links, 3)), np.empty((count, links, 3)), np.empty((count, links, 9))
    position, rotation = np.empty((count, points, 3)), np.empty((count, points, 9))
    # MuJoCo's own arrays, seen through views that follow each call.
    seen = [(anchor, data.xanchor), (axis, data.xaxis), (mass, data.xipos), (body, data.xpos), (turn, data.xmat)]
    seen += [(position, data.site_xpos), (rotation, data.site_xmat)]
    coordinate, bodies, sites = data.qpos, model.body_pos.copy(), model.site_pos.copy()
    grown = np.vstack([np.zeros_like(growth[:1]), growth])
    changed = (np.diff(grown, axis=0) != 0.0).any(axis=1)
    try:
        for state, row in enumerate(coordinates):
            if changed[state]:
                model.body_pos[:] = bodies * (1.0 + growth[state, machine.body_stretch, None])
                model.site_pos[:] = sites * (1.0 + growth[state, machine.site_stretch, None])
            coordinate[:] = row
            mujoco.mj_kinematics(model, data)
            for kept, now in seen:
                kept[state] = now
    finally:
        model.body_pos[:], model.site_pos[:] = bodies, sites
    mine = list(machine.sites.values())
    ends = [] if machine.compensator is None else [model.site(name).id for name in ("anchor", "crank")]
    turn, rotation = turn.reshape(count, links, 3, 3), rotation.reshape(count, points, 3, 3)
    return Places(anchor, axis, mass, body, turn, position[:, mine], rotation[:, mine], position[:, ends])


def generalized_forces(machine: Machine, coordinates: np.ndarray, loading: Loading) -> tuple[np.ndarray, Places]:
    """Forces on all coordinates by the principle of virtual work [1], and where everything is.

    `coordinates` (S, coordinates). Returns `force` (S, coordinates): N m, N: a . (M + (p - o) x F + sum (x_k - o) x m_k g)
    about the axis a through o, of masses m_k at x_k beyond it.

    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, Springer, 2009.
    """
    model, where = machine.model, places(machine, coordinates, loading.growth)
    flange = where.position[:, list(machine.sites).index(machine.flange), None]
    push, moment = loading.wrench[:, None, :3], loading.wrench[:, None, 3:]
    weighs = model.body_mass > _NOTHING_KG
    if weighs.any() and model.opt.gravity.any():
        moved = machine.beyond[:, weighs] * model.body_mass[weighs]
        kilograms, first = moved.sum(axis=1)[:, None], np.einsum("jk,skc->sjc", moved, where.mass[:, weighs])
        moment = moment + np.cross(first - kilograms * where.anchor, model.opt.gravity)
        weight = kilograms * model.opt.gravity
    else:
        weight = 0.0
    moment = moment + np.cross(flange - where.anchor, np.broadcast_to(push, where.anchor.shape))
    along = np.where(machine.slides[:, None], push + weight, moment)
    force = (where.axis * along).sum(axis=2)
    if machine.compensator is not None:
        force += _pull(machine, machine.compensator, where)
    return force, where


def _pull(machine: Machine, spring: Compensator, where: Places) -> np.ndarray:
    """Of the spring between the links before and behind the shoulder's drive."""
    model = machine.model
    line = where.spring[:, 0] - where.spring[:, 1]
    length = np.linalg.norm(line, axis=1, keepdims=True)
    pull = spring.stiffness_N_per_m * (1.0 - spring.free_length_m / length) * line
    force = np.zeros(where.anchor.shape[:2])
    for name, end, sense in (("anchor", 0, -1.0), ("crank", 1, 1.0)):
        body = int(model.site_bodyid[model.site(name).id])
        moment = np.cross(where.spring[:, end, None] - where.anchor, sense * pull[:, None])
        along = np.where(machine.slides[:, None], sense * pull[:, None], moment)
        force = force + machine.beyond[:, body] * (where.axis * along).sum(axis=2)
    return force


def equilibrium(
    machine: Machine,
    loading: Loading,
    gear_deflection: Callable[[np.ndarray, np.ndarray], np.ndarray],
    structure_laws: Iterable[StructureLaw] = (),
    start: np.ndarray | None = None,
) -> Equilibrium:
    """Where the arm comes to rest, by fixed-point iteration.

    `gear_deflection`: ``gear_deflection(torque, unloaded)``, ndarray (S, n) each in N m, gives the deflections (S, n) of the
    gears in rad; `unloaded` is the torque before the external wrench came on. `structure_laws` (str, callable): start of the
    names of structural springs, and what they deflect by, beyond their compliance, under a force (S,). `start` (S, n):
    deflections of the gears to begin with, rad, such as those of a robot that differs little. Raises `RuntimeError` where the
    iteration does not settle to 1e-11 of the largest deflection.
    """
    gear = machine.gear
    extra = [(index, law) for start, law in structure_laws for name, index in machine.springs.items() if name.startswith(start)]
    coordinates = np.zeros((len(loading.drive), machine.model.nq))
    coordinates[:, machine.drive] = loading.drive
    nothing = Loading(loading.drive, np.zeros_like(loading.wrench), loading.growth)
    unloaded = generalized_forces(machine, coordinates, nothing)[0][:, gear] if _preloaded(machine) else 0.0 * loading.drive
    if start is not None:
        coordinates[:, gear] = start
    for sweep in range(1, _SWEEPS + 1):
        force, where = generalized_forces(machine, coordinates, loading)
        following = force * machine.compliance
        following[:, machine.drive] = loading.drive
        following[:, gear] = gear_deflection(force[:, gear], unloaded)
        for index, law in extra:
            following[:, index] += law(force[:, index])
        for index, offset in loading.offsets.items():
            following[:, index] += offset
        change, size = np.abs(following - coordinates), np.abs(following)
        change[:, machine.drive] = size[:, machine.drive] = 0.0
        # The poses are those of `coordinates`; once the next would be the same they need no further sweep.
        if change.max(initial=0.0) <= _TOLERANCE * max(size.max(initial=0.0), 1e-9):
            return Equilibrium(coordinates, gear, force, where, sweep)
        coordinates = following
    raise RuntimeError(f"no equilibrium after {_SWEEPS} sweeps: the last moved by {change.max():.3g}")


def _preloaded(machine: Machine) -> bool:
    return machine.compensator is not None or machine.model.body_mass.sum() > _NOTHING_KG
