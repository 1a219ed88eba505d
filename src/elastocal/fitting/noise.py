"""Noise of the measurements and scale of geometric errors, before effects are sought.

The noise has a sensor part, equal in all directions, and the repeatability of the
joints, which acts through the Jacobian. Repeats of a state separate the two: each
repeat is a fresh approach, so the joints come to rest a little differently and move all
targets together, while the errors of the sensor are independent for each target.

A robot deviates from its drawing by some multiple of what is plausible. This multiple,
one number for all declared geometry, and the ratio of the scatter of the measurements
to their assumed noise are estimated by type II maximum likelihood (Good, The Estimation
of Probabilities, 1965). Both come from the declared model alone, so that all models of
a campaign, with effects and without, have the same prior of geometry.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy  # Import its optimizers lazily: only campaigns with enough repeats need them.
from scipy.linalg import helmert
from scipy.special import gammaincinv

from elastocal.fitting.least_squares import (
    INTERMEDIATE_TOLERANCE,
    START_SAMPLE_SIZE,
    fit_model,
    register_placement,
)
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import evaluate_conditions, get_parameter_values
from elastocal.fitting.observations import (
    batch_groups_by_size,
    remove_outlying_repeats,
    sample_observations,
    select_states,
    separate_approaches,
)
from elastocal.fitting.sensor_noise import (
    FINEST_RESOLUTION,
    ShapedNoise,
    compute_sensor_axes,
    estimate_factors,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.linearization import LinearModel
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations
    from elastocal.verdict import NoiseEstimate

# Fewer contrasts of repeats than the first number do not separate the joints' part from
# the sensor's; fewer than the second are too few to estimate any noise. The third
# number determines every standard deviation to a percent; more only take time.
MIN_CONTRASTS_FOR_JOINTS = 60
MIN_CONTRASTS = 9
MAX_CONTRASTS = 20_000
# Half width of the interval that holds 95 % of a normal distribution, in standard
# deviations (JCGM 100:2008, section 6).
_COVERAGE_FACTOR = 1.959964
# Confidence with which a joint's repeatability is no larger than its estimate: too
# small an estimate raises false alarms, too large a one costs power.
_JOINT_CONFIDENCE = 0.8
# Range of the repeatability of a joint, and the number of values on a logarithmic grid
# over it: steps of two fifths.
_MIN_JOINT_RAD = 1e-8
_MAX_JOINT_RAD = 1e-2
_JOINT_GRID_SIZE = 40
# Range of a sensor's standard deviation about that of all contrasts, as logarithms.
_LOG_RANGE_BELOW = 7
_LOG_RANGE_ABOVE = 1
# Probability with which the ratio of estimated to declared noise is in the interval
# outside which there is a warning.
_RATIO_QUANTILES = (0.005, 0.995)
# Scales of the prior of declared geometry, in plausible sizes: measured robots exceed
# the tolerances of data sheets tenfold, and none is ten times better than these.
PRIOR_SCALES = np.geomspace(0.1, 10.0, 9)
# Ratios of actual to assumed noise, in steps that change no verdict.
_NOISE_FACTORS = np.geomspace(1.0, 1e4, 185)
# A smaller remaining share of a prior's variance is rounding.
_SHARE_ROUNDING = 1e-14
# Rounds of the estimate of a shaped noise: the third changes it by a few per cent.
_SHAPE_ROUNDS = 3
# Noise that is assumed before anything is known about it, m and rad.
_ASSUMED_NOISE = 1e-4


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one measurement.

    Attributes
    ----------
    source : "repeats", "declared" or "residual"
    position_m, orientation_rad : float
        Sensor part, of each component.
    joint_rad : (n,) array
        Repeatability of each joint.
    degrees_of_freedom : int
        Number of contrasts of repeats behind the figures; 0 if they are declared.
    pose_rad : float
        Error of each joint that all measurements of a pose have in common.
    """

    source: str
    position_m: float
    orientation_rad: float
    joint_rad: np.ndarray
    degrees_of_freedom: int = 0
    pose_rad: float = 0.0

    @property
    def without_pose_error(self) -> Noise:
        """The same noise without the common error of the measurements of a pose."""
        return replace(self, pose_rad=0.0)

    @property
    def has_joint_error(self) -> bool:
        """Whether errors of the joints are part of the noise."""
        return bool(self.pose_rad or self.joint_rad.any())

    def scaled(self, factor: float) -> Noise:
        """Multiply the noise of single measurements."""
        return replace(
            self,
            position_m=factor * self.position_m,
            orientation_rad=factor * self.orientation_rad,
            joint_rad=factor * self.joint_rad,
        )

    def sensor_std(self, rows: int) -> np.ndarray:
        """Sensor part of each component of a measurement, (rows,) array."""
        return np.repeat([self.position_m, self.orientation_rad], 3)[:rows]


