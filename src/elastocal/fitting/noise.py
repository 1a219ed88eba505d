"""What is taken of errors before effects are sought: noise of the measurements, and
tolerances of what a campaign declares.

Noise is a sensor part, alike in all directions, and the repeatability of the joints, by
the Jacobian. Repeats of a state tell both: each repeat is a fresh approach, so that the
joints come to rest a little differently and move all targets together, while the sensor
errs for each target on its own.

A robot is off its drawing by so many times what is plausible; one number for all
declared geometry, by type II maximum likelihood (Good, The Estimation of Probabilities,
1965), together with how many times the noise taken the measurements scatter. Both come
of the declared model alone, so that all models of a campaign, with effects and without,
have the same geometry beforehand.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy  # Its optimizers load where a campaign has repeats enough for them.
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

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations

# Fewer contrasts of repeats than this do not separate the joints' part from the
# sensor's; fewer than the second say nothing of their own; as many as the third tell
# every deviation to a percent, and more only take time.
MIN_CONTRASTS_FOR_JOINTS = 60
MIN_CONTRASTS = 9
MAX_CONTRASTS = 20_000
# No sensor repeats to less than this, m or rad: a sixtieth of the wavelength of a
# laser.
FINEST_RESOLUTION = 1e-8
# Half width of the interval that holds 95 % of a normal distribution, in standard
# deviations (JCGM 100:2008, section 6).
_COVERAGE = 1.959964
# How sure the joint part should be to be no smaller than taken: too small a value
# raises false alarms, too large one costs power.
_UPPER = 0.8
_SMALLEST_RAD = 1e-8
_LARGEST_RAD = 1e-2
# Deviations of a joint that are tried between these: steps of two fifths.
_DEVIATIONS = 40
# Sizes of declared geometry, in plausible sizes: measured robots exceed data-sheet
# tolerances tenfold, and none is ten times better than these.
PRIOR_SCALES = np.geomspace(0.1, 10.0, 9)
# Noise that is there over the noise taken, in steps that change no verdict.
_FACTORS = np.geomspace(1.0, 1e4, 185)
# Shares of a prior's variance that measurements leave below this are rounding.
_ROUNDING = 1e-14
# Noise that is taken before anything is known of it, m and rad.
_ASSUMED = 1e-4


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one measurement.

    `source`: one of "repeats", "declared", "residual". `position_m`, `orientation_rad`:
    sensor part, each component. `joint_rad` (n,): repeatability of each joint.
    `degrees_of_freedom`: contrasts of repeats behind the figures; 0 where they are
    declared. `pose_rad`: error of each joint that all measurements of a pose have in
    common.
    """

    source: str
    position_m: float
    orientation_rad: float
    joint_rad: np.ndarray
    degrees_of_freedom: int = 0
    pose_rad: float = 0.0

    @property
    def without_pose_error(self) -> Noise:
        """The same without what the measurements of a pose have in common."""
        return replace(self, pose_rad=0.0)

    def scaled(self, factor: float) -> Noise:
        """The same with the noise of single measurements multiplied."""
        position = factor * self.position_m
        orientation = factor * self.orientation_rad
        joint = factor * self.joint_rad
        return replace(
            self, position_m=position, orientation_rad=orientation, joint_rad=joint
        )

    def sensor_std(self, rows: int) -> np.ndarray:
        """The sensor's part of each component of a measurement, (rows,)."""
        return np.repeat([self.position_m, self.orientation_rad], 3)[:rows]


def serialize_noise(noise: Noise) -> dict[str, Any]:
    """Noise as a JSON document."""
    return asdict(noise) | {"joint_rad": noise.joint_rad.tolist()}


def parse_noise(facts: Mapping[str, Any]) -> Noise:
    """Noise from its JSON document, or from a verdict, which tells more of it."""
    known = {entry.name: facts["noise"][entry.name] for entry in fields(Noise)}
    return Noise(**known | {"joint_rad": np.array(known["joint_rad"])})


