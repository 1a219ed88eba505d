"""The composite measurement model: nominal robot + frames + targets + any set of effects, with exact poses and sensitivities.

Effects move the robot through the coordinates of its `Sites`; the exact kinematics of that chain predicts every reading, and
the chain's Jacobian times the displacement per parameter is the sensitivity. Residuals are in base axes, whatever frame was
measured in. Springs yield to the total load, the external one and the weight that the robot file declares, taken where the
robot has yielded to it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.effects import declared_weight
from elastocal.effects.circumstances import MASS_PARAMETERS, Circumstances, at_coordinates, circumstances_of, with_springs
from elastocal.effects.joint_compliance import candidate as joint_compliance
from elastocal.effects.protocol import Parameter
from elastocal.mechanics.kinematics import poses_of_points
from elastocal.mechanics.motion import motion
from elastocal.mechanics.pose_differences import pose_differences
from elastocal.mechanics.sites import Sites, sites_of

_LENGTH = ("dx", "dy", "dz")
_TURN = ("rx", "ry", "rz")
# Frames and targets may be anywhere in a workshop.
_ANYWHERE_M, _ANYWHERE_RAD = 1.0, 1.0
# Relative step of the central difference in a shape parameter.
_SHAPE_STEP = 1e-4
# Of the forward difference in what loads the springs, in plausible sizes: laws of gears bend little over that.
_SPRING_STEP = 1e-4
# Fixed-point iterations of the load at the displaced pose. Each shrinks what is left by deflection over reach, some 1 / 500 at
# 3 kN, from ten micrometres at the commanded pose.
_PASSES = 2


@dataclass(frozen=True)
class Model:
    """What is taken to make the readings.

    Attributes
    ----------
    sites : Sites
    targets : tuple of Target
        As in the campaign; those without an offset are fitted.
    fitted_frames : bool
        Whether the placement of the base is unknown, one for each session.
    rows : int
        3 where positions are measured, 6 where poses are.
    nominal_compliance : ndarray (n,)
        rad/(N m).
    effects : tuple of Candidate
        Joint compliances, where they are identified, and errors of declared masses, where there are any, among them.
    time_zero_s : float
        From which effects count the time: the first reading to be fitted.
    row_span : (int, int) or None
        First and last row of the readings to be fitted, between which the campaign made its progress.
    """

    sites: Sites
    targets: tuple
    fitted_frames: bool
    rows: int
    nominal_compliance: np.ndarray
    effects: tuple = ()
    time_zero_s: float = 0.0
    row_span: tuple | None = None

    @property
    def identifies_compliance(self):
        """Whether the joint compliances are parameters."""
        return any(effect.effect == "joint_compliance" for effect in self.effects)

    def with_effects(self, effects):
        """The same model with more effects."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Estimate:
    """Values of everything that a model leaves open.

    Attributes
    ----------
    sessions : tuple of int
    frame_rotation, frame_position : ndarray (K, 3, 3), (K, 3)
        Placement of the base in the frame of each session.
    target_offset, target_rotation : ndarray (T, 3), (T, 3, 3)
        Each target in the frame of its measuring point, m.
    coefficients : tuple of ndarray
        Linear parameters of each effect.
    shapes : tuple of ndarray
        Shape parameters of each effect.
    """

    sessions: tuple
    frame_rotation: np.ndarray
    frame_position: np.ndarray
    target_offset: np.ndarray
    target_rotation: np.ndarray
    coefficients: tuple = ()
    shapes: tuple = ()

    def with_effects(self, effects):
        """The same estimate with more effects, all of them at zero."""
        return replace(
            self,
            coefficients=(*self.coefficients, *(np.zeros(len(effect.parameters)) for effect in effects)),
            shapes=(*self.shapes, *(np.array([shape.start for shape in effect.shapes]) for effect in effects)),
        )