def serialize_noise(noise: Noise) -> dict[str, Any]:
    """Write noise as a JSON document."""
    return asdict(noise) | {"joint_rad": noise.joint_rad.tolist()}


def parse_noise(document: Mapping[str, Any]) -> Noise:
    """Read noise from a JSON document with key "noise", such as a verdict.

    A verdict has further keys under "noise".
    """
    values = {field.name: document["noise"][field.name] for field in fields(Noise)}
    return Noise(**values | {"joint_rad": np.array(values["joint_rad"])})


def get_noise(estimate: NoiseEstimate) -> Noise:
    """Get the noise of the measurements that a verdict states."""
    return Noise(
        estimate.source,
        estimate.position_m,
        estimate.orientation_rad,
        np.array(estimate.joint_rad),
        estimate.degrees_of_freedom,
        estimate.pose_rad,
    )


def choose_noise(
    campaign: Campaign, model: Model, estimate: Estimate
) -> tuple[Noise | None, list[str]]:
    """Choose noise from repeats if there are enough, otherwise the declared noise.

    If the ratio of the two is outside the chi-squared interval of 99 % of a variance,
    there is a warning.

    Returns
    -------
    noise : Noise, or None if there are neither repeats nor declared noise
    warnings : list of str
    """
    repeats = estimate_noise_from_repeats(model, estimate, campaign.measurements)
    declared = _read_declared_noise(campaign)
    if repeats is None and declared is None:
        return None, [
            "no repeats and no declared noise: the expected size of the residual is unknown"
        ]
    if repeats is None or declared is None:
        return repeats or declared, []
    ratio = repeats.position_m / declared.position_m
    freedom = repeats.degrees_of_freedom // count_sensors(model.rows)
    low, high = np.sqrt(2 * gammaincinv(freedom / 2, _RATIO_QUANTILES) / freedom)
    if low < ratio < high:
        return repeats, []
    return repeats, [
        f"repeats show {ratio:.2f} times the declared noise of positions; the repeats are used"
    ]


def count_sensors(rows: int) -> int:
    """Count the sensor parts of a measurement: positions or numbers, and orientations."""
    return 2 if rows == 6 else 1


def _read_declared_noise(campaign: Campaign) -> Noise | None:
    """Noise as a campaign declares it, or as its measurements state it.

    Measurements state expanded uncertainties, 95 % of one coordinate, of which the root
    mean square counts.
    """
    declared = campaign.noise or {}
    u95_m = campaign.measurements.u95_m
    if u95_m is not None:
        position_m = float(np.sqrt((u95_m**2).mean())) / _COVERAGE_FACTOR
    elif "position_m" in declared:
        position_m = declared["position_m"]
    else:
        return None
    return Noise(
        "declared",
        position_m,
        declared.get("orientation_rad", position_m),
        np.zeros(campaign.robot.joints) + declared.get("joint_rad", 0.0),
    )


