"""What every effect of the catalogue is: candidates, each with named parameters and the displacements that they make.

An effect is a module of this package with

- ``NAME`` and ``FAMILY``, as in the design's table;
- ``candidates(sites)``, which lists where on this robot the effect can act.

Nothing else knows the effects by name: a new module is a new effect.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from elastocal.elastostatics import generalized_forces
from elastocal.kinematics import poses_and_jacobians_of_points
from elastocal.robot import MeasuringPoint
from elastocal.sites import Sites

STANDARD_GRAVITY = 9.80665
# Of the load under which gears are looked at: a pull at the end of the arm, at the least lever of a tool.
_PULL_N, _LEAST_LEVER_M = 1e3, 0.5


@dataclass(frozen=True)
class Parameter:
    """One unknown of an effect.

    Attributes
    ----------
    name, unit : str
    plausible : float
        Magnitude that such an effect can reach on a real robot; a parameter that the data cannot tell from zero even at this
        size is not estimated.
    prior_std : float or None
        Standard deviation of a normal prior about zero, for series whose terms the data tell from each other only in part.
        None, as nearly everywhere, for no prior. Reported with the estimate.
    sign : {-1, 0, 1}
        That such an effect has by its physics; 0 where it may have either.
    order : int
        Of a harmonic, whose plausible size falls with it; 1 elsewhere.
    """

    name: str
    unit: str
    plausible: float
    prior_std: float | None = None
    sign: int = 0
    order: int = 1


@dataclass(frozen=True)
class Shape:
    """An unknown in which the effect is not linear.

    Attributes
    ----------
    name, unit : str
    start : float
        Where the search starts.
    lowest, highest : float
        Range in which the law keeps its meaning.
    """

    name: str
    unit: str
    start: float
    lowest: float
    highest: float


@dataclass(frozen=True)
class Candidate:
    """One way in which one effect can act on this robot.

    Attributes
    ----------
    effect, family : str
    joints : tuple of int
        Joints concerned, counted from 1; empty where the effect belongs to no joint.
    detail : str
        Which variant, where an effect has more than one for these joints.
    parameters : tuple of Parameter
        In which the displacement is linear.
    displacement : callable
        ``displacement(circumstances, *shapes)`` gives for each parameter a dict from a coordinate of the sites to its
        displacement per unit of the parameter, ndarray (S,).
    needs : frozenset of str
        What must be in the data: "load", "approach", "time", "temperature".
    shapes : tuple of Shape
    distinct_angles : int
        How many different angles of its joints the law needs to be told from a smooth one.
    place : str
        Names the location beside the joints where these do not: a column, a band of orders. Candidates of one effect at one
        location are variants of its law, of which only one can hold.
    """

    effect: str
    family: str
    joints: tuple
    detail: str
    parameters: tuple
    displacement: Callable
    needs: frozenset = frozenset()
    shapes: tuple = ()
    distinct_angles: int = 0
    place: str = ""

    @property
    def location(self):
        """Where the effect acts: its joints, with the place where they do not tell it."""
        return (*self.joints, self.place) if self.place else self.joints

    @property
    def key(self):
        """Unique name, such as ``link_weight@2`` or ``transmission_harmonic@1[orders 3-12]``."""
        where = "@" + "+".join(map(str, self.joints)) if self.joints else ""
        return f"{self.effect}{where}" + (f"[{self.detail}]" if self.detail else "")


def effect_of(key):
    """Name of the effect in the key of a candidate."""
    return key.split("@")[0].split("[")[0]


@dataclass(frozen=True)
class Circumstances:
    """Everything that an effect may depend on, for S states of the robot.

    Attributes
    ----------
    sites : Sites
    compliance : ndarray (n,)
        Joint compliances, rad/(N m).
    joint_angles : ndarray (S, n)
        rad.
    wrench : ndarray (S, 6)
        N, N m, at the last measuring point, base axes.
    load : ndarray (S, C)
        Generalized force of that wrench on every coordinate of the sites (equation 7): N on translations, N m on rotations.
    weight : ndarray (n + 1, S, C)
        Generalized force on every coordinate of one kilogram at the far end of each link.
    end_jacobian : ndarray (S, 6, n)
        Of the last measuring point, with respect to the joints.
    end_rotation : ndarray (S, 3, 3)
    approach : ndarray (S, n) or None
    time_s : ndarray (S,) or None
        Since the first reading to which the model was fitted.
    temperature_c : ndarray (S,) or None
    """

    sites: Sites
    compliance: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    load: np.ndarray
    weight: np.ndarray
    end_jacobian: np.ndarray
    end_rotation: np.ndarray
    approach: np.ndarray | None = None
    time_s: np.ndarray | None = None
    temperature_c: np.ndarray | None = None

    def joint_deflections(self, wrench):
        """Turn of each joint under another wrench at the last measuring point: c J^T w, ndarray (S, n)."""
        return generalized_forces(self.end_jacobian, wrench) * self.compliance


def circumstances_of(sites, compliance, states, time_zero_s=0.0):
    """What effects may depend on, in some states.

    Parameters
    ----------
    sites : Sites
    compliance : ndarray (n,)
        rad/(N m).
    states : States
    time_zero_s : float
        From which effects count the time.

    Returns
    -------
    Circumstances
    """
    chain, n = sites.chain, sites.joints
    coordinates = np.zeros((len(states), chain.coordinates))
    coordinates[:, :n] = states.joint_angles
    end = MeasuringPoint("end", chain.end_effector.after)
    far_ends = [sites.far_end(link) for link in range(n + 1)]
    _, rotations, jacobians = poses_and_jacobians_of_points(chain, coordinates, [end, *far_ends])
    rotation, jacobian, weight = rotations[0], jacobians[0], -STANDARD_GRAVITY * jacobians[1:, :, 2]
    return Circumstances(
        sites,
        np.asarray(compliance),
        states.joint_angles,
        states.wrench,
        generalized_forces(jacobian, states.wrench),
        weight,
        jacobian[..., :n],
        rotation,
        states.approach,
        None if states.time_s is None else states.time_s - time_zero_s,
        states.temperature_c,
    )


def per_joint(sites, make):
    """Candidates of an effect that acts on one joint at a time: ``make(joint index from 0)`` for each joint."""
    return [make(joint) for joint in range(sites.joints)]


def lever_m(sites, joint):
    """Length of the arm beyond a joint, outstretched; at least that of a tool.

    Parameters
    ----------
    sites : Sites
    joint : int
        From 0.

    Returns
    -------
    float
    """
    return max(float(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum()), _LEAST_LEVER_M)


def full_torque_Nm(sites, joint):  # noqa: N802 - units in names keep their case
    """Torque of a kilonewton at the end of the outstretched arm, by which laws of gears are scaled.

    Parameters
    ----------
    sites : Sites
    joint : int
        From 0.

    Returns
    -------
    float
    """
    return _PULL_N * lever_m(sites, joint)
