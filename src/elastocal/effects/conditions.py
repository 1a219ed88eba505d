"""The conditions on which effects may depend in each state of the robot: its loads, its
motion, the approach, time and temperature.

The load on each coordinate is the generalized force J^T w of a wrench w (N, N m), by the
principle of virtual work (Siciliano et al. 2009).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from elastocal.mechanics.kinematics import Motion, compute_motion, multiply_vectors
from elastocal.mechanics.sites import Sites

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from elastocal.fitting.observations import States

# Parameters of each mass that the robot file declares: the mass itself, and its first
# moments along the three axes of its frame.
MASS_PARAMETERS = 4
_Value = TypeVar("_Value")


class Cache(Generic[_Value]):
    """Values by name, each computed when it is first needed.

    Conditions that agree in everything on which the values depend share one cache.
    """

    def __init__(self, values: Mapping[str, _Value] | None = None) -> None:
        self._values = dict(values or {})

    def get(self, name: str, compute: Callable[[], _Value]) -> _Value:
        """Return the value of this name; compute it if it is not known yet."""
        if name not in self._values:
            self._values[name] = compute()
        return self._values[name]

    def copy_with(self, values: Mapping[str, _Value]) -> Cache[_Value]:
        """Copy the cache, with these values in place of its own."""
        return Cache(self._values | dict(values))

    def copy_without(self, *names: str) -> Cache[_Value]:
        """Copy the cache without some values, which will be computed again."""
        kept = self._values.keys() - set(names)
        return Cache({name: self._values[name] for name in kept})


class _CachedLoad:
    """Decorator of a load of `Conditions` that is kept in their cache of loads."""

    def __init__(self, compute: Callable[[Conditions], np.ndarray]) -> None:
        self.compute = compute
        self.__doc__ = compute.__doc__

    def __get__(self, conditions: Conditions, owner: object = None) -> np.ndarray:
        compute = partial(self.compute, conditions)
        return conditions.loads.get(self.compute.__name__, compute)


@dataclass(frozen=True)
class Timeline:
    """Reference of the times and the progress of a campaign.

    Attributes
    ----------
    time_zero_s : time of the first measurement, from which effects count the time.
    row_span : first and last row of the campaign; None for those of the states.
    """

    time_zero_s: float = 0.0
    row_span: tuple[int, int] | None = None


@dataclass(frozen=True)
class Conditions:
    """Everything on which an effect may depend, for S states of the robot.

    Loads are evaluated at the displaced coordinates behind `motion`, not at the commanded
    ones: this is the term K_C of the conservative congruence transformation (Chen and Kao
    2000). Use `replace_motion` and `select_conditions` to change the motion, because the
    cached loads depend on it.

    Attributes
    ----------
    compliance : joint compliances, (n,), rad/(N m).
    joint_angles : commanded joint angles, (S, n), rad.
    wrench : external wrench at the last measuring point, (S, 6), N and N m, base axes.
    motion : motion of `Sites.tracked_points`.
    mass_corrections : errors of the declared masses, (4 m,): for each mass its error in
        kg, then the errors of its first moments along the axes of its frame beyond those
        that the error of the mass causes, kg m.
    approach : sense in which each joint was approached, (S, n); NaN if it is unknown.
    time_s : time since the first measurement to which the model was fitted, (S,); NaN if
        it is unknown.
    temperature_c : temperature, (S,), °C; NaN if it is unknown. Only laws that need
        approach, time or temperature read them.
    progress : progress of the campaign, (S,), see `compute_progress`.
    session : number of the session, (S,) of int.
    laws : displacements by laws that depend on joint angles alone, see `Candidate.fixed`,
        by the keys of their candidates.
    loads : loads that have been computed, by name.
    """

    sites: Sites
    compliance: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    motion: Motion
    mass_corrections: np.ndarray
    approach: np.ndarray
    time_s: np.ndarray
    temperature_c: np.ndarray
    progress: np.ndarray
    session: np.ndarray
    laws: Cache[list[dict[int, np.ndarray]]] = field(
        default_factory=Cache, repr=False, compare=False
    )
    loads: Cache[np.ndarray] = field(default_factory=Cache, repr=False, compare=False)

    @property
    def ones(self) -> np.ndarray:
        """One in every state, ndarray (S,)."""
        return np.ones(len(self.joint_angles))

    @_CachedLoad
    def load(self) -> np.ndarray:
        """Generalized force (N, N m) of the external wrench on every coordinate of the
        sites (equation 7), ndarray (S, C)."""
        return self.load_by(self.wrench)

    def load_by(
        self, wrench: np.ndarray, coordinates: slice = slice(None)
    ) -> np.ndarray:
        """Compute the generalized force of a wrench (S, 6) at the last measuring point,
        ndarray (S, number of coordinates)."""
        wrench_at_base = wrench.T.copy()
        moment = np.empty_like(self.motion.position[0])
        multiply_vectors(self.motion.position[0], wrench_at_base[:3], moment)
        wrench_at_base[3:] += moment
        return self.motion.generalized_forces(
            self.sites.tracked_points[0].after, wrench_at_base, coordinates
        ).T

    @_CachedLoad
    def gravity(self) -> np.ndarray:
        """Generalized force of the declared masses on every coordinate of the sites,
        ndarray (S, C)."""
        masses, first_moments = self._masses_and_first_moments()
        bodies = self.sites.tracked_points[self.sites.joints + 2 :]
        _, coordinates, states = self.motion.twist.shape
        is_carried = self.motion.transform_index[:, None] < [
            body.after for body in bodies
        ]
        # Neighbouring coordinates that carry the same masses have one wrench.
        is_edge = (is_carried[1:] != is_carried[:-1]).any(axis=1)
        edges = np.flatnonzero(is_edge) + 1
        force = np.empty((coordinates, states))
        for start, end in pairwise([0, *edges.tolist(), coordinates]):
            carried = is_carried[start]
            wrench = self._gravity_wrench(
                float(masses[carried].sum()), first_moments[carried].sum(axis=0)
            )
            twist = self.motion.twist[:, start:end]
            np.einsum("iks,is->ks", twist, wrench, out=force[start:end])
        return force.T

    def _masses_and_first_moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Declared masses with their corrections (m,), kg, and first moments about the
        base's origin (m, 3, S), kg m."""
        corrections = self.mass_corrections.reshape(-1, MASS_PARAMETERS)
        declared = np.array([mass.mass_kg for mass in self.sites.masses])
        centres = [mass.centre_m for mass in self.sites.masses]
        masses = declared + corrections[:, 0]
        local_moments = masses[:, None] * centres + corrections[:, 1:]
        bodies = slice(self.sites.joints + 2, len(self.sites.tracked_points))
        position = self.motion.position[bodies]
        rotation = self.motion.rotation[bodies]
        first_moments = masses[:, None, None] * position + sum(
            local_moments[:, axis, None, None] * rotation[:, :, axis]
            for axis in range(3)
        )
        return masses, first_moments

    def gravity_of_corrections(
        self, coordinates: slice | list[int]
    ) -> Iterator[np.ndarray]:
        """Derivatives of `gravity` on some coordinates with respect to the
        `mass_corrections`.

        The coordinates are in the order of the chain. Yields for each mass an array (4,
        K', S) for the K' first of the coordinates, which the mass loads.
        """
        transform_index = self.motion.transform_index[coordinates]
        twist = self.motion.twist[:, coordinates]
        gravity = np.array(self.sites.gravity_m_s2)
        force_per_kg = np.tensordot(gravity, twist[:3], 1)
        for body, mass in enumerate(self.sites.masses, self.sites.joints + 2):
            rotation = self.motion.rotation[body]
            loaded = np.searchsorted(
                transform_index, self.sites.tracked_points[body].after
            )
            centre = self.motion.position[body] + np.tensordot(
                mass.centre_m, rotation, (0, 1)
            )
            moments = np.empty((3, MASS_PARAMETERS, rotation.shape[2]))
            multiply_vectors(
                np.concatenate([centre[:, None], rotation], axis=1),
                gravity[:, None, None],
                moments,
            )
            forces = np.einsum("iks,ips->pks", twist[3:, :loaded], moments)
            forces[0] += force_per_kg[:loaded]
            yield forces

    def _gravity_wrench(self, mass: float, first_moment: np.ndarray) -> np.ndarray:
        """Wrench of gravity on a mass with a first moment (3, S) about the base's origin,
        ndarray (6, S)."""
        wrench = np.empty((6, first_moment.shape[1]))
        gravity = np.array(self.sites.gravity_m_s2)[:, None]
        wrench[:3] = mass * gravity
        multiply_vectors(first_moment, gravity, wrench[3:])
        return wrench

    @_CachedLoad
    def usual_gravity(self) -> np.ndarray:
        """Generalized force of the usual masses on every coordinate, ndarray (S, C).

        It is zero on the joints, whose sag is an effect of its own.
        """
        force = np.zeros((self.motion.transform_index.size, len(self.wrench)))
        for end, mass in enumerate(self.sites.typical_masses_kg, 1):
            wrench = self._gravity_wrench(mass, mass * self.motion.position[end])
            after = self.sites.tracked_points[end].after
            force += self.motion.generalized_forces(after, wrench)
        force[: self.sites.joints] = 0.0
        return force.T

    @_CachedLoad
    def total(self) -> np.ndarray:
        """Load by the external wrench and the declared or usual masses on every
        coordinate of the sites, ndarray (S, C)."""
        if self.sites.bears_typical_weight:
            weight = self.usual_gravity
        elif self.sites.masses:
            weight = self.gravity
        else:
            return self.load + 0.0
        # Without a wrench the load is zero and need not be computed.
        return self.load + weight if self.wrench.any() else weight

    @_CachedLoad
    def mass_torques(self) -> np.ndarray:
        """Torque on each joint per unit of each of the `mass_corrections`, ndarray (4 m,
        S, n)."""
        masses = len(self.sites.masses)
        joints = self.sites.joints
        torques = np.zeros((masses, MASS_PARAMETERS, joints, len(self.wrench)))
        forces_by_mass = self.gravity_of_corrections(slice(joints))
        for mass, forces in enumerate(forces_by_mass):
            torques[mass, :, : forces.shape[1]] = forces
        return torques.reshape(-1, *torques.shape[2:]).swapaxes(1, 2)

    def weight(self, link: int, axis: int | None = None) -> np.ndarray:
        """Torque on each joint by a kilogram at the far end of a link, or by a first
        moment of a kilogram metre along an axis there, ndarray (S, n)."""
        end = 1 + link
        if axis is None:
            wrench = self._gravity_wrench(1.0, self.motion.position[end])
        else:
            wrench = self._gravity_wrench(0.0, self.motion.rotation[end, :, axis])
        return self.motion.generalized_forces(
            self.sites.tracked_points[end].after, wrench, slice(self.sites.joints)
        ).T