def estimate_noise(case: Case) -> tuple[Noise, list[str]]:
    """Estimate the noise of a campaign; return it with warnings.

    It comes from repeats, or from the declaration, or otherwise from the residual of
    the declared model.
    """
    start = register_placement(case.model, case.observations)
    noise, warnings = choose_noise(case.campaign, case.model, start)
    if noise is not None:
        return noise, warnings
    # The widest prior leaves nearly the same residual as no prior, without parameters
    # that nothing determines.
    widest = find_widest_scale(case.model, case.observations)
    model = set_prior_scale(case.model, widest)
    noise = _estimate_residual_level(case, model, start)
    # Fitted parameters have absorbed a part of the noise, which makes the residual too
    # small.
    fitted = fit_model(
        model, case.observations, noise, start, tolerance=INTERMEDIATE_TOLERANCE
    )
    return noise.scaled(maximize_evidence(fitted, widest).noise_factor), warnings


def _estimate_residual_level(case: Case, model: Model, start: Estimate) -> Noise:
    """Estimate noise from the residual of a model, or take that of its shaped noise,
    which was estimated from such a residual.

    The residual of a pose that was converted, such as that of a camera on a board, is no
    error of what is read: a rotation moves it by its distance from the board.
    """
    joints = np.zeros(case.campaign.robot.joints)
    if model.shaped_noise is not None:
        position_m, orientation_rad = model.shaped_noise.average(case.observations)
        return Noise("residual", float(position_m), float(orientation_rad), joints)
    assumed = Noise("residual", _ASSUMED_NOISE, _ASSUMED_NOISE, joints)
    residual = fit_model(model, case.observations, assumed, start).residual
    return replace(
        assumed,
        position_m=_limited_rms(residual[:, :3]),
        orientation_rad=_limited_rms(residual[:, -3:]),
    )


def _limited_rms(residual: np.ndarray) -> float:
    """Root mean square of a residual, no less than any sensor resolves."""
    return max(float(np.sqrt((residual**2).mean())), FINEST_RESOLUTION)


def estimate_noise_from_repeats(
    model: Model, estimate: Estimate, measurements: Measurements
) -> Noise | None:
    """Estimate noise by restricted maximum likelihood from differences between repeats.

    The likelihood is that of error contrasts [1]_, here of orthonormal Helmert contrasts
    of repeats; L-BFGS-B [2]_ finds its maximum. The joints' part is used if it is worth
    its parameters by Akaike's criterion (1974), at the upper limit of a one-sided
    chi-squared interval of 80 %. If contrasts are too few to show it, their mean square
    is the sensor's part.

    Parameters
    ----------
    model : Model
    estimate : Estimate
        Its frames turn measurements into base axes; nothing else of it matters.
    measurements : Measurements

    Returns
    -------
    Noise, or None if there are too few repeats, or if they do not differ at all

    References
    ----------
    .. [1] Patterson and Thompson, Biometrika 58, 1971.
    .. [2] Byrd et al. 1995.
    """
    contrasts = _compute_contrasts(model, estimate, measurements)
    if contrasts is None:
        return None
    sensors = len(contrasts.squares)
    joints = model.sites.joints
    total = contrasts.count * sensors
    sensor_std = np.sqrt(contrasts.squares / contrasts.count)
    if sensor_std.min() < FINEST_RESOLUTION:
        # The same number again and again means a sensor that stands still or truncated
        # digits, not a sensor without noise.
        return None
    sensor_noise = Noise(
        "repeats", float(sensor_std[0]), float(sensor_std[-1]), np.zeros(joints), total
    )
    if total < MIN_CONTRASTS_FOR_JOINTS:
        return sensor_noise
    log_sensor = np.log(sensor_std)
    log_joints = np.full(joints, np.log(0.3 * sensor_std[0]))
    joint_bounds = (np.log(_MIN_JOINT_RAD), np.log(_MAX_JOINT_RAD))
    fitted = scipy.optimize.minimize(
        _negative_log_likelihood,
        np.concatenate([log_sensor, log_joints]),
        (contrasts,),
        "L-BFGS-B",
        jac=True,
        bounds=_sensor_bounds(log_sensor) + [joint_bounds] * joints,
    )
    # Akaike's criterion compares with joints that repeat exactly.
    without_joints = np.concatenate(
        [log_sensor, np.full(joints, np.log(_MIN_JOINT_RAD))]
    )
    if fitted.fun + joints > _negative_log_likelihood(without_joints, contrasts)[0]:
        return sensor_noise
    std = np.exp(fitted.x)
    return replace(
        sensor_noise,
        position_m=float(std[0]),
        orientation_rad=float(std[sensors - 1]),
        joint_rad=std[sensors:] * _joint_inflation(contrasts, joints),
    )


