"""What effects may depend on in each state of the robot: its loads, its motion, the approach, time and temperature.

The load on each coordinate is the generalized force J^T w of a wrench w (N, N m) by the principle of virtual work [1].

[1] B. Siciliano, L. Sciavicco, L. Villani and G. Oriolo, Robotics: Modelling, Planning and Control, Springer, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import generalized_forces
from elastocal.mechanics.kinematics import Motion, cross, motion
from elastocal.mechanics.sites import Sites

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Protocol

    class States(Protocol):
        """Poses, loads and senses of approach as they were measured, see `Conditions`; arrays of S."""

        @property
        def pose(self) -> np.ndarray: ...
        @property
        def joint_angles(self) -> np.ndarray: ...
        @property
        def wrench(self) -> np.ndarray: ...
        @property
        def approach(self) -> np.ndarray | None: ...
        @property
        def time_s(self) -> np.ndarray | None: ...
        @property
        def temperature_c(self) -> np.ndarray | None: ...
        @property
        def row(self) -> np.ndarray | None: ...
        def __len__(self) -> int: ...


# For each mass that the robot file declares: of the mass itself, and of its first moments along the axes of its frame.
MASS_PARAMETERS = 4


@dataclass(frozen=True)
class Conditions:
    """Everything that an effect may depend on, for S states of the robot.

    Loads are taken where the robot has yielded to them: at the displaced coordinates behind `motion`, not at the commanded ones
    (the term K_C of the conservative congruence transformation [1]).

    `compliance` (n,): joint compliances, rad/(N m). `joint_angles` (S, n): as commanded, rad. `wrench` (S, 6): N, N m, at the
    last measuring point, base axes. `motion`: of `Sites.followed`. `mass_corrections` (4 m,): by how much each of the declared
    masses is off its robot file, kg, and then its first moments along the axes of its frame beyond what goes with the mass, kg
    m. `approach` (S, n). `time_s` (S,): since the first measurement to which the model was fitted. `temperature_c` (S,).
    `progress` (S,): how far the campaign had come, from 0 at its first row to 1 at its last: see `progress_of`. `of_angles`:
    laws that go with the joint angles alone, by the keys of their candidates; shared wherever the same states are under other
    loads: see `Candidate.fixed`.

    [1] S.-F. Chen and I. Kao, Conservative congruence transformation for joint and Cartesian stiffness matrices of robotic
        hands and fingers, International Journal of Robotics Research 19, 2000.
    """

    sites: Sites
    compliance: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    motion: Motion
    mass_corrections: np.ndarray
    approach: np.ndarray | None = None
    time_s: np.ndarray | None = None
    temperature_c: np.ndarray | None = None
    progress: np.ndarray | None = None
    of_angles: dict[str, list[dict[int, np.ndarray]]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def always(self) -> np.ndarray:
        """One in every state, ndarray (S,)."""
        return np.ones(len(self.joint_angles))

    @cached_property
    def load(self) -> np.ndarray:
        """Generalized force of the external wrench on every coordinate of the sites (equation 7), ndarray (S, C).

        N on translations, N m on rotations.
        """
        force, moment = self.wrench.T[:3], np.empty((3, len(self.wrench)))
        cross(self.motion.position[0], force, moment)
        moment += self.wrench.T[3:]
        return self.motion.generalized_forces(self.sites.followed[0].after, force, moment).T

    @cached_property
    def gravity(self) -> np.ndarray:
        """Generalized force of the declared masses on every coordinate of the sites, ndarray (S, C)."""
        sites, corrections = self.sites, self.mass_corrections.reshape(-1, MASS_PARAMETERS)
        masses = np.array([mass.mass_kg for mass in sites.masses]) + corrections[:, 0]
        centres = np.array([mass.centre_m for mass in sites.masses])
        along, rotation = masses[:, None] * centres + corrections[:, 1:], self._body_rotation
        first = sum(along[:, j, None, None] * rotation[:, :, j] for j in range(3))
        return self._gravity_of(masses, first + masses[:, None, None] * self._body_position, self._behind)

    @cached_property
    def usual_gravity(self) -> np.ndarray:
        """Generalized force of the usual masses on every coordinate beyond the joints, whose sag has its own law; (S, C)."""
        masses, ends = self.sites.usual_masses, self.sites.followed[1 : self.sites.joints + 2]
        first = masses[:, None, None] * self.motion.position[1 : len(ends) + 1]
        found = self._gravity_of(masses, first, (self.motion.place[:, None] < [end.after for end in ends]).astype(float))
        found[:, : self.sites.joints] = 0.0
        return found

    def _gravity_of(self, masses: np.ndarray, first: np.ndarray, behind: np.ndarray) -> np.ndarray:
        """By masses (m,), their first moments (m, 3, S), and which are behind each moving transform (K, m); (S, C)."""
        on_each = self._falling[0] * (behind @ masses)[:, None]
        for i in range(3):
            on_each += self._falling[1][i] * (behind @ first[:, i])
        return self.motion.by_coordinate(on_each).T

    def gravity_of_corrections(self, coordinates: Sequence[int]) -> Iterator[np.ndarray]:
        """By how much `gravity` on some coordinates, in rising order, grows with each of the `mass_corrections`, per unit.

        Yields (number of the coordinates, S).
        """
        moved = self.motion
        chosen = np.flatnonzero(np.isin(moved.coordinate, coordinates))
        place, row = moved.place[chosen], np.searchsorted(coordinates, moved.coordinate[chosen])
        falling, turning = self._falling[0][chosen], [each[chosen] for each in self._falling[1]]
        for number in range(len(self.mass_corrections)):
            after, first_moment, mass = self._correction(number)
            on_each = sum(turning[i] * first_moment[i] for i in range(3))
            if mass:
                on_each += mass * falling
            on_each[place >= after] = 0.0
            if len(chosen) == len(coordinates):
                yield on_each
            else:
                on_coordinates = np.zeros((len(coordinates), on_each.shape[1]))
                np.add.at(on_coordinates, row, on_each)
                yield on_coordinates

    @cached_property
    def total(self) -> np.ndarray:
        """External load and weight of the declared masses, or of usual ones, on every coordinate of the sites, (S, C)."""
        if self.sites.usual_weight:
            return self.load + self.usual_gravity
        return self.load + self.gravity if self.sites.masses else self.load

    @cached_property
    def mass_torques(self) -> np.ndarray:
        """Torque on each joint per unit of each of the `mass_corrections`, ndarray (4 m, S, n)."""
        moved, bodies, centres = self.motion, self._body_rotation, np.array([mass.centre_m for mass in self.sites.masses])
        chosen = slice(np.searchsorted(moved.coordinate, self.sites.joints))
        falling, turning = self._falling
        first = np.empty((len(bodies), MASS_PARAMETERS, *bodies.shape[1:2], bodies.shape[-1]))
        first[:, 1:] = bodies.swapaxes(1, 2)
        first[:, 0] = self._body_position + (bodies * centres[:, None, :, None]).sum(axis=2)
        on_each = turning[0][chosen] * first[:, :, 0, None]
        for i in (1, 2):
            on_each += turning[i][chosen] * first[:, :, i, None]
        on_each[:, 0] += falling[chosen]
        on_each *= self._behind[chosen].T[:, None, :, None]
        found = moved.by_coordinate(on_each)
        return found.reshape(-1, *found.shape[2:]).swapaxes(1, 2)

    @cached_property
    def weight(self) -> np.ndarray:
        """Torque on each joint of one kilogram at the far end of each link, ndarray (n + 1, S, n)."""
        ends = enumerate(self.sites.followed[1 : self.sites.joints + 2], 1)
        return np.array([self._weighing(end.after, self.motion.position[number]) for number, end in ends])

    def weight_moment(self, link: int, axis: int) -> np.ndarray:
        """Torque on each joint of a first moment of one kg m along an axis of the frame at the far end of a link, (S, n)."""
        return self._weighing(self.sites.followed[1 + link].after, self.motion.rotation[1 + link][:, axis], 0.0)

    def _correction(self, number: int) -> tuple[int, np.ndarray, float]:
        """Of what one of the `mass_corrections` adds: how many transforms come before it, its first moment (3, S), its mass."""
        body, kind = divmod(number, MASS_PARAMETERS)
        rotation, after = self._body_rotation[body], self.sites.followed[self.sites.joints + 2 + body].after
        if kind:
            return after, rotation[:, kind - 1], 0.0
        return after, self._body_position[body] + np.tensordot(self.sites.masses[body].centre_m, rotation, (0, 1)), 1.0

    def _weighing(self, after: int, first_moment: np.ndarray, mass: float = 1.0) -> np.ndarray:
        """Torque on each joint of a mass and its first moment (3, S) behind so many transforms, ndarray (S, n)."""
        moved = self.motion
        chosen = slice(np.searchsorted(moved.coordinate, self.sites.joints))
        falling, turning = self._falling
        on_each = mass * falling[chosen] + sum(turning[i][chosen] * first_moment[i] for i in range(3))
        return moved.by_coordinate(on_each * (moved.place[chosen] < after)[:, None]).T

    @cached_property
    def end_rotation(self) -> np.ndarray:
        """Orientation of the last measuring point, ndarray (S, 3, 3)."""
        return np.moveaxis(self.motion.rotation[0], -1, 0)

    @cached_property
    def end_jacobian(self) -> np.ndarray:
        """Of the last measuring point, with respect to the joints, ndarray (S, 6, n)."""
        end = self.sites.followed[0].after
        return np.moveaxis(self.motion.jacobian(end, self.motion.position[0])[:, : self.sites.joints], -1, 0)

    def joint_deflections(self, wrench: np.ndarray) -> np.ndarray:
        """Turn of each joint under another wrench at the last measuring point: c J^T w, ndarray (S, n)."""
        return generalized_forces(self.end_jacobian, wrench) * self.compliance

    @property
    def _body_position(self) -> np.ndarray:
        return self.motion.position[self.sites.joints + 2 : len(self.sites.followed)]

    @property
    def _body_rotation(self) -> np.ndarray:
        return self.motion.rotation[self.sites.joints + 2 : len(self.sites.followed)]

    @cached_property
    def _behind(self) -> np.ndarray:
        """Whether each mass is behind each moving transform, ndarray (K, m)."""
        bodies = self.sites.followed[self.sites.joints + 2 :]
        return (self.motion.place[:, None] < [body.after for body in bodies]).astype(float)

    @cached_property
    def _falling(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Generalized force of gravity on each moving transform by a kilogram behind it at the base's origin, and per metre.

        ndarrays (K, S) and (3, K, S): g . (v + a x r) = g . v + r . (g x a).
        """
        gravity, twist = self.sites.gravity_m_s2, self.motion.twist
        angular = twist[3:]
        turning = [gravity[i - 2] * angular[i - 1] - gravity[i - 1] * angular[i - 2] for i in range(3)]
        return sum(gravity[i] * twist[i] for i in range(3)), turning