@dataclass(frozen=True)
class Linearization:
    """A model about an estimate, for M observations.

    Attributes
    ----------
    residual : ndarray (M, rows)
        Measured less predicted, base axes, m and rad.
    coordinate_jacobian : ndarray (M, rows, C)
        Of each target with respect to the coordinates of the sites.
    sensitivities : ndarray (M, rows, P)
        With respect to `parameters`.
    circumstances : Circumstances
        Where the robot has yielded to, by this estimate.
    """

    residual: np.ndarray
    coordinate_jacobian: np.ndarray
    sensitivities: np.ndarray
    circumstances: Circumstances


def declared_model(campaign, effects=()):
    """The model that a campaign declares.

    Parameters
    ----------
    campaign : Campaign
    effects : sequence of Candidate
        Declared effects.

    Returns
    -------
    Model
    """
    sites = sites_of(campaign.robot)
    springs = (joint_compliance(sites),) if campaign.compliance == "identify" else ()
    weight = (declared_weight.candidate(sites),) if sites.masses else ()
    return Model(
        sites,
        campaign.targets,
        campaign.frame == "tracker",
        6 if campaign.measured == "pose" else 3,
        campaign.robot.compliance,
        (*springs, *weight, *effects),
        0.0 if campaign.readings.time_s is None else float(campaign.readings.time_s.min()),
        (int(campaign.readings.row.min()), int(campaign.readings.row.max())) if len(campaign.readings) else None,
    )


def circumstances(model, estimate, states, coordinates=None):
    """What the effects of a model may depend on, in some states.

    Parameters
    ----------
    model : Model
    estimate : Estimate
        Its joint compliances and masses, where they are parameters, and where it takes the robot to, at which loads are taken.
    states : States
    coordinates : ndarray (S, C), optional
        Where the robot has yielded to; found without.

    Returns
    -------
    Circumstances
    """
    compliance, corrections = joint_compliances(model, estimate), mass_corrections(model, estimate)
    around = circumstances_of(model.sites, compliance, states, model.time_zero_s, corrections, model.row_span, coordinates)
    for _ in range(_PASSES if coordinates is None else 0):
        around = at_coordinates(around, displaced_coordinates(model, estimate, around))
    return around


def joint_compliances(model, estimate):
    """Joint compliances of an estimate, ndarray (n,), rad/(N m): the identified ones where they are parameters."""
    return _values_of("joint_compliance", model, estimate, model.nominal_compliance)


def mass_corrections(model, estimate):
    """By how much the declared masses of an estimate are off the robot file, ndarray (4 m,): see `Circumstances`."""
    return _values_of(declared_weight.EFFECT, model, estimate, np.zeros(MASS_PARAMETERS * len(model.sites.masses)))


def _values_of(name, model, estimate, otherwise):
    for effect, values in zip(model.effects, estimate.coefficients, strict=True):
        if effect.effect == name:
            return values
    return otherwise


def _with_springs_of(model, estimate, circumstances):
    return with_springs(circumstances, joint_compliances(model, estimate), mass_corrections(model, estimate))


def parameters(model, estimate):
    """Everything that is fitted, in the order of the sensitivities.

    Parameters
    ----------
    model : Model
    estimate : Estimate

    Returns
    -------
    list of (str, Parameter)
        What it belongs to ("frame 0", "target A", the key of an effect) and the parameter.
    """
    found = []
    shift = [Parameter(name, "m", _ANYWHERE_M) for name in _LENGTH]
    turn = [Parameter(name, "rad", _ANYWHERE_RAD) for name in _TURN]
    if model.fitted_frames:
        found += [(f"frame {session}", parameter) for session in estimate.sessions for parameter in (*shift, *turn)]
    for target in model.targets:
        if target.offset_m is None:
            found += [(f"target {target.name}", parameter) for parameter in (*shift, *(turn if model.rows == 6 else ()))]
    for effect in model.effects:
        found += [(effect.key, parameter) for parameter in effect.parameters]
        found += [(effect.key, Parameter(s.name, s.unit, s.highest - s.lowest)) for s in effect.shapes]
    return found