def _joint_inflation(contrasts: _Contrasts, joints: int) -> float:
    """Ratio of the upper limit of a joint's repeatability to its estimate.

    Each approach draws the error of a joint once, however many targets are measured.
    """
    total = contrasts.count * len(contrasts.squares)
    freedom = max(min(total // (joints + 1), len(contrasts.projections)), 1)
    return float(
        np.sqrt(freedom / (2 * gammaincinv(freedom / 2, 1 - _JOINT_CONFIDENCE)))
    )


def _sensor_bounds(log_std: np.ndarray) -> list[tuple[float, float]]:
    """Bounds of the logarithms of the sensor's standard deviations."""
    return [(value - _LOG_RANGE_BELOW, value + _LOG_RANGE_ABOVE) for value in log_std]


def estimate_joint_repeatability(
    model: Model, estimate: Estimate, measurements: Measurements
) -> tuple[float, float]:
    """Estimate the repeatability of joints, all alike, that the sensor's noise hides.

    It is the root mean square of the values that repeats leave possible: an average
    over the standard deviation of a joint, weighted by the restricted likelihood of
    `estimate_noise_from_repeats`, of which the sensor's part is maximized.

    Returns
    -------
    joint_rad : float
    degrees_of_freedom : float
        Of its square. Both are zero if repeats are too few.
    """
    contrasts = _compute_contrasts(model, estimate, measurements)
    if contrasts is None:
        return 0.0, 0.0
    sensors = len(contrasts.squares)
    joints = model.sites.joints
    variance = contrasts.squares / contrasts.count
    log_sensor = 0.5 * np.log(np.maximum(variance, FINEST_RESOLUTION**2))
    grid = np.geomspace(_MIN_JOINT_RAD, _MAX_JOINT_RAD, _JOINT_GRID_SIZE)

    def profile(log_sensor: np.ndarray, joint_rad: float) -> tuple[float, np.ndarray]:
        """Negative log likelihood and its gradient for a given joint deviation."""
        log_joints = np.full(joints, np.log(joint_rad))
        value, gradient = _negative_log_likelihood(
            np.concatenate([log_sensor, log_joints]), contrasts
        )
        return value, gradient[:sensors]

    bounds = _sensor_bounds(log_sensor)
    minima = [
        scipy.optimize.minimize(
            profile, log_sensor, (joint_rad,), "L-BFGS-B", jac=True, bounds=bounds
        ).fun
        for joint_rad in grid
    ]
    log_likelihood = -np.array(minima)
    # The grid is even in the logarithm, so each value stands for a range as wide as the
    # value itself.
    weights = np.exp(log_likelihood - log_likelihood.max()) * grid
    weights /= weights.sum()
    mean_square = float(weights @ grid**2)
    variance_of_square = float(weights @ (grid**2 - mean_square) ** 2)
    return float(np.sqrt(mean_square)), 2.0 * mean_square**2 / variance_of_square


@dataclass(frozen=True)
class _Contrasts:
    """Sums over G orthonormal contrasts v (k * rows,) of repeats with k targets.

    A sensor part is positions or orientations, s of them; S is the Jacobian of the
    targets with respect to the n joints.

    Attributes
    ----------
    count : int, numbers of one sensor part in all contrasts
    squares : (s,) array, v'v of each sensor part, summed over all contrasts
    projections : (G, s, n) array, S'v
    gram : (G, s, n, n) array, S'S
    """

    count: int
    squares: np.ndarray
    projections: np.ndarray
    gram: np.ndarray


def _compute_contrasts(
    model: Model, estimate: Estimate, measurements: Measurements
) -> _Contrasts | None:
    """Compute contrasts between repeats; None if there are too few."""
    if not len(measurements) or not np.ptp(measurements.repeat):
        return None
    observations, averaged_state = separate_approaches(
        remove_outlying_repeats(measurements)
    )
    chosen = _select_comparable_approaches(observations, averaged_state)
    observations = select_states(observations, chosen)
    averaged_state = averaged_state[chosen]
    if len(observations) * model.rows < MIN_CONTRASTS:
        return None
    nominal_model = replace(model, effects=())
    nominal = replace(estimate, coefficients=(), shapes=())
    conditions = evaluate_conditions(nominal_model, nominal, observations.states)
    linear_model = linearize(nominal_model, nominal, observations, conditions)
    if observations.spread is not None:
        linear_model = _standardize(linear_model, observations.spread)
    axes = compute_sensor_axes(nominal_model, nominal, observations)
    if axes is not None:
        linear_model = _refer_to_measurements(linear_model, axes)
    stacks = [
        _contrast_repeats(linear_model, members)
        for members in _stack_repeats(observations, averaged_state)
    ]
    contrasts = _Contrasts(
        sum(stack.count for stack in stacks),
        sum((stack.squares for stack in stacks), np.zeros(count_sensors(model.rows))),
        np.concatenate([stack.projections for stack in stacks]),
        np.concatenate([stack.gram for stack in stacks]),
    )
    total = contrasts.count * len(contrasts.squares)
    return contrasts if total >= MIN_CONTRASTS else None


def _standardize(linear_model: LinearModel, spread: np.ndarray) -> LinearModel:
    """Divide residuals and Jacobians by the spread (M,) of the observations."""
    columns = linear_model.columns
    return replace(
        linear_model,
        residual=linear_model.residual / spread[:, None],
        columns=replace(columns, jacobian=columns.jacobian / spread[:, None, None]),
    )


def _refer_to_measurements(linear_model: LinearModel, axes: np.ndarray) -> LinearModel:
    """Express residuals and Jacobians as errors of what is read, by the residuals
    (M, r, r) that these cause."""
    columns = linear_model.columns
    residual = np.linalg.solve(axes, linear_model.residual[..., None])[..., 0]
    jacobian = np.linalg.solve(axes, columns.jacobian)
    return replace(
        linear_model,
        residual=residual,
        columns=replace(columns, jacobian=jacobian),
    )


def _select_comparable_approaches(
    observations: Observations, averaged_state: np.ndarray
) -> np.ndarray:
    """Select approaches with the same targets as the first approach of their state.

    If there are more contrasts than needed, only states spread over the campaign are
    selected. `averaged_state` (S,) is the averaged state of each approach. Returns a
    (S,) bool array.
    """
    first = np.flatnonzero(np.diff(averaged_state, prepend=-1))
    target_count = np.bincount(observations.state)
    start = (np.cumsum(target_count) - target_count)[observations.state]
    targets = np.full((len(target_count), target_count.max()), -1)
    column = np.arange(len(observations)) - start
    targets[observations.state, column] = observations.target
    comparable = (targets == targets[first[averaged_state]]).all(axis=1)
    approaches = np.bincount(averaged_state, comparable).astype(int)
    repeated = np.flatnonzero(approaches > 1)
    contrasts = ((approaches - 1) * target_count[first]).sum() * observations.rows
    excess = contrasts / MAX_CONTRASTS
    if excess > 1:
        count = int(len(repeated) / excess)
        repeated = repeated[np.linspace(0, len(repeated) - 1, count).astype(int)]
    return comparable & np.isin(averaged_state, repeated)


def _stack_repeats(
    observations: Observations, averaged_state: np.ndarray
) -> Iterator[np.ndarray]:
    """Indices (groups, repeats, targets) of the observations, for each number of
    repeats and targets that states have."""
    target_count = np.bincount(observations.state)[observations.state]
    group = np.unique(averaged_state, return_inverse=True)[1]
    for members in batch_groups_by_size(group[observations.state]):
        counts = target_count[members[:, 0]]
        for count in np.unique(counts):
            repeats = members.shape[1] // count
            yield members[counts == count].reshape(-1, repeats, count)


def _contrast_repeats(linear_model: LinearModel, members: np.ndarray) -> _Contrasts:
    """Contrasts of observations (groups, repeats, targets), given as indices."""
    groups, repeats, targets = members.shape
    residual = linear_model.residual[members].reshape(groups, repeats, -1)
    vectors = helmert(repeats) @ residual
    rows = linear_model.residual.shape[1]
    sensors = count_sensors(rows)
    vectors = vectors.reshape(groups, repeats - 1, targets, sensors, -1)
    jacobian = linear_model.joint_jacobian[members[:, 0]].reshape(
        groups, targets, sensors, rows // sensors, -1
    )
    projections = np.einsum("gtsxn,grtsx->grsn", jacobian, vectors)
    gram = np.einsum("gtsxn,gtsxm->gsnm", jacobian, jacobian)
    return _Contrasts(
        vectors.size // sensors,
        (vectors**2).sum(axis=(0, 1, 2, 4)),
        projections.reshape(-1, *projections.shape[2:]),
        np.repeat(gram, repeats - 1, axis=0),
    )


def _negative_log_likelihood(
    log_std: np.ndarray, contrasts: _Contrasts
) -> tuple[float, np.ndarray]:
    """Negative log restricted likelihood, and its gradient with respect to `log_std`.

    `log_std` (s + n,) holds the logarithms of the standard deviations of the sensor
    parts and of the joints. With D the variances of the sensors and L those of the
    joints, Sigma = D + S L S' has the determinant |D| |I + L C| and the inverse
    D^-1 - D^-1 S A S' D^-1, where C = S' D^-1 S and A = (I + L C)^-1 L, by Woodbury's
    identity (Hager, SIAM Review 31, 1989).
    """
    sensors = len(contrasts.squares)
    precision = np.exp(-2.0 * log_std[:sensors])
    joint_std = np.exp(log_std[sensors:])
    projection = precision @ contrasts.projections
    gram = (precision[:, None, None] * contrasts.gram).sum(axis=1)
    inner = np.eye(len(joint_std)) + joint_std[:, None] * gram * joint_std
    # The matrix A, and A S' D^-1 v.
    middle = joint_std[:, None] * np.linalg.inv(inner) * joint_std
    solved = (middle @ projection[..., None])[..., 0]
    value = contrasts.count * log_std[:sensors].sum() + 0.5 * (
        precision @ contrasts.squares - (projection * solved).sum()
    )
    value += 0.5 * np.linalg.slogdet(inner)[1].sum()
    # For each sensor part: the share of its squares and of its variance that the joints
    # explain.
    explained = 2.0 * (contrasts.projections @ solved[..., None])[..., 0]
    explained -= (
        (contrasts.gram @ solved[:, None, :, None])[..., 0] * solved[:, None]
    ).sum(axis=2)
    explained -= (middle[:, None] * contrasts.gram).sum(axis=(2, 3))
    sensor_gradient = contrasts.count + precision * (
        explained.sum(axis=0) - contrasts.squares
    )
    # S' Sigma^-1 v, and the diagonal of S' Sigma^-1 S.
    reduced = projection - (gram @ solved[..., None])[..., 0]
    diagonal = np.diagonal(gram, axis1=1, axis2=2) - (gram * (gram @ middle)).sum(
        axis=2
    )
    joint_gradient = joint_std**2 * (diagonal - reduced**2).sum(axis=0)
    return value, np.concatenate([sensor_gradient, joint_gradient])


def fit_declared_model(model: Model, observations: Observations, noise: Noise) -> Fit:
    """Fit a declared model with the most probable prior scale of its geometry.

    Without declared geometry this is `least_squares.fit_model`.
    """
    if not find_declared_geometry(model):
        return fit_model(model, observations, noise)
    widest = find_widest_scale(model, observations)
    wide = fit_model(
        set_prior_scale(model, widest),
        sample_observations(observations, START_SAMPLE_SIZE),
        noise,
        tolerance=INTERMEDIATE_TOLERANCE,
    )
    return fit_model(
        set_prior_scale(model, maximize_evidence(wide, widest).prior_scale),
        observations,
        noise,
        wide.estimate,
        reweight_first_step=True,
    )


def estimate_shaped_noise(case: Case) -> ShapedNoise | None:
    """Estimate the noise of a kind that states its shape, such as that of a camera.

    Fits of the declared model and estimates of the factors alternate. What the model
    lacks counts as noise here; a diagnosis estimates the level of the noise again. If
    the campaign declares its noise, that is the noise of what is read, and has the
    estimated shape.

    Returns None if the kind states no shape.
    """
    plan = case.campaign.measuring
    kind = plan.kinds[0]
    observations = case.observations
    if plan.channels or not len(observations) or observations.rotation is None:
        return None
    poses = observations.position, observations.rotation
    options = kind.refer_noise(*poses, {"camera": plan.camera})
    if not kind.shape_noise(*poses, options):
        return None
    joints = np.zeros(case.campaign.robot.joints)
    noise = Noise("residual", _ASSUMED_NOISE, _ASSUMED_NOISE, joints)
    model = case.model
    shaped = ShapedNoise(kind, options, np.ones(1))
    for _ in range(_SHAPE_ROUNDS):
        fitted = fit_declared_model(model, observations, noise)
        session = fitted.estimate.index_sessions(observations)
        frame = fitted.estimate.frame_rotation[session, None]
        vectors = fitted.residual.reshape(len(observations), 2, 3, 1)
        residual = (frame @ vectors).reshape(len(observations), 6)
        shaped = estimate_factors(shaped, observations, residual)
        model = replace(model, shaped_noise=shaped)
        noise = replace(noise, position_m=shaped.reference_m)
    declared = _read_declared_noise(case.campaign)
    return shaped if declared is None else shaped.declare(observations, declared)


def find_declared_geometry(model: Model) -> set[str]:
    """Find the names of declared effects whose prior scale is estimated.

    These are the effects whose parameters have no prior of their own, except springs.
    """
    return {effect.effect for effect in model.effects if _has_no_fixed_prior(effect)}


def _has_no_fixed_prior(effect: Candidate) -> bool:
    """Whether an effect is geometry whose priors, if any, were estimated."""
    return effect.family != "declared" and all(
        parameter.prior_std is None or parameter.sized
        for parameter in effect.parameters
    )


def set_prior_scale(model: Model, scale: float) -> Model:
    """Set priors on the declared geometry of a model, `scale` in plausible sizes.

    The end of the last link is the tool, which is declared no better than the reflectors
    on it, however well the robot is made.
    """
    geometry = find_declared_geometry(model)
    tool_std_m = _find_tool_std_m(model)
    tool_key = f"link_geometry@{model.sites.joints}"
    effects = []
    for effect in model.effects:
        if effect.effect in geometry:
            deviations = [scale * p.plausible for p in effect.parameters]
            if effect.key == tool_key:
                deviations = [
                    float(np.hypot(deviation, tool_std_m * (parameter.unit == "m")))
                    for deviation, parameter in zip(
                        deviations, effect.parameters, strict=True
                    )
                ]
            effects.append(set_prior_std(effect, deviations))
        else:
            effects.append(effect)
    return replace(model, effects=tuple(effects))


def _find_tool_std_m(model: Model) -> float:
    """Find how well the declared tool is known: as its least exact target, m."""
    end_effector = model.sites.chain.end_effector.name
    return max(
        (
            target.offset_std_m
            for target in model.targets
            if target.point == end_effector and target.has_inexact_offset
        ),
        default=0.0,
    )


def set_prior_std(
    candidate: Candidate, deviations: Sequence[float] | np.ndarray
) -> Candidate:
    """Set normal priors about zero with estimated standard deviations (D,)."""
    parameters = tuple(
        replace(parameter, prior_std=float(deviation), sized=True)
        for parameter, deviation in zip(candidate.parameters, deviations, strict=True)
    )
    return replace(candidate, parameters=parameters)


class PriorEvidence(NamedTuple):
    """Hyperparameters that make the measurements most probable.

    `prior_scale`: of declared geometry, in plausible sizes. `noise_factor`: actual over
    assumed noise, at least 1.
    """

    prior_scale: float
    noise_factor: float


def find_widest_scale(model: Model, observations: Observations) -> float:
    """Find the widest prior of declared geometry, in plausible sizes.

    Contacts with unknown places contain no length. A smaller robot touches sockets more
    exactly, so their evidence prefers larger errors of geometry; the likelihood of planes
    and spheres does not (see `contact_density`), but fits to them under a wide prior
    converge badly. The prior is then no wider than the plausible sizes.
    """
    plan = model.measuring
    if plan is None or plan.shows_lengths(observations.position):
        return float(PRIOR_SCALES[-1])
    return 1.0


def maximize_evidence(
    wide: Fit, widest_scale: float = PRIOR_SCALES[-1]
) -> PriorEvidence:
    """Find the prior scale of declared geometry and the noise factor by evidence.

    In closed form from a fit under the widest prior: given frames and targets the
    geometry is linear, and the principal axes of its covariance, in units of the prior,
    are independent.

    Parameters
    ----------
    wide : Fit
    widest_scale : float
        Scale of its prior, in plausible sizes.
    """
    is_sized = np.array([parameter.sized for _, parameter in wide.parameters], bool)
    sized = np.flatnonzero(is_sized & ~wide.unidentifiable)
    prior_std = wide.prior_std[sized]
    remaining, axes = np.linalg.eigh(
        wide.covariance[np.ix_(sized, sized)] / np.outer(prior_std, prior_std)
    )
    remaining = np.clip(remaining, _SHARE_ROUNDING, 1.0)
    values = get_parameter_values(wide.model, wide.estimate)[sized]
    rows = wide.weights.sum() * wide.residual.shape[1]
    log_evidence = _compute_log_evidence(
        axes.T @ (values / prior_std),
        remaining,
        (wide.whiten(wide.residual) ** 2).sum(),
        max(rows - count_effective_parameters(wide, ~is_sized), 1.0),
    )
    factor, scale = np.unravel_index(np.argmax(log_evidence), log_evidence.shape)
    prior_scale = widest_scale * PRIOR_SCALES[scale] / PRIOR_SCALES[-1]
    return PriorEvidence(float(prior_scale), float(_NOISE_FACTORS[factor]))


def _compute_log_evidence(
    estimate: np.ndarray,
    remaining: np.ndarray,
    squares: float,
    degrees_of_freedom: float,
) -> np.ndarray:
    """Log evidence of each noise factor and prior scale, up to a constant.

    Parameters
    ----------
    estimate : (A,) array
        Estimate along each principal axis of the covariance, in units of the prior.
    remaining : (A,) array
        Share of the prior variance that remains along each axis.
    squares : float
        Squares of the whitened residual of the fit.
    degrees_of_freedom : float
        Of the residual, given frames and targets.

    Returns
    -------
    (noise factors, prior scales) array
    """
    information = 1.0 / remaining - 1.0
    squares_without_geometry = squares + ((information + 2.0) * estimate**2).sum()
    noise_variance = _NOISE_FACTORS[:, None, None] ** 2
    prior_variance = ((PRIOR_SCALES / PRIOR_SCALES[-1]) ** 2)[:, None]
    explained = (
        (estimate / remaining) ** 2
        * prior_variance
        / (noise_variance + information * prior_variance)
    ).sum(axis=2)
    log_determinant = np.log1p(prior_variance * information / noise_variance).sum(
        axis=2
    )
    noise_variance = noise_variance[..., 0]
    return -0.5 * (
        degrees_of_freedom * np.log(noise_variance)
        + (squares_without_geometry - explained) / noise_variance
        + log_determinant
    )


def count_effective_parameters(fitted: Fit, counted: np.ndarray | None = None) -> float:
    """Count free parameters; one with a prior counts by the share that it leaves open.

    This is the trace of a ridge's hat matrix (Hastie et al., 3.4.1). Parameters that are
    not `counted`, (P,) bool array, are left out.
    """
    free = ~fitted.unidentifiable
    if counted is not None:
        free = free & counted
    shrinkage = np.diag(fitted.covariance)[free] / fitted.prior_std[free] ** 2
    return float(free.sum() - shrinkage.sum())