def choose_noise(
    campaign: Campaign, model: Model, estimate: Estimate
) -> tuple[Noise | None, list[str]]:
    """Noise from repeats where there are enough, else as a campaign declares it, or by
    what its measurements state.

    Of expanded uncertainties of the measurements, 95 % of one coordinate, the root mean
    square counts. A ratio of the two outside the chi-squared interval of 99 % of a
    variance is a warning. Returns `noise`: None where there are neither.
    """
    repeats = estimate_noise_from_repeats(model, estimate, campaign.measurements)
    stated = campaign.noise or {}
    u95 = campaign.measurements.u95_m
    declared = None
    if stated or u95 is not None:
        position = (
            stated["position_m"]
            if u95 is None
            else float(np.sqrt((u95**2).mean())) / _COVERAGE
        )
        joints = np.zeros(campaign.robot.joints) + stated.get("joint_rad", 0.0)
        declared = Noise(
            "declared", position, stated.get("orientation_rad", position), joints
        )
    if repeats is None:
        return declared, [] if declared else [
            "no repeats and no declared noise: nothing says how large the residual may be"
        ]
    if declared is None:
        return repeats, []
    ratio = repeats.position_m / declared.position_m
    of_positions = repeats.degrees_of_freedom * 3 // model.rows
    low, high = np.sqrt(
        2 * gammaincinv(of_positions / 2, [0.005, 0.995]) / of_positions
    )
    if low < ratio < high:
        return repeats, []
    return repeats, [
        f"repeats show {ratio:.2f} times the declared noise of positions; the repeats are used"
    ]


def estimate_noise(case: Case) -> tuple[Noise, list[str]]:
    """Noise from repeats or as declared, from the residual of the declared model where
    there is neither; and warnings."""
    start = register_placement(case.model, case.observations)
    noise, warnings = choose_noise(case.campaign, case.model, start)
    if noise is None:
        assumed = Noise(
            "residual", _ASSUMED, _ASSUMED, np.zeros(case.campaign.robot.joints)
        )
        # The widest prior leaves nearly what none would leave, without parameters that
        # nothing determines.
        model = set_prior_scale(case.model, PRIOR_SCALES[-1])
        left = fit_model(model, case.observations, assumed, start).residual
        typical = [
            max(float(np.sqrt((part**2).mean())), FINEST_RESOLUTION)
            for part in (left[:, :3], left[:, -3:])
        ]
        noise = replace(assumed, position_m=typical[0], orientation_rad=typical[1])
        # What parameters have taken of it is given back.
        noise = noise.scaled(
            maximize_evidence(
                fit_model(
                    model,
                    case.observations,
                    noise,
                    start,
                    tolerance=INTERMEDIATE_TOLERANCE,
                )
            )[1]
        )
    return noise, warnings