def progress_of(states: States, row_span: tuple[int, int] | None = None) -> np.ndarray:
    """How far a campaign had come in each state.

    `row_span` (int, int): first and last row of the campaign; those of the states without. States that have no row come after
    it. Returns (S,): 0 at the first row, 1 at the last. Where no rows are known, poses count in the order of their numbers.
    """
    if not len(states) or (states.row is None and row_span is not None):
        return np.ones(len(states))
    place = states.pose if states.row is None else states.row
    first, last = (place.min(), place.max()) if row_span is None else row_span
    return (place - first) / max(last - first, 1)


def conditions_of(
    sites: Sites,
    compliance: np.ndarray,
    states: States,
    time_zero_s: float = 0.0,
    mass_corrections: np.ndarray | None = None,
    row_span: tuple[int, int] | None = None,
    coordinates: np.ndarray | None = None,
) -> Conditions:
    """What effects may depend on, in some states.

    `compliance` (n,): rad/(N m). `time_zero_s`: from which effects count the time. `mass_corrections` (4 m,): as in
    `Conditions`; zero without. `row_span` (int, int): as in `progress_of`. `coordinates` (S, C): where the robot has yielded
    to; the commanded poses without.
    """
    if coordinates is None:
        coordinates = sites.chain.at(states.joint_angles)
    return Conditions(
        sites,
        np.asarray(compliance),
        states.joint_angles,
        states.wrench,
        motion(sites.chain, coordinates, sites.followed),
        np.zeros(MASS_PARAMETERS * len(sites.masses)) if mass_corrections is None else mass_corrections,
        states.approach,
        None if states.time_s is None else states.time_s - time_zero_s,
        states.temperature_c,
        progress_of(states, row_span),
    )


