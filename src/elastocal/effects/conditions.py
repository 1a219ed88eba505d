"""What effects may depend on in each state of the robot: its loads, its motion, the
approach, time and temperature.

The load on each coordinate is the generalized force J^T w of a wrench w (N, N m) by the
principle of virtual work (Siciliano et al. 2009).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import Motion, compute_motion, multiply_vectors
from elastocal.mechanics.sites import Sites

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.observations import States

# Parameters of each mass that the robot file declares: the mass itself, and its first
# moments along the three axes of its frame.
MASS_PARAMETERS = 4


@dataclass(frozen=True)
class Conditions:
    """Everything that an effect may depend on, for S states of the robot.

    Loads are taken where the robot has yielded to them: at the displaced coordinates
    behind `motion`, not at the commanded ones (the term K_C of the conservative
    congruence transformation (Chen and Kao 2000)).

    `compliance` (n,): joint compliances, rad/(N m). `joint_angles` (S, n): as
    commanded, rad. `wrench` (S, 6): N, N m, at the last measuring point, base axes.
    `motion`: of `Sites.tracked_points`. `mass_corrections` (4 m,): by how much each of the
    declared masses is off its robot file, kg, and then its first moments along the axes
    of its frame beyond what goes with the mass, kg m. `approach` (S, n). `time_s` (S,):
    since the first measurement to which the model was fitted. `temperature_c` (S,).
    These three are NaN where they are not known; no law reads them that does not need
    them. `progress` (S,): how far the campaign had come, from 0 at its first row to 1
    at its last: see `progress_of`. `of_angles`: laws that go with the joint angles
    alone, by the keys of their candidates; shared wherever the same states are under
    other loads: see `Candidate.fixed`.
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
    of_angles: dict[str, list[dict[int, np.ndarray]]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def always(self) -> np.ndarray:
        """One in every state, ndarray (S,)."""
        return np.ones(len(self.joint_angles))

    @cached_property
    def load(self) -> np.ndarray:
        """Generalized force (N, N m) of the external wrench on every coordinate of the
        sites (equation 7), ndarray (S, C)."""
        return self.load_by(self.wrench)

    def load_by(
        self, wrench: np.ndarray, coordinates: slice = slice(None)
    ) -> np.ndarray:
        """The same by another wrench (S, 6) at the last measuring point, on some of the
        coordinates, ndarray (S, .)."""
        acting = wrench.T.copy()
        acting[3:] += np.cross(self.motion.position[0], acting[:3], axis=0)
        return self.motion.generalized_forces(
            self.sites.tracked_points[0].after, acting, coordinates
        ).T

    @cached_property
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
            wrench = self._falling(
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
        """By how much `gravity` on some coordinates, in the order of the chain, grows
        with the `mass_corrections`, per unit.

        Yields for each mass (4, K', S), of the first of the coordinates, which it
        loads.
        """
        place = self.motion.transform_index[coordinates]
        twist = self.motion.twist[:, coordinates]
        gravity = np.array(self.sites.gravity_m_s2)
        by_kilogram = np.tensordot(gravity, twist[:3], 1)
        for body, mass in enumerate(self.sites.masses, self.sites.joints + 2):
            rotation = self.motion.rotation[body]
            loaded = np.searchsorted(place, self.sites.tracked_points[body].after)
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
            forces[0] += by_kilogram[:loaded]
            yield forces

    def _falling(self, mass: float, first: np.ndarray) -> np.ndarray:
        """Wrench of gravity on a mass and its first moment about the base's origin (3,
        S), ndarray (6, S)."""
        wrench = np.empty((6, first.shape[1]))
        gravity = np.array(self.sites.gravity_m_s2)[:, None]
        wrench[:3] = mass * gravity
        multiply_vectors(first, gravity, wrench[3:])
        return wrench

    @cached_property
    def usual_gravity(self) -> np.ndarray:
        """Generalized force of the usual masses on every coordinate beyond the joints,
        whose sag has its own law; (S, C)."""
        found = np.zeros((self.motion.transform_index.size, len(self.wrench)))
        for end, mass in enumerate(self.sites.typical_masses_kg, 1):
            falling = self._falling(mass, mass * self.motion.position[end])
            found += self.motion.generalized_forces(
                self.sites.tracked_points[end].after, falling
            )
        found[: self.sites.joints] = 0.0
        return found.T

    @cached_property
    def total(self) -> np.ndarray:
        """External load and weight of the declared masses, or of usual ones, on every
        coordinate of the sites, (S, C)."""
        if self.sites.bears_typical_weight:
            weight = self.usual_gravity
        elif self.sites.masses:
            weight = self.gravity
        else:
            return self.load + 0.0
        # Without a wrench the load is zero and need not be computed.
        return self.load + weight if self.wrench.any() else weight

    @cached_property
    def mass_torques(self) -> np.ndarray:
        """Torque on each joint per unit of each of the `mass_corrections`, ndarray (4
        m, S, n)."""
        found = np.zeros(
            (
                len(self.sites.masses),
                MASS_PARAMETERS,
                self.sites.joints,
                len(self.wrench),
            )
        )
        for each, forces in zip(
            found, self.gravity_of_corrections(slice(self.sites.joints)), strict=True
        ):
            each[:, : forces.shape[1]] = forces
        return found.reshape(-1, *found.shape[2:]).swapaxes(1, 2)

    def weight(self, link: int, axis: int | None = None) -> np.ndarray:
        """Torque on each joint of a kilogram at the far end of a link, or of a kilogram
        metre along an axis there, (S, n)."""
        end = 1 + link
        first = (
            self.motion.position[end]
            if axis is None
            else self.motion.rotation[end, :, axis]
        )
        falling = self._falling(float(axis is None), first)
        return self.motion.generalized_forces(
            self.sites.tracked_points[end].after, falling, slice(self.sites.joints)
        ).T


def compute_progress(
    states: States, row_span: tuple[int, int] | None = None
) -> np.ndarray:
    """How far a campaign had come in each state, ndarray (S,): 0 at its first row, 1 at
    its last.

    `row_span` (int, int): these rows; those of the states without. States that have no
    row come after them. Where no rows are known, poses count in the order of their
    numbers.
    """
    if not len(states) or (states.row is None and row_span is not None):
        return np.ones(len(states))
    place = states.pose if states.row is None else states.row
    first, last = (place.min(), place.max()) if row_span is None else row_span
    return (place - first) / max(last - first, 1)


def build_conditions(
    sites: Sites,
    compliance: np.ndarray,
    states: States,
    time_zero_s: float = 0.0,
    mass_corrections: np.ndarray | None = None,
    row_span: tuple[int, int] | None = None,
    coordinates: np.ndarray | None = None,
) -> Conditions:
    """What effects may depend on, in some states.

    `compliance` (n,): rad/(N m). `time_zero_s`: from which effects count the time.
    `mass_corrections` (4 m,): as in `Conditions`; zero without. `row_span` (int, int):
    as in `progress_of`. `coordinates` (S, C): where the robot has yielded to; the
    commanded poses without.
    """
    if coordinates is None:
        coordinates = sites.chain.at(states.joint_angles)
    unknown = np.full(states.joint_angles.shape, np.nan)
    return Conditions(
        sites,
        np.asarray(compliance),
        states.joint_angles,
        states.wrench,
        compute_motion(sites.chain, coordinates, sites.tracked_points),
        np.zeros(MASS_PARAMETERS * len(sites.masses))
        if mass_corrections is None
        else mass_corrections,
        unknown if states.approach is None else states.approach,
        unknown[:, 0] if states.time_s is None else states.time_s - time_zero_s,
        unknown[:, 0] if states.temperature_c is None else states.temperature_c,
        compute_progress(states, row_span),
    )


def select_conditions(conditions: Conditions, chosen: slice | np.ndarray) -> Conditions:
    """Some of the states; `chosen` (S,) of bool."""
    moved = conditions.motion
    some = replace(
        moved,
        **{
            name: getattr(moved, name)[..., chosen]
            for name in ("position", "rotation", "twist")
        },
    )
    columns = (
        "joint_angles",
        "wrench",
        "approach",
        "time_s",
        "temperature_c",
        "progress",
    )
    kept = {name: getattr(conditions, name)[chosen] for name in columns}
    return replace(conditions, motion=some, of_angles={}, **kept)


def replace_springs(
    conditions: Conditions, compliance: np.ndarray, mass_corrections: np.ndarray
) -> Conditions:
    """The same states with other joint compliances (n,) and other errors of the
    declared masses (4 m,)."""
    same = np.array_equal(mass_corrections, conditions.mass_corrections)
    if same and np.array_equal(compliance, conditions.compliance):
        return conditions
    changed = replace(
        conditions, compliance=compliance, mass_corrections=mass_corrections
    )
    # What is known of the loads stays so: they do not depend on the springs but by way
    # of the motion.
    for name in ("load", "gravity", "total", "mass_torques"):
        if name in vars(conditions) and (same or name not in ("gravity", "total")):
            vars(changed)[name] = vars(conditions)[name]
    return changed


def replace_total_load(conditions: Conditions, total: np.ndarray) -> Conditions:
    """The same states under another `Conditions.total` load, ndarray (S, C), whatever
    makes it."""
    changed = replace(conditions)
    vars(changed).update(vars(conditions) | {"total": total})
    return changed


def find_offered_needs(sites: Sites, states: States) -> frozenset[str]:
    """List which needs of effects the data meet.

    Returns
    -------
    "load" for an external load or a weight; "load on the joints" for an external load
    or declared masses; "external load", without which the compliances are not
    identifiable; "approach" if it is known in some state; "time" and "temperature" if
    they change.
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
        "temperature": has_temperature,
    }
    return frozenset(need for need, present in is_offered.items() if present)