def bends(model, estimate):
    """Which of the `parameters` are shapes, ndarray of bool (P,)."""
    shapes = {(effect.key, shape.name) for effect in model.effects for shape in effect.shapes}
    return np.array([(owner, parameter.name) in shapes for owner, parameter in parameters(model, estimate)], bool)


def limits(model, estimate):
    """Lowest and highest value of each of the `parameters`, ndarray (P, 2): the ranges of shapes, infinite for all others."""
    ranges = {(effect.key, shape.name): (shape.lowest, shape.highest) for effect in model.effects for shape in effect.shapes}
    listed = [ranges.get((owner, p.name), (-np.inf, np.inf)) for owner, p in parameters(model, estimate)]
    return np.array(listed).reshape(-1, 2)


def parameter_values(model, estimate):
    """Present values of all that is fitted, in the order of `parameters`.

    Frames and targets are fitted by steps from where they are and count as zero.

    Parameters
    ----------
    model : Model
    estimate : Estimate

    Returns
    -------
    ndarray (P,)
    """
    owned = [owner.startswith(("frame ", "target ")) for owner, _ in parameters(model, estimate)]
    effects = [part for pair in zip(estimate.coefficients, estimate.shapes, strict=True) for part in pair]
    return np.concatenate([np.zeros(sum(owned)), *effects])


def predict(model, estimate, observations, circumstances):
    """Exact poses of the targets, in base axes.

    Parameters
    ----------
    model : Model
    estimate : Estimate
    observations : Observations
    circumstances : Circumstances
        Of the states of the observations.

    Returns
    -------
    position : ndarray (M, 3)
    rotation : ndarray (M, 3, 3)
    """
    coordinates = displaced_coordinates(model, estimate, circumstances)
    position, rotation = poses_of_points(model.sites.chain, coordinates, _points(model, estimate))
    seen = observations.target, observations.state
    return position[seen], rotation[seen] @ estimate.target_rotation[observations.target]


def residuals(model, estimate, observations, circumstances):
    """Measured less predicted, in base axes.

    Parameters
    ----------
    model, estimate, observations, circumstances
        As in `predict`.

    Returns
    -------
    ndarray (M, rows)
        m and, where poses are measured, rad.
    """
    position, rotation = predict(model, estimate, observations, circumstances)
    return _differences(measured_in_base(estimate, observations), position, rotation)


def linearize(model, estimate, observations, circumstances):
    """Residuals of a model and their sensitivities.

    Parameters
    ----------
    model, estimate, observations, circumstances
        As in `predict`.

    Returns
    -------
    Linearization
    """
    around = _with_springs_of(model, estimate, circumstances)
    coordinates = displaced_coordinates(model, estimate, around)
    count, rows, chain, points = len(observations), model.rows, model.sites.chain, _points(model, estimate)
    moved = motion(chain, coordinates, (*model.sites.followed, *points))
    position, rotation = np.empty((count, 3)), np.empty((count, 3, 3))
    # Component first, so that every effect's arithmetic runs along the observations.
    jacobian = np.empty((rows, chain.coordinates, count))
    for index, point in enumerate(points):
        seen = np.flatnonzero(observations.target == index)
        state, number = observations.state[seen], len(model.sites.followed) + index
        at = moved.position[number][:, state]
        position[seen], rotation[seen] = at.T, np.moveaxis(moved.rotation[number][..., state], -1, 0)
        jacobian[..., seen] = moved.jacobian(point.after, at, rows, state)
    residual = _differences(
        measured_in_base(estimate, observations), position, rotation @ estimate.target_rotation[observations.target]
    )
    jacobian = np.moveaxis(jacobian, -1, 0)
    columns = []
    if model.fitted_frames:
        at_base = jacobian[..., list(model.sites.base)]
        for session in estimate.sessions:
            in_session = observations.states.session[observations.state] == session
            columns.append(at_base * in_session[:, None, None])
    for index, target in enumerate(model.targets):
        if target.offset_m is None:
            columns.append(_target_columns(rotation, observations.target == index, rows))
    for effect, values, shapes in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        if effect.effect in _SPRINGS:
            laws = _spring_laws(effect, model, estimate, around)
        else:
            laws = effect.displacement(around, *shapes)
        columns.append(_columns(laws, jacobian, observations.state))
        columns.append(_shape_columns(effect, values, shapes, around, jacobian, observations.state))
    sensitivities = np.concatenate(columns, axis=-1) if columns else np.empty((count, rows, 0))
    return Linearization(residual, jacobian, sensitivities, replace(around, motion=moved))