def compute_progress(
    states: States, row_span: tuple[int, int] | None = None
) -> np.ndarray:
    """Compute the progress of a campaign in each state, ndarray (S,): 0 at its first row,
    1 at its last.

    Without `row_span`, first and last row are those of the states. States without a row
    come after the campaign. If no rows are known at all, poses count in the order of
    their numbers.
    """
    if not len(states) or (states.row is None and row_span is not None):
        return np.ones(len(states))
    rows = states.pose if states.row is None else states.row
    first, last = row_span or (rows.min(), rows.max())
    return (rows - first) / max(last - first, 1)


def build_conditions(
    sites: Sites,
    compliance: np.ndarray,
    states: States,
    *,
    mass_corrections: np.ndarray | None = None,
    timeline: Timeline = Timeline(),
    coordinates: np.ndarray | None = None,
) -> Conditions:
    """Build the conditions of states.

    Parameters
    ----------
    sites : sites of the robot
    compliance : joint compliances, (n,), rad/(N m)
    states : S states
    mass_corrections : as in `Conditions`, zero by default
    timeline : reference of times and progress
    coordinates : displaced coordinates, (S, C), by default those of the commanded poses
    """
    if coordinates is None:
        coordinates = sites.chain.at(states.joint_angles)
    if mass_corrections is None:
        mass_corrections = np.zeros(MASS_PARAMETERS * len(sites.masses))
    unknown = np.full(states.joint_angles.shape, np.nan)
    time_s = unknown[:, 0]
    if states.time_s is not None:
        time_s = states.time_s - timeline.time_zero_s
    return Conditions(
        sites,
        np.asarray(compliance),
        states.joint_angles,
        states.wrench,
        compute_motion(sites.chain, coordinates, sites.tracked_points),
        mass_corrections,
        unknown if states.approach is None else states.approach,
        time_s,
        unknown[:, 0] if states.temperature_c is None else states.temperature_c,
        compute_progress(states, timeline.row_span),
        states.session,
    )


