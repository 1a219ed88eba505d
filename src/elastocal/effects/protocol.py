"""What every effect of the catalogue is: candidates, each with named parameters and the displacements that they make.

An effect is a module of this package with

- ``NAME`` and ``FAMILY``, as in the design's table;
- ``WORDS``, its physical name in words that precede "of joint 2", or stand alone where it has no joint;
  ``DETAIL_WORDS``, if the detail of a candidate alone says too little; ``PART = "link"``, if its joints stand for the links
  behind them;
- ``candidates(sites)``, which lists where on this robot the effect can act.

Nothing else knows the effects by name: a new module is a new effect.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from elastocal.mechanics.elastostatics import generalized_forces
from elastocal.mechanics.kinematics import Motion, motion
from elastocal.mechanics.sites import Sites

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
    sized : bool
        Whether the prior's standard deviation was estimated from the readings, not known beforehand.
    """

    name: str
    unit: str
    plausible: float
    prior_std: float | None = None
    sign: int = 0
    order: int = 1
    sized: bool = False


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
    tried : int
        How many evenly spaced values a search must try lest it step over the law, one for the start alone; 0 where a few values
        of growing size will do.
    """

    name: str
    unit: str
    start: float
    lowest: float
    highest: float
    tried: int = 0

    def values(self, few):
        """Values for a search to start from, ndarray: those that must be tried, or a few in geometric series in the range."""
        if self.tried == 1:
            return np.array([self.start])
        if self.tried:
            return np.linspace(self.lowest, self.highest, self.tried)
        return np.geomspace(self.lowest, self.highest, few + 2)[1:-1]

    def between(self, below, above, count):
        """Values inside of an interval, evenly spaced as those that a search tries, ndarray (count,)."""
        return (np.linspace if self.tried else np.geomspace)(below, above, count + 2)[1:-1]

    def shares(self, values):
        """How much of the range each of some values stands for: the part nearest to it, ndarray of sum one."""
        scale = (lambda value: value) if self.tried else np.log
        places = scale(np.asarray(values, float))
        order = np.argsort(places)
        inner = 0.5 * (places[order][1:] + places[order][:-1])
        edges = np.concatenate(
            [[scale(self.lowest)], np.clip(inner, scale(self.lowest), scale(self.highest)), [scale(self.highest)]]
        )
        found = np.empty(len(places))
        found[order] = np.diff(edges) / (edges[-1] - edges[0])
        return found


_REFERENCE_C = 20.0
# Castings of a robot follow their motors and the air in a quarter of an hour to some hours.
_LAG = Shape("lag", "s", 3600.0, 900.0, 36000.0)


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
        What must be there, see `offered`: "load", "external load", "approach", "time", "temperature".
    shapes : tuple of Shape
    distinct_angles : int
        How many different angles of its joints the law needs to be told from a smooth one.
    of_setup : bool
        Whether it belongs to where tracker and robot stood in one campaign, and is not carried over to another.
    place : str
        Names the location beside the joints where these do not: a column, a band of orders. Candidates of one effect at one
        location are variants of its law, of which only one can hold.
    turning : tuple of int
        Joints with whose angles the law goes, counted from 1, where it belongs to no joint.
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
    of_setup: bool = False
    turning: tuple = ()

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


# For each mass that the robot file declares: of the mass itself, and of its first moments along the axes of its frame.
MASS_PARAMETERS = 4


@dataclass(frozen=True)
class Circumstances:
    """Everything that an effect may depend on, for S states of the robot.

    Loads are taken where the robot has yielded to them: at the displaced coordinates behind `motion`, not at the commanded ones
    (the term K_C of Chen and Kao 2000).

    Attributes
    ----------
    sites : Sites
    compliance : ndarray (n,)
        Joint compliances, rad/(N m).
    joint_angles : ndarray (S, n)
        As commanded, rad.
    wrench : ndarray (S, 6)
        N, N m, at the last measuring point, base axes.
    motion : Motion
        Of `Sites.followed`.
    mass_corrections : ndarray (4 m,)
        By how much each of the declared masses is off its robot file, kg, and then its first moments along the axes of its
        frame beyond what goes with the mass, kg m.
    approach : ndarray (S, n) or None
    time_s : ndarray (S,) or None
        Since the first reading to which the model was fitted.
    temperature_c : ndarray (S,) or None
    progress : ndarray (S,)
        How far the campaign had come, from 0 at its first row to 1 at its last: see `progress_of`.
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

    @cached_property
    def load(self):
        """Generalized force of the external wrench on every coordinate of the sites (equation 7), ndarray (S, C).

        N on translations, N m on rotations.
        """
        force, moment = self.wrench.T[:3], self.wrench.T[3:] + np.cross(self.motion.position[0], self.wrench.T[:3], axis=0)
        return self.motion.generalized_forces(self.sites.followed[0].after, force, moment).T

    @cached_property
    def gravity(self):
        """Generalized force of the declared masses on every coordinate of the sites, ndarray (S, C)."""
        sites, corrections = self.sites, self.mass_corrections.reshape(-1, MASS_PARAMETERS)
        masses = np.array([mass.mass_kg for mass in sites.masses]) + corrections[:, 0]
        centres = np.array([mass.centre_m for mass in sites.masses])
        along, rotation = masses[:, None] * centres + corrections[:, 1:], self._body_rotation
        first = sum(along[:, j, None, None] * rotation[:, :, j] for j in range(3))
        first += masses[:, None, None] * self._body_position
        on_each = self._falling[0] * (self._behind @ masses)[:, None]
        for i in range(3):
            on_each += self._falling[1][i] * (self._behind @ first[:, i])
        return self.motion.by_coordinate(on_each).T

    @cached_property
    def total(self):
        """External load and weight of the declared masses on every coordinate of the sites, ndarray (S, C)."""
        return self.load + self.gravity if self.sites.masses else self.load

    @cached_property
    def mass_torques(self):
        """Torque on each joint per unit of each of the `mass_corrections`, ndarray (4 m, S, n)."""
        found = []
        for number, mass in enumerate(self.sites.masses):
            rotation, after = self._body_rotation[number], self.sites.followed[self.sites.joints + 2 + number].after
            centre = self._body_position[number] + np.tensordot(mass.centre_m, rotation, (0, 1))
            found += [self._weighing(after, centre), *(self._weighing(after, rotation[:, axis], 0.0) for axis in range(3))]
        return np.array(found)

    @cached_property
    def weight(self):
        """Torque on each joint of one kilogram at the far end of each link, ndarray (n + 1, S, n)."""
        ends = enumerate(self.sites.followed[1 : self.sites.joints + 2], 1)
        return np.array([self._weighing(end.after, self.motion.position[number]) for number, end in ends])

    def weight_moment(self, link, axis):
        """Torque on each joint of a first moment of one kg m along an axis of the frame at the far end of a link, (S, n)."""
        return self._weighing(self.sites.followed[1 + link].after, self.motion.rotation[1 + link][:, axis], 0.0)

    def _weighing(self, after, first_moment, mass=1.0):
        """Torque on each joint of a mass and its first moment (3, S) behind so many transforms, ndarray (S, n)."""
        moved = self.motion
        joints = slice(np.searchsorted(moved.coordinate, self.sites.joints))
        falling, turning = self._falling
        on_each = mass * falling[joints] + sum(turning[i][joints] * first_moment[i] for i in range(3))
        return moved.by_coordinate(on_each * (moved.place[joints] < after)[:, None]).T

    @cached_property
    def end_rotation(self):
        """Orientation of the last measuring point, ndarray (S, 3, 3)."""
        return np.moveaxis(self.motion.rotation[0], -1, 0)

    @cached_property
    def end_jacobian(self):
        """Of the last measuring point, with respect to the joints, ndarray (S, 6, n)."""
        end = self.sites.followed[0].after
        return np.moveaxis(self.motion.jacobian(end, self.motion.position[0])[:, : self.sites.joints], -1, 0)

    def joint_deflections(self, wrench):
        """Turn of each joint under another wrench at the last measuring point: c J^T w, ndarray (S, n)."""
        return generalized_forces(self.end_jacobian, wrench) * self.compliance

    @property
    def _body_position(self):
        return self.motion.position[self.sites.joints + 2 : len(self.sites.followed)]

    @property
    def _body_rotation(self):
        return self.motion.rotation[self.sites.joints + 2 : len(self.sites.followed)]

    @cached_property
    def _behind(self):
        """Whether each mass is behind each moving transform, ndarray (K, m)."""
        bodies = self.sites.followed[self.sites.joints + 2 :]
        return (self.motion.place[:, None] < [body.after for body in bodies]).astype(float)

    @cached_property
    def _falling(self):
        """Generalized force of gravity on each moving transform by a kilogram behind it at the base's origin, and per metre.

        ndarrays (K, S) and (3, K, S): g . (v + a x r) = g . v + r . (g x a).
        """
        gravity, twist = self.sites.gravity_m_s2, self.motion.twist
        angular = twist[3:]
        turning = [gravity[i - 2] * angular[i - 1] - gravity[i - 1] * angular[i - 2] for i in range(3)]
        return sum(gravity[i] * twist[i] for i in range(3)), turning