def effect_columns(effects, circumstances, coordinate_jacobian, state):
    """Sensitivities of the readings to the linear parameters of effects.

    Parameters
    ----------
    effects : sequence of (Candidate, sequence of float)
        With their shape parameters.
    circumstances : Circumstances
    coordinate_jacobian : ndarray (M, rows, C)
    state : ndarray (M,)
        State of each observation.

    Returns
    -------
    ndarray (M, rows, D)
    """
    laws = [law for effect, shapes in effects for law in effect.displacement(circumstances, *shapes)]
    return _columns(laws, coordinate_jacobian, state)


def _columns(laws, coordinate_jacobian, state):
    columns = np.empty((coordinate_jacobian.shape[1], len(laws), len(state)))
    jacobian = np.moveaxis(coordinate_jacobian, 0, -1)
    for number, law in enumerate(laws):
        columns[:, number] = sum(jacobian[:, coordinate] * values[state] for coordinate, values in law.items())
    return np.moveaxis(columns, -1, 0)


def displaced_coordinates(model, estimate, circumstances):
    """Coordinates of the sites in each state: joint angles, springs under load and effects.

    Returns
    -------
    ndarray (S, C)
    """
    around = _with_springs_of(model, estimate, circumstances)
    displaced = np.zeros((len(around.joint_angles), model.sites.chain.coordinates))
    displaced[:, : model.sites.joints] = around.joint_angles
    if not model.identifies_compliance:
        displaced[:, : model.sites.joints] += around.total[:, : model.sites.joints] * model.nominal_compliance
    for effect, values, shapes in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        # The errors of masses are part of the total load.
        if effect.effect != declared_weight.EFFECT:
            _displace(displaced, effect, values, shapes, around)
    return displaced


def _displace(displaced, effect, values, shapes, around):
    for value, law in zip(values, effect.displacement(around, *shapes), strict=True):
        for coordinate, per_unit in law.items():
            displaced[:, coordinate] += value * per_unit


# Parameters on which the laws of other effects depend: they turn a wrench into angles, or are part of the load.
_SPRINGS = ("joint_compliance", declared_weight.EFFECT)


def _spring_laws(spring, model, estimate, around):
    """Displacements per unit of compliances or of errors of masses, with all that they do by way of other effects."""
    laws = spring.displacement(around)
    through = _through_compliance if spring.effect == "joint_compliance" else _through_load
    others = [found for found in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True) if through(found[0])]
    if not others:
        return laws

    def of_others(springs):
        displaced = np.zeros_like(around.load)
        for other in others:
            _displace(displaced, *other, springs)
        return displaced

    values, present = joint_compliances(model, estimate), of_others(around)
    corrections = mass_corrections(model, estimate)
    for number, parameter in enumerate(spring.parameters):
        step = np.zeros(len(laws))
        step[number] = _SPRING_STEP * parameter.plausible
        moved = (values + step, corrections) if spring.effect == "joint_compliance" else (values, corrections + step)
        change = (of_others(with_springs(around, *moved)) - present) / step[number]
        for coordinate in np.flatnonzero(change.any(axis=0)):
            laws[number][coordinate] = laws[number].get(coordinate, 0.0) + change[:, coordinate]
    return laws


