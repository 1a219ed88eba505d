"""What effects may depend on in each state of the robot: its loads, its motion, the approach, time and temperature.

The load on each coordinate is the generalized force J^T w of a wrench w (N, N m) by the principle of virtual work (Siciliano et
al. 2009).
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
    from collections.abc import Iterator

    from elastocal.fitting.observations import States

    Coordinates = slice | list[int] | np.ndarray

# For each mass that the robot file declares: of the mass itself, and of its first moments along the axes of its frame.
MASS_PARAMETERS = 4


@dataclass(frozen=True)
class Conditions:
    """Everything that an effect may depend on, for S states of the robot.

    Loads are taken where the robot has yielded to them: at the displaced coordinates behind `motion`, not at the commanded ones
    (the term K_C of the conservative congruence transformation (Chen and Kao 2000)).

    `compliance` (n,): joint compliances, rad/(N m). `joint_angles` (S, n): as commanded, rad. `wrench` (S, 6): N, N m, at the
    last measuring point, base axes. `motion`: of `Sites.followed`. `mass_corrections` (4 m,): by how much each of the declared
    masses is off its robot file, kg, and then its first moments along the axes of its frame beyond what goes with the mass, kg
    m. `approach` (S, n). `time_s` (S,): since the first measurement to which the model was fitted. `temperature_c` (S,).
    `progress` (S,): how far the campaign had come, from 0 at its first row to 1 at its last: see `progress_of`. `of_angles`:
    laws that go with the joint angles alone, by the keys of their candidates; shared wherever the same states are under other
    loads: see `Candidate.fixed`.
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
        """Generalized force (N, N m) of the external wrench on every coordinate of the sites (equation 7), ndarray (S, C)."""
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
        along, rotation = masses[:, None] * centres + corrections[:, 1:], self.motion.rotation[self._bodies]
        first = sum(along[:, j, None, None] * rotation[:, :, j] for j in range(3))
        return self._gravity_of(masses, first + masses[:, None, None] * self.motion.position[self._bodies], self._behind)

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
        return on_each.T

    def gravity_of_corrections(self, coordinates: Coordinates) -> Iterator[np.ndarray]:
        """By how much `gravity` on some coordinates grows with each of the `mass_corrections`, per unit.

        Yields (number of the coordinates, S).
        """
        on = self._falling_on(coordinates)
        for number in range(len(self.mass_corrections)):
            body, kind = divmod(number, MASS_PARAMETERS)
            rotation, after = self.motion.rotation[self._bodies][body], self.sites.followed[self._bodies][body].after
            if kind:
                yield _weighing(*on, after, rotation[:, kind - 1])
            else:
                centre = np.tensordot(self.sites.masses[body].centre_m, rotation, (0, 1))
                yield _weighing(*on, after, self.motion.position[self._bodies][body] + centre, 1.0)

    @cached_property
    def total(self) -> np.ndarray:
        """External load and weight of the declared masses, or of usual ones, on every coordinate of the sites, (S, C)."""
        if self.sites.usual_weight:
            return self.load + self.usual_gravity
        return self.load + self.gravity if self.sites.masses else self.load

    @cached_property
    def mass_torques(self) -> np.ndarray:
        """Torque on each joint per unit of each of the `mass_corrections`, ndarray (4 m, S, n)."""
        return np.array(list(self.gravity_of_corrections(slice(self.sites.joints)))).swapaxes(1, 2)

    @cached_property
    def weight(self) -> np.ndarray:
        """Torque on each joint of one kilogram at the far end of each link, ndarray (n + 1, S, n)."""
        on, ends = self._falling_on(slice(self.sites.joints)), self.sites.followed[1 : self.sites.joints + 2]
        return np.array([_weighing(*on, end.after, r, 1.0).T for end, r in zip(ends, self.motion.position[1:], strict=False)])

    def weight_moment(self, link: int, axis: int) -> np.ndarray:
        """Torque on each joint of a first moment of one kg m along an axis of the frame at the far end of a link, (S, n)."""
        on, after = self._falling_on(slice(self.sites.joints)), self.sites.followed[1 + link].after
        return _weighing(*on, after, self.motion.rotation[1 + link][:, axis]).T

    def _falling_on(self, coordinates: Coordinates) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        """What `_weighing` needs of some coordinates."""
        return self._falling[0][coordinates], [each[coordinates] for each in self._falling[1]], self.motion.place[coordinates]

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
    def _bodies(self) -> slice:
        """Of what has a mass among the points that `motion` follows."""
        return slice(self.sites.joints + 2, len(self.sites.followed))

    @cached_property
    def _behind(self) -> np.ndarray:
        """Whether each mass is behind each moving transform, ndarray (K, m)."""
        return (self.motion.place[:, None] < [body.after for body in self.sites.followed[self._bodies]]).astype(float)

    @cached_property
    def _falling(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Generalized force of gravity on each moving transform by a kilogram behind it at the base's origin, and per metre.

        ndarrays (K, S) and (3, K, S): g . (v + a x r) = g . v + r . (g x a).
        """
        gravity, twist = self.sites.gravity_m_s2, self.motion.twist
        angular = twist[3:]
        turning = [gravity[i - 2] * angular[i - 1] - gravity[i - 1] * angular[i - 2] for i in range(3)]
        return sum(gravity[i] * twist[i] for i in range(3)), turning


def _weighing(
    falling: np.ndarray, turning: list[np.ndarray], place: np.ndarray, after: int, first_moment: np.ndarray, mass: float = 0.0
) -> np.ndarray:
    """Force on some coordinates of a mass and its first moment (3, S) behind so many transforms, ndarray (., S)."""
    on_each = np.asarray(sum(turning[i] * first_moment[i] for i in range(3)))
    if mass:
        on_each += mass * falling
    on_each[place >= after] = 0.0
    return on_each


def progress_of(states: States, row_span: tuple[int, int] | None = None) -> np.ndarray:
    """How far a campaign had come in each state, ndarray (S,): 0 at its first row, 1 at its last.

    `row_span` (int, int): these rows; those of the states without. States that have no row come after them. Where no rows are
    known, poses count in the order of their numbers.
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
    """Some of the states; `chosen` (S,) of bool."""
    moved = conditions.motion
    some = replace(moved, **{name: getattr(moved, name)[..., chosen] for name in ("position", "rotation", "twist")})
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
    external = bool(states.wrench.any())
    loaded = bool(sites.masses) or external
    there = {
        "load": sites.usual_weight or loaded,
        "load on the joints": loaded,
        "external load": external,
        "approach": states.approach is not None and bool(states.approach.any()),
        "time": states.time_s is not None and np.ptp(states.time_s) > 0,
        "temperature": states.temperature_c is not None and np.ptp(states.temperature_c) > 0,
    }
    return frozenset(name for name, present in there.items() if present)