def progress_of(states, row_span=None):
    """How far a campaign had come in each state.

    Parameters
    ----------
    states : States
    row_span : (int, int), optional
        First and last row of the campaign; those of the states without. States that have no row come after it.

    Returns
    -------
    ndarray (S,)
        0 at the first row, 1 at the last. Where no rows are known, poses count in the order of their numbers.
    """
    if not len(states) or (states.row is None and row_span is not None):
        return np.ones(len(states))
    place = states.pose if states.row is None else states.row
    first, last = (place.min(), place.max()) if row_span is None else row_span
    return (place - first) / max(last - first, 1)


def circumstances_of(sites, compliance, states, time_zero_s=0.0, mass_corrections=None, row_span=None, coordinates=None):
    """What effects may depend on, in some states.

    Parameters
    ----------
    sites : Sites
    compliance : ndarray (n,)
        rad/(N m).
    states : States
    time_zero_s : float
        From which effects count the time.
    mass_corrections : ndarray (4 m,), optional
        As in `Circumstances`; zero without.
    row_span : (int, int), optional
        As in `progress_of`.
    coordinates : ndarray (S, C), optional
        Where the robot has yielded to; the commanded poses without.

    Returns
    -------
    Circumstances
    """
    if coordinates is None:
        coordinates = np.zeros((len(states), sites.chain.coordinates))
        coordinates[:, : sites.joints] = states.joint_angles
    return Circumstances(
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


def at_coordinates(circumstances, coordinates):
    """The same states where the robot has yielded to other coordinates, ndarray (S, C)."""
    sites = circumstances.sites
    return replace(circumstances, motion=motion(sites.chain, coordinates, sites.followed))


def at_states(circumstances, chosen):
    """Some of the states.

    Parameters
    ----------
    circumstances : Circumstances
    chosen : slice or ndarray of bool (S,)

    Returns
    -------
    Circumstances
    """
    moved = circumstances.motion
    some = replace(
        moved, position=moved.position[..., chosen], rotation=moved.rotation[..., chosen], twist=moved.twist[..., chosen]
    )
    by_state = ("joint_angles", "wrench", "approach", "time_s", "temperature_c", "progress")
    values = {name: getattr(circumstances, name) for name in by_state}
    return replace(
        circumstances, motion=some, **{name: None if value is None else value[chosen] for name, value in values.items()}
    )


def with_springs(circumstances, compliance, mass_corrections):
    """The same states with other joint compliances (n,) and other errors of the declared masses (4 m,)."""
    same = np.array_equal(mass_corrections, circumstances.mass_corrections)
    if same and np.array_equal(compliance, circumstances.compliance):
        return circumstances
    changed = replace(circumstances, compliance=compliance, mass_corrections=mass_corrections)
    # What is known of the loads stays so: they do not depend on the springs but by way of the motion.
    for name in ("load", "gravity", "total", "mass_torques", "_falling", "end_jacobian", "weight"):
        if name in vars(circumstances) and (same or name not in ("gravity", "total")):
            vars(changed)[name] = vars(circumstances)[name]
    return changed


def offered(sites, states):
    """What is there that effects may need.

    Parameters
    ----------
    sites : Sites
    states : States

    Returns
    -------
    frozenset of str
        "load": an external load, or declared masses, whose weight loads the joints too; "external load", without which
        nothing tells the compliances; "approach", where it is known somewhere; "time" and "temperature", where they change.
    """
    there = {
        "load": bool(sites.masses) or bool(states.wrench.any()),
        "external load": bool(states.wrench.any()),
        "approach": states.approach is not None and bool(states.approach.any()),
        "time": states.time_s is not None and np.ptp(states.time_s) > 0,
        "temperature": states.temperature_c is not None and np.ptp(states.temperature_c) > 0,
    }
    return frozenset(name for name, present in there.items() if present)


def per_joint(sites, make, prismatic=False):
    """Candidates of an effect that acts on one joint at a time: ``make(joint index from 0)`` for each.

    Parameters
    ----------
    sites : Sites
    make : callable
    prismatic : bool
        Whether the effect has a meaning for prismatic joints; most of them are about what turns.

    Returns
    -------
    list of Candidate
    """
    return [make(joint) for joint in range(sites.joints) if prismatic or not sites.prismatic[joint]]


def by_warmth(candidate_of):
    """Candidates of an effect of warmth: by the temperature where it was measured, and by the time since the campaign began.

    Parameters
    ----------
    candidate_of : callable
        ``candidate_of(cause, rise, needs, shapes)`` gives a candidate; ``rise(circumstances, *shapes)`` is by how much it is
        warmer, ndarray (S,): in K from 20 °C, at which dimensions are stated (ISO 1), or the share of a first order lag.

    Returns
    -------
    list of Candidate
    """

    def by_temperature(circumstances):
        return circumstances.temperature_c - _REFERENCE_C

    def by_time(circumstances, lag):
        return -np.expm1(-circumstances.time_s / lag)

    return [
        candidate_of("temperature", by_temperature, frozenset({"temperature"}), ()),
        candidate_of("time", by_time, frozenset({"time"}), (_LAG,)),
    ]


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
    """Torque of the rated payload, or of a kilonewton, at the end of the outstretched arm and of the weight of its links.

    By it laws of gears are scaled.

    Parameters
    ----------
    sites : Sites
    joint : int
        From 0.

    Returns
    -------
    float
    """
    pull = _PULL_N if sites.payload_kg is None else sites.payload_kg * float(np.linalg.norm(sites.gravity_m_s2))
    return pull * lever_m(sites, joint) + sites.longest_weight_torque_Nm(joint)