def at_coordinates(conditions: Conditions, coordinates: np.ndarray) -> Conditions:
    """The same states where the robot has yielded to other coordinates, ndarray (S, C)."""
    sites = conditions.sites
    return replace(conditions, motion=motion(sites.chain, coordinates, sites.followed))


def at_states(conditions: Conditions, chosen: slice | np.ndarray) -> Conditions:
    """Some of the states.

    `chosen` (S,) of bool.
    """
    moved = conditions.motion
    some = replace(
        moved, position=moved.position[..., chosen], rotation=moved.rotation[..., chosen], twist=moved.twist[..., chosen]
    )

    columns = ("joint_angles", "wrench", "approach", "time_s", "temperature_c", "progress")
    kept = {name: values[chosen] for name in columns if (values := getattr(conditions, name)) is not None}
    return replace(conditions, motion=some, of_angles={}, **kept)


def with_springs(conditions: Conditions, compliance: np.ndarray, mass_corrections: np.ndarray) -> Conditions:
    """The same states with other joint compliances (n,) and other errors of the declared masses (4 m,)."""
    same = np.array_equal(mass_corrections, conditions.mass_corrections)
    if same and np.array_equal(compliance, conditions.compliance):
        return conditions
    changed = replace(conditions, compliance=compliance, mass_corrections=mass_corrections)
    # What is known of the loads stays so: they do not depend on the springs but by way of the motion.
    for name in ("load", "gravity", "total", "mass_torques", "_falling", "_behind", "end_jacobian", "weight"):
        if name in vars(conditions) and (same or name not in ("gravity", "total")):
            vars(changed)[name] = vars(conditions)[name]
    return changed


def with_total(conditions: Conditions, total: np.ndarray) -> Conditions:
    """The same states under another `Conditions.total` load, ndarray (S, C), whatever makes it."""
    changed = replace(conditions)
    vars(changed).update(vars(conditions) | {"total": total})
    return changed


def offered(sites: Sites, states: States) -> frozenset[str]:
    """What is there that effects may need.

    Returns "load": an external load or a weight; "load on the joints": that, or declared masses; "external load", without which
    the compliances are not identifiable; "approach", where it is known somewhere; "time" and "temperature", where they change.
    """
    loaded = bool(sites.masses) or bool(states.wrench.any())
    there = {
        "load": sites.usual_weight or loaded,
        "load on the joints": loaded,
        "external load": bool(states.wrench.any()),
        "approach": states.approach is not None and bool(states.approach.any()),
        "time": states.time_s is not None and np.ptp(states.time_s) > 0,
        "temperature": states.temperature_c is not None and np.ptp(states.temperature_c) > 0,
    }
    return frozenset(name for name, present in there.items() if present)
