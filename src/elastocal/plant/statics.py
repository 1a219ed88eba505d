"""Static equilibrium: which deflections the springs take under MuJoCo's forces.

At rest the generalized force on every sprung coordinate, tau = J^T w + gravity + compensator, is what its spring transmits, and
theta = law(tau). The forces depend on the deflections only through the geometry, by the share (force times arm) / stiffness, a
thousandth or so, so that Newton's iteration with the springs' own tangent gains about three digits a sweep.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

_SWEEPS = 60
_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Loading:
    """What acts on the arm in S states.

    Attributes
    ----------
    drive : ndarray (S, n)
        Angles at which the drives really stand, rad.
    wrench : ndarray (S, 6)
        That the flange really feels, at its deflected origin, base axes; N, N m.
    growth : ndarray (S,)
        Relative growth of all lengths.
    """

    drive: np.ndarray
    wrench: np.ndarray
    growth: np.ndarray


@dataclass(frozen=True)
class Equilibrium:
    """Where an arm came to rest, in S states.

    Attributes
    ----------
    coordinates : ndarray (S, coordinates)
        rad, m.
    torque : ndarray (S, coordinates)
        Generalized force that each coordinate's spring transmits, N m, N.
    position : ndarray (S, points, 3)
        Of the measuring points, base frame, m.
    rotation : ndarray (S, points, 3, 3)
    sweeps : int
    """

    coordinates: np.ndarray
    torque: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    sweeps: int


def generalized_forces(machine, coordinates, loading):
    """Forces on all coordinates, and poses of all measuring points.

    Parameters
    ----------
    machine : Machine
    coordinates : ndarray (S, coordinates)
    loading : Loading

    Returns
    -------
    force : ndarray (S, coordinates)
    position : ndarray (S, points, 3)
    rotation : ndarray (S, points, 3, 3)
    """
    model, data = machine.model, mujoco.MjData(machine.model)
    flange, sites = machine.sites[machine.flange], list(machine.sites.values())
    body, heavy = int(model.site_bodyid[flange]), bool(model.body_mass.sum() > 1e-6 and model.opt.gravity.any())
    force = np.zeros((len(coordinates), model.nv))
    position, rotation = np.empty((len(coordinates), len(sites), 3)), np.empty((len(coordinates), len(sites), 9))
    bodies, points = model.body_pos.copy(), model.site_pos.copy()
    weight = np.empty(model.nv)
    try:
        for state, (row, wrench) in enumerate(zip(coordinates, loading.wrench, strict=True)):
            if loading.growth[state] or (state and loading.growth[state - 1]):
                model.body_pos[:] = bodies * (1.0 + loading.growth[state])
                model.site_pos[:] = points * (1.0 + loading.growth[state])
            data.qpos[:] = row
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            out = force[state]
            mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.site_xpos[flange], body, out)
            if heavy:
                # At rest the bias force is minus what gravity does.
                mujoco.mj_rne(model, data, 0, weight)
                out -= weight
            if machine.compensator is not None:
                _pull(machine, data, out)
            position[state], rotation[state] = data.site_xpos[sites], data.site_xmat[sites]
    finally:
        model.body_pos[:], model.site_pos[:] = bodies, points
    return force, position, rotation.reshape(*rotation.shape[:2], 3, 3)


def _pull(machine, data, out):
    model, spring = machine.model, machine.compensator
    anchor, crank = model.site("anchor").id, model.site("crank").id
    line = data.site_xpos[anchor] - data.site_xpos[crank]
    length = np.sqrt(line @ line)
    pull = spring.stiffness_N_per_m * (length - spring.free_length_m) / length * line
    for site, force in ((crank, pull), (anchor, -pull)):
        mujoco.mj_applyFT(model, data, force, np.zeros(3), data.site_xpos[site], model.site_bodyid[site], out)


def equilibrium(machine, loading, gear_deflection, structure_laws=()):
    """Where the arm comes to rest.

    Parameters
    ----------
    machine : Machine
    loading : Loading
    gear_deflection : callable
        ``gear_deflection(torque, unloaded)``, ndarray (S, n) each in N m, gives the deflections (S, n) of the gears in rad;
        `unloaded` is the torque before the external wrench came on.
    structure_laws : sequence of (str, callable)
        Start of the names of structural springs, and what they deflect by, beyond their compliance, under a force (S,).

    Returns
    -------
    Equilibrium

    Raises
    ------
    RuntimeError
        Where the iteration does not settle to 1e-12 of the largest deflection.
    """
    gear = machine.gear
    extra = [(index, law) for start, law in structure_laws for name, index in machine.springs.items() if name.startswith(start)]
    coordinates = np.zeros((len(loading.drive), machine.model.nq))
    coordinates[:, machine.drive] = loading.drive
    nothing = Loading(loading.drive, np.zeros_like(loading.wrench), loading.growth)
    unloaded = generalized_forces(machine, coordinates, nothing)[0][:, gear] if _preloaded(machine) else 0.0 * loading.drive
    for sweep in range(1, _SWEEPS + 1):
        force, position, rotation = generalized_forces(machine, coordinates, loading)
        following = force * machine.compliance
        following[:, machine.drive] = loading.drive
        following[:, gear] = gear_deflection(force[:, gear], unloaded)
        for index, law in extra:
            following[:, index] += law(force[:, index])
        change, size = np.abs(following - coordinates), np.abs(following)
        change[:, machine.drive] = size[:, machine.drive] = 0.0
        # The poses are those of `coordinates`; once the next would be the same they need no further sweep.
        if change.max(initial=0.0) <= _TOLERANCE * max(size.max(initial=0.0), 1e-9):
            return Equilibrium(coordinates, force, position, rotation, sweep)
        coordinates = following
    raise RuntimeError(f"no equilibrium after {_SWEEPS} sweeps: the last moved by {change.max():.3g}")


def _preloaded(machine):
    return machine.compensator is not None or machine.model.body_mass.sum() > 1e-6