def select_conditions(conditions: Conditions, chosen: slice | np.ndarray) -> Conditions:
    """Select some of the states; `chosen` (S,) of bool."""
    motion = conditions.motion
    chosen_motion = replace(
        motion,
        position=motion.position[..., chosen],
        rotation=motion.rotation[..., chosen],
        twist=motion.twist[..., chosen],
    )
    return replace(
        replace_motion(conditions, chosen_motion),
        joint_angles=conditions.joint_angles[chosen],
        wrench=conditions.wrench[chosen],
        approach=conditions.approach[chosen],
        time_s=conditions.time_s[chosen],
        temperature_c=conditions.temperature_c[chosen],
        progress=conditions.progress[chosen],
        session=conditions.session[chosen],
        laws=Cache(),
    )


def replace_motion(conditions: Conditions, motion: Motion) -> Conditions:
    """Replace the motion of the same states; the loads are computed again."""
    return replace(conditions, motion=motion, loads=Cache())


def replace_springs(
    conditions: Conditions, compliance: np.ndarray, mass_corrections: np.ndarray
) -> Conditions:
    """Replace the joint compliances (n,) and the errors of the declared masses (4 m,).

    Loads depend on the compliances only through the motion, which stays, so that all
    loads that do not depend on the masses are kept.
    """
    loads = conditions.loads
    if np.array_equal(mass_corrections, conditions.mass_corrections):
        if np.array_equal(compliance, conditions.compliance):
            return conditions
    else:
        loads = loads.copy_without("gravity", "total")
    return replace(
        conditions,
        compliance=compliance,
        mass_corrections=mass_corrections,
        loads=loads,
    )