def _through_compliance(effect):
    """Whether an effect is a load that the joint compliances turn into angles."""
    return effect.family in ("gravity", "load")


def _through_load(effect):
    """Whether an effect goes with the total load."""
    return "load" in effect.needs and effect.effect not in _SPRINGS


def stepped(model, estimate, step):
    """An estimate after a step of all parameters, in the order of `parameters`.

    Parameters
    ----------
    model : Model
    estimate : Estimate
    step : ndarray (P,)

    Returns
    -------
    Estimate
    """
    left = list(step)

    def take(count):
        taken, left[:] = np.array(left[:count]), left[count:]
        return taken

    frame_rotation, frame_position = estimate.frame_rotation.copy(), estimate.frame_position.copy()
    if model.fitted_frames:
        for number in range(len(estimate.sessions)):
            shift, turn = take(3), take(3)
            frame_position[number] += frame_rotation[number] @ shift
            frame_rotation[number] = frame_rotation[number] @ Rotation.from_rotvec(turn).as_matrix()
    target_offset, target_rotation = estimate.target_offset.copy(), estimate.target_rotation.copy()
    for number, target in enumerate(model.targets):
        if target.offset_m is None:
            target_offset[number] += take(3)
            if model.rows == 6:
                target_rotation[number] = Rotation.from_rotvec(take(3)).as_matrix() @ target_rotation[number]
    coefficients, shapes = [], []
    for effect, values, bent in zip(model.effects, estimate.coefficients, estimate.shapes, strict=True):
        coefficients.append(values + take(len(values)))
        limits = np.array([(shape.lowest, shape.highest) for shape in effect.shapes]).reshape(-1, 2)
        shapes.append(np.clip(bent + take(len(bent)), *limits.T))
    return Estimate(
        estimate.sessions,
        frame_rotation,
        frame_position,
        target_offset,
        target_rotation,
        tuple(coefficients),
        tuple(shapes),
    )


def measured_in_base(estimate, observations):
    """Measured poses, taken from the frames of the sessions into base axes.

    Returns
    -------
    position : ndarray (M, 3)
    rotation : ndarray (M, 3, 3) or None
    """
    session = np.searchsorted(estimate.sessions, observations.states.session[observations.state])
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    position = (into_base @ (observations.position - estimate.frame_position[session])[..., None])[..., 0]
    return position, None if observations.rotation is None else into_base @ observations.rotation


def _differences(measured, position, rotation):
    if measured[1] is None:
        return measured[0] - position
    return pose_differences(*measured, position, rotation)


def _points(model, estimate):
    points = [model.sites.chain.point(target.point) for target in model.targets]
    return [replace(point, offset_m=tuple(at)) for point, at in zip(points, estimate.target_offset, strict=True)]


def _target_columns(rotation, mask, rows):
    """Shift of a target along the axes of its measuring point and, for poses, its turn about them."""
    columns = np.zeros((len(mask), rows, rows))
    for first in range(0, rows, 3):
        columns[mask, first : first + 3, first : first + 3] = rotation[mask]
    return columns


def _shape_columns(effect, values, shapes, circumstances, jacobian, state):
    columns = np.zeros((*jacobian.shape[:2], len(shapes)))
    for number in range(len(shapes)):
        shape = effect.shapes[number]
        step = _SHAPE_STEP * max(abs(shapes[number]), shape.lowest, 0.1 * shape.highest)
        sides = []
        for sign in (1, -1):
            moved = shapes.copy()
            moved[number] += sign * step
            sides.append(effect_columns([(effect, moved)], circumstances, jacobian, state) @ values)
        columns[..., number] = (sides[0] - sides[1]) / (2 * step)
    return columns