def estimate_noise_from_repeats(
    model: Model, estimate: Estimate, measurements: Measurements
) -> Noise | None:
    """Noise by restricted maximum likelihood from the differences between repeats.

    The likelihood is that of error contrasts (Patterson and Thompson, Biometrika 58,
    1971), here of orthonormal Helmert contrasts of repeats; L-BFGS-B (Byrd et al. 1995)
    finds its maximum. The joints' part is taken where it is worth its parameters by
    Akaike's criterion (1974), at the upper limit of a one-sided chi-squared interval of
    80 %; with fewer contrasts than show it, their mean square is the sensor's part.

    `estimate`: its frames turn measurements into base axes; nothing else of it matters.
    Returns None where there are too few repeats, or where they do not differ at all.
    """
    contrasts = _contrasts(model, estimate, measurements)
    sensors = model.rows // 3
    joints = model.sites.joints
    if contrasts is None:
        return None
    total = contrasts.count * sensors
    start = np.sqrt(contrasts.squares / contrasts.count)
    if start.min() < FINEST_RESOLUTION:
        # The same number again and again is a sensor that stands still or digits that
        # were cut off, not one without noise.
        return None
    sensor = Noise(
        "repeats", float(start[0]), float(start[-1]), np.zeros(joints), total
    )
    if total < MIN_CONTRASTS_FOR_JOINTS:
        return sensor
    both = np.log(start)
    free = np.concatenate([both, np.full(joints, np.log(0.3 * start[0]))])
    bounds = [(value - 7, value + 1) for value in both] + [
        (np.log(_SMALLEST_RAD), np.log(_LARGEST_RAD))
    ] * joints
    fitted = scipy.optimize.minimize(
        _negative_log_likelihood,
        free,
        (contrasts,),
        "L-BFGS-B",
        jac=True,
        bounds=bounds,
    )
    # Akaike: the joints' part must be worth its parameters.
    nothing = np.concatenate([both, np.full(joints, np.log(_SMALLEST_RAD))])
    if fitted.fun + joints > _negative_log_likelihood(nothing, contrasts)[0]:
        return sensor
    values = np.exp(fitted.x)
    # Each approach draws a joint once, however many targets are read.
    per_joint = max(min(total // (joints + 1), len(contrasts.along)), 1)
    inflation = np.sqrt(per_joint / (2 * gammaincinv(per_joint / 2, 1 - _UPPER)))
    position = float(values[0])
    orientation = float(values[sensors - 1])
    return replace(
        sensor,
        position_m=position,
        orientation_rad=orientation,
        joint_rad=values[sensors:] * inflation,
    )


def estimate_joint_repeatability(
    model: Model, estimate: Estimate, measurements: Measurements
) -> tuple[float, float]:
    """How well joints repeat, rad, all alike, where the sensor hides each of them;
    degrees of freedom that its square has.

    The root mean square of what repeats leave possible, by the restricted likelihood of
    `noise_from_repeats`, its maximum over the sensor's part, evenly over the deviation
    of a joint. Zeros where there are too few repeats to say anything.
    """
    contrasts = _contrasts(model, estimate, measurements)
    sensors = model.rows // 3
    joints = model.sites.joints
    if contrasts is None:
        return 0.0, 0.0
    start = 0.5 * np.log(
        np.maximum(contrasts.squares / contrasts.count, FINEST_RESOLUTION**2)
    )
    deviations = np.geomspace(_SMALLEST_RAD, _LARGEST_RAD, _DEVIATIONS)

    def value(free: np.ndarray, joint: float) -> tuple[float, np.ndarray]:
        total, slope = _negative_log_likelihood(
            np.concatenate([free, np.full(joints, np.log(joint))]), contrasts
        )
        return total, slope[:sensors]

    minimize = scipy.optimize.minimize
    bounds = [(at - 7, at + 1) for at in start]
    likelihood = -np.array(
        [
            minimize(value, start, (d,), "L-BFGS-B", jac=True, bounds=bounds).fun
            for d in deviations
        ]
    )
    # Even steps of the logarithm: each stands for a range as wide as the deviation
    # itself.
    weights = np.exp(likelihood - likelihood.max()) * deviations
    weights /= weights.sum()
    mean = float(weights @ deviations**2)
    return float(np.sqrt(mean)), 2.0 * mean**2 / float(
        weights @ (deviations**2 - mean) ** 2
    )


@dataclass(frozen=True)
class _Contrasts:
    """What orthonormal contrasts v (k * rows,) of repeats with k targets, G of them,
    say of the noise, Jacobians S beside them.

    `count`: numbers of one sensor's part, of positions or of orientations, in all v.
    `squares` (s,): v'v of each sensor's part, of all. `along` (G, s, n): S'v of each.
    `gram` (G, s, n, n): S'S of each.
    """

    count: int
    squares: np.ndarray
    along: np.ndarray
    gram: np.ndarray


def _contrasts(
    model: Model, estimate: Estimate, measurements: Measurements
) -> _Contrasts | None:
    """Contrasts between repeats; None where there are too few to say anything."""
    if not len(measurements) or not np.ptp(measurements.repeat):
        return None
    observations, repeated = separate_approaches(remove_outlying_repeats(measurements))
    first = np.flatnonzero(np.diff(repeated, prepend=-1))
    # The targets that an approach saw, beside those of the first approach to its state.
    seen = np.bincount(observations.state)
    targets = np.full((len(seen), seen.max()), -1)
    before = (np.cumsum(seen) - seen)[observations.state]
    targets[observations.state, np.arange(len(observations)) - before] = (
        observations.target
    )
    alike = (targets == targets[first[repeated]]).all(axis=1)
    number = np.bincount(repeated, alike).astype(int)
    # As many as tell, of states spread over the campaign.
    wanted = np.flatnonzero(number > 1)
    share = ((number - 1) * seen[first]).sum() * model.rows / MAX_CONTRASTS
    wanted = (
        wanted[np.linspace(0, len(wanted) - 1, int(len(wanted) / share)).astype(int)]
        if share > 1
        else wanted
    )
    chosen = alike & np.isin(repeated, wanted)
    some = select_states(observations, chosen)
    bare = replace(model, effects=())
    if len(some) * model.rows < MIN_CONTRASTS:
        return None
    at = replace(estimate, coefficients=(), shapes=())
    line = linearize(bare, at, some, evaluate_conditions(bare, at, some.states))
    sensors = model.rows // 3
    squares = np.zeros(model.rows // 3)
    found = []
    targets_of = np.bincount(some.state)[some.state]
    for members in batch_groups_by_size(
        np.unique(repeated[chosen], return_inverse=True)[1][some.state]
    ):
        for count in np.unique(targets_of[members[:, 0]]):
            mine = members[targets_of[members[:, 0]] == count].reshape(
                -1, members.shape[1] // count, count
            )
            groups, repeats = mine.shape[:2]
            vectors = helmert(repeats) @ line.residual[mine].reshape(
                groups, repeats, -1
            )
            vectors = vectors.reshape(groups, repeats - 1, count, sensors, 3)
            jacobian = line.joint_jacobian[mine[:, 0]].reshape(
                groups, count, sensors, 3, -1
            )
            along = np.einsum("gtsxn,grtsx->grsn", jacobian, vectors)
            gram = np.einsum("gtsxn,gtsxm->gsnm", jacobian, jacobian)
            squares += (vectors**2).sum(axis=(0, 1, 2, 4))
            found.append(
                (
                    along.reshape(-1, *along.shape[2:]),
                    np.repeat(gram, repeats - 1, axis=0),
                    vectors.size // sensors,
                )
            )
    alongs, grams, counts = zip(*found, strict=True)
    contrasts = _Contrasts(
        sum(counts), squares, np.concatenate(alongs), np.concatenate(grams)
    )
    return contrasts if contrasts.count * sensors >= MIN_CONTRASTS else None


def _negative_log_likelihood(
    logs: np.ndarray, contrasts: _Contrasts
) -> tuple[float, np.ndarray]:
    """Minus the logarithm of the restricted likelihood, and its derivatives by the
    logarithms of the deviations.

    With D the variances of the sensors and L those of the joints, Sigma = D + S L S'
    has the determinant |D| |I + L C| and the inverse D^-1 - D^-1 S A S' D^-1, C = S'
    D^-1 S and A = (I + L C)^-1 L, by Woodbury's identity (Hager, SIAM Review 31, 1989).
    """
    sensors = len(contrasts.squares)
    precision = np.exp(-2.0 * logs[:sensors])
    deviation = np.exp(logs[sensors:])
    along = precision @ contrasts.along
    gram = (precision[:, None, None] * contrasts.gram).sum(axis=1)
    inner = np.eye(len(deviation)) + deviation[:, None] * gram * deviation
    left = deviation[:, None] * np.linalg.inv(inner) * deviation
    solved = (left @ along[..., None])[..., 0]
    total = contrasts.count * logs[:sensors].sum() + 0.5 * (
        precision @ contrasts.squares - (along * solved).sum()
    )
    total += 0.5 * np.linalg.slogdet(inner)[1].sum()
    # S' times what the inverse makes of v; of each sensor's part, what the joints
    # explain of its squares and its variance.
    rest = along - (gram @ solved[..., None])[..., 0]
    explained = 2.0 * (contrasts.along @ solved[..., None])[..., 0]
    explained -= (
        (contrasts.gram @ solved[:, None, :, None])[..., 0] * solved[:, None]
    ).sum(axis=2)
    explained -= (left[:, None] * contrasts.gram).sum(axis=(2, 3))
    slopes = contrasts.count + precision * (explained.sum(axis=0) - contrasts.squares)
    variance = np.diagonal(gram, axis1=1, axis2=2) - (gram * (gram @ left)).sum(axis=2)
    return total, np.concatenate(
        [slopes, deviation**2 * (variance - rest**2).sum(axis=0)]
    )


def fit_declared_model(model: Model, observations: Observations, noise: Noise) -> Fit:
    """Fit a declared model, its geometry under priors of the most probable size;
    without geometry as `least_squares.fit_model`."""
    if not find_declared_geometry(model):
        return fit_model(model, observations, noise)
    wide = fit_model(
        set_prior_scale(model, PRIOR_SCALES[-1]),
        sample_observations(observations, START_SAMPLE_SIZE),
        noise,
        tolerance=INTERMEDIATE_TOLERANCE,
    )
    return fit_model(
        set_prior_scale(model, maximize_evidence(wide)[0]),
        observations,
        noise,
        wide.estimate,
        reweight_first_step=True,
    )


def find_declared_geometry(model: Model) -> set[str]:
    """Names of declared effects whose size is estimated: those whose parameters have no
    prior of their own, but for springs."""
    return {
        effect.effect
        for effect in model.effects
        if effect.family != "declared"
        and all(p.prior_std is None or p.sized for p in effect.parameters)
    }


def set_prior_scale(model: Model, size: float) -> Model:
    """A declared model with priors of a size, in plausible sizes, on its geometry."""
    sized = find_declared_geometry(model)
    effects = [
        set_prior_std(effect, [size * p.plausible for p in effect.parameters])
        if effect.effect in sized
        else effect
        for effect in model.effects
    ]
    return replace(model, effects=tuple(effects))


def set_prior_std(
    candidate: Candidate, deviations: Sequence[float] | np.ndarray
) -> Candidate:
    """A candidate with normal priors about zero whose standard deviations were
    estimated."""
    pairs = zip(candidate.parameters, deviations, strict=True)
    return replace(
        candidate,
        parameters=tuple(
            replace(p, prior_std=float(std), sized=True) for p, std in pairs
        ),
    )


def maximize_evidence(wide: Fit) -> tuple[float, float]:
    """Size of declared geometry, in plausible sizes, and noise over the noise taken
    that make the measurements most probable.

    In closed form from a fit under the widest prior: given frames and targets the
    geometry is linear, and the principal axes of its covariance in units of the prior
    are independent. The noise is no less than the noise taken.
    """
    mine = np.flatnonzero(
        np.array([parameter.sized for _, parameter in wide.parameters], bool)
        & ~wide.unidentifiable
    )
    prior = wide.prior_std[mine]
    left, axes = np.linalg.eigh(
        wide.covariance[np.ix_(mine, mine)] / np.outer(prior, prior)
    )
    left = np.clip(left, _ROUNDING, 1.0)
    shift = axes.T @ (get_parameter_values(wide.model, wide.estimate)[mine] / prior)
    seen = 1.0 / left - 1.0
    # Squares of the whitened residual were all of it zero, beside frames and targets.
    squares = (wide.whiten(wide.residual) ** 2).sum() + ((seen + 2.0) * shift**2).sum()
    freedom = max(
        wide.weights.sum() * wide.residual.shape[1]
        - (~wide.unidentifiable).sum()
        + len(mine),
        1.0,
    )
    variance = _FACTORS[:, None, None] ** 2
    wider = ((PRIOR_SCALES / PRIOR_SCALES[-1]) ** 2)[:, None]
    explained = ((shift / left) ** 2 * wider / (variance + seen * wider)).sum(axis=2)
    volume = np.log1p(wider * seen / variance).sum(axis=2)
    variance = variance[..., 0]
    evidence = -0.5 * (
        freedom * np.log(variance) + (squares - explained) / variance + volume
    )
    factor, size = np.unravel_index(np.argmax(evidence), evidence.shape)
    return float(PRIOR_SCALES[size]), float(_FACTORS[factor])


def count_effective_parameters(fitted: Fit) -> float:
    """Free parameters, with a prior the share that it leaves open: trace of a ridge's
    hat matrix (Hastie et al., 3.4.1)."""
    free = ~fitted.unidentifiable
    return float(
        free.sum()
        - (np.diag(fitted.covariance)[free] / fitted.prior_std[free] ** 2).sum()
    )