def replace_total_load(conditions: Conditions, total: np.ndarray) -> Conditions:
    """Replace the total load, ndarray (S, C), whatever causes it."""
    return replace(conditions, loads=conditions.loads.copy_with({"total": total}))


def find_offered_needs(sites: Sites, states: States) -> frozenset[str]:
    """Find the needs of effects that the data meet.

    Returns
    -------
    "load" for an external load or a weight; "load on the joints" for an external load
    or declared masses; "external load", without which the compliances are not
    identifiable; "approach" if it is known in some state; "time" and "temperature" if
    they change; "order", that of the rows, if the times do not.
    """
    external = bool(states.wrench.any())
    loaded = bool(sites.masses) or external
    has_approach = states.approach is not None and bool(states.approach.any())
    has_time = states.time_s is not None and np.ptp(states.time_s) > 0
    has_temperature = (
        states.temperature_c is not None and np.ptp(states.temperature_c) > 0
    )
    is_offered = {
        "load": sites.bears_typical_weight or loaded,
        "load on the joints": loaded,
        "external load": external,
        "approach": has_approach,
        "time": has_time,
        "order": not has_time and bool(np.diff(compute_progress(states)).any()),
        "temperature": has_temperature,
    }
    return frozenset(need for need, present in is_offered.items() if present)
