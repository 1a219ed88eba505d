"""What is meant by the accuracy of a robot that is commanded by its calibrated model: one definition for all commands.

The error at a pose is the real robot less the commanded model. Predicted, it has four parts: what the uncertainty of the
parameters leaves; the repeatability of the joints and the error that each new pose has of its own; what the form of the model
leaves open, by what other models of the diagnosis predict, or held-out poses where these show more; and all of what the fit
ascribes to effects that no command contains, such as a step of the set-up, for nothing shows that they leave the robot alone.
Nothing of the tracker's noise is in it.

It is stated in a frame. `BASE`, that of the declared base, where measurements were taken in it. `ROBOT`, the robot's own, is
after the best rigid placement of the base over the campaign's poses [1]. In both, where the offset of the target on the end
effector was fitted, a constant offset there is no error. Data and use have these freedoms in common: what the data cannot say
of them costs the use nothing. They are taken up over the campaign's poses, so that a single new pose has an error too.

[1] Kabsch, W., A solution for the best rotation to relate two sets of vectors, Acta Crystallographica A32, 1976.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import gammaincinv

from elastocal.application.calibrated import forward, pose_sensitivities, square_root
from elastocal.mechanics.kinematics import jacobians

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

ROBOT, BASE = "robot", "base"
PREDICTED, MEASURED = "predicted", "measured"
# Of every bound, one-sided: the level that GUM and JCGM 106 take for granted.
CONFIDENCE = 0.95
# Robots drawn from what the fit leaves possible: so many tell a risk of 5 % to half a percent.
_DRAWS, _SEED = 2000, 1
# Square at the worst pose over the mean square of all, of an error of form: 7 to 9 on the plant.
_WORST_OF_FORM = 9.0
# Poses at a time, of so many draws.
_AT_ONCE = 200
FRAMES = {ROBOT: "in the robot's own frame (after the best placement of its base)", BASE: "in the frame of the declared base"}


@dataclass(frozen=True)
class Accuracy:
    """Whose error, how large, how sure; lengths in m.

    `frame`: one of "robot", "base". `kind`: one of "predicted", "measured". `rms_m`, `worst_m`: root mean square over the
    poses, and at the worst of them. `rms_bound_m`, `worst_bound_m`: below which they are with one-sided confidence; None where
    nothing says so. `noise`: what became of the tracker's noise. `region`: which poses these are. `offset_removed`: whether a
    constant offset at the end effector counts as no error. `left_out`: effects of the fit that no command contains: what they
    were fitted to counts as error. `left_out_m`, `form_m`: of `rms_m`, by those, and by what the form of the model leaves open.
    `contradicted`: whether held-out poses showed that the form leaves more open than the fitted poses say. `repeated_m`: of
    `rms_m`, by the repeatability of the joints and the error that each pose has of its own.
    """

    frame: str
    kind: str
    rms_m: float
    worst_m: float
    rms_bound_m: float | None
    worst_bound_m: float | None
    noise: str
    poses: int
    region: str
    offset_removed: bool = False
    left_out: tuple[str, ...] = ()
    left_out_m: float = 0.0
    form_m: float = 0.0
    contradicted: bool = False
    repeated_m: float = 0.0
    confidence: float = CONFIDENCE

    def document(self) -> dict[str, Any]:
        """As JSON."""
        return asdict(self) | {"left_out": list(self.left_out)}


def accuracy_from(document: Mapping[str, Any]) -> Accuracy:
    """The inverse of `Accuracy.document`."""
    return Accuracy(**{**document, "left_out": tuple(document["left_out"])})


@dataclass(frozen=True)
class Scope:
    """In which frame errors are stated, and what of them is none there.

    `frame`: one of "robot", "base". `origin` (3,): about which the placement turns, m. `absorbed` (12, P): motion of the base
    (m, rad), constant offset and constant turn of the end effector that take up each parameter. `absorbed_before` (12,): the
    same of the nominal robot less the calibrated one. `left_out_m`, `left_out_worst_m`: what effects that are not commanded
    contribute at the campaign's poses: RMS, and at the worst. `unstated` (str, float, float): the same of effects that go with
    something that a command may not state: "time", "temperature" or "approach". `form_m`: what the form of the model leaves
    open there, RMS: other models predict otherwise, and so may the robot. `contradicted`: whether held-out poses showed that to
    be more than other models say. `repeated_freedom`: degrees of freedom of the square of the joints' repeatability; 0 where it
    is taken as known.
    """

    frame: str
    origin: np.ndarray
    absorbed: np.ndarray
    absorbed_before: np.ndarray
    offset_removed: bool = False
    left_out: tuple[str, ...] = ()
    left_out_m: float = 0.0
    left_out_worst_m: float = 0.0
    unstated: tuple[tuple[str, float, float], ...] = ()
    form_m: float = 0.0
    contradicted: bool = False
    repeated_freedom: float = 0.0

    def document(self) -> dict[str, Any]:
        """As JSON."""
        arrays = {name: getattr(self, name).tolist() for name in ("origin", "absorbed", "absorbed_before")}
        return asdict(self) | arrays | {"left_out": list(self.left_out)}


def scope_from(document: Mapping[str, Any]) -> Scope:
    """The inverse of `Scope.document`."""
    shapes = {"origin": (3,), "absorbed": (12, -1), "absorbed_before": (12,)}
    arrays = {name: np.array(document[name], float).reshape(shape) for name, shape in shapes.items()}
    unstated = tuple((name, rms, worst) for name, rms, worst in document["unstated"])
    return Scope(**{**document, **arrays, "left_out": tuple(document["left_out"]), "unstated": unstated})


@dataclass(frozen=True)
class Prediction:
    """Predicted errors at N poses.

    `parameters_m`, `repeated_m` (N,): root mean square by the uncertainty of the parameters, and by what each approach and each
    pose has of its own. `std_rad` (N,): of orientation, by both. `error_m` (N,): by both, by the form of the model and by what
    is not commanded. `bound_m` (N,): below which each error is with `CONFIDENCE`. `rms_m`, `worst_m` (draws,): over the poses,
    of robots that the fit leaves possible.
    """

    parameters_m: np.ndarray
    repeated_m: np.ndarray
    std_rad: np.ndarray
    error_m: np.ndarray
    bound_m: np.ndarray
    rms_m: np.ndarray
    worst_m: np.ndarray
    scope: Scope

    def accuracy(self, region: str) -> Accuracy:
        """The statement over these poses, named in words."""
        scope = self.scope
        return Accuracy(
            scope.frame,
            PREDICTED,
            float(np.sqrt((self.error_m**2).mean())),
            float(np.sqrt((self.worst_m**2).mean())),
            float(np.quantile(self.rms_m, CONFIDENCE)),
            float(np.quantile(self.worst_m, CONFIDENCE)),
            "the tracker's noise is not in it",
            len(self.error_m),
            region,
            scope.offset_removed,
            scope.left_out,
            scope.left_out_m,
            scope.form_m,
            scope.contradicted,
            float(np.sqrt((self.repeated_m**2).mean())),
        )


def predict_errors(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions, draws: int = _DRAWS
) -> Prediction:
    """Predicted errors of the corrected robot where it is commanded to joint angles (N, n).

    Drawn robots, most of the work, are for errors over all poses; where those of each pose are enough, none (0) need be.
    """
    scope, robot = _under(scope_in(calibrated), operating), calibrated.robot
    root, repeated = square_root(calibrated.covariance), np.hypot(calibrated.noise.joint_rad, calibrated.noise.pose_rad)
    stream = np.random.default_rng(_SEED)
    drawn = stream.standard_normal((root.shape[1], draws))
    freedom = scope.repeated_freedom
    size = np.sqrt(stream.gamma(0.5 * freedom, 2.0 / freedom, draws)) if freedom else np.ones(draws)
    total, worst = np.zeros(draws), np.zeros(draws)
    parts = []
    for start in range(0, len(reported_angles), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        angles, under = reported_angles[part], operating.part(part)
        columns = placement(scope, *forward(calibrated, angles, under))
        moved = (pose_sensitivities(calibrated, angles, under) - columns @ scope.absorbed) @ root
        jacobian = jacobians(robot.chain, robot.model_angles(angles), robot.chain.end_effector)
        apart = jacobian * repeated
        parts.append([each @ each.transpose(0, 2, 1) for each in (moved, apart)])
        off = moved[:, :3] @ drawn + apart[:, :3] @ (size * stream.standard_normal((len(angles), apart.shape[2], draws)))
        squares = (off**2).sum(axis=1)
        total += squares.sum(axis=0)
        worst = np.maximum(worst, squares.max(axis=0))
    covariances = [np.concatenate(each) for each in zip(*parts, strict=True)]
    ours, own = (np.diagonal(covariance, axis1=1, axis2=2) for covariance in covariances)
    left_out, form = scope.left_out_m**2, scope.form_m**2
    # An error of form is one law over all poses: what is open is how large it is.
    unknown = form * stream.standard_normal(draws) ** 2
    return Prediction(
        np.sqrt(ours[:, :3].sum(axis=1)),
        np.sqrt(own[:, :3].sum(axis=1)),
        np.sqrt((ours + own)[:, 3:].sum(axis=1)),
        np.sqrt((ours + own)[:, :3].sum(axis=1) + left_out + form),
        np.sqrt(quantile_of_length((covariances[0] + covariances[1])[:, :3, :3] + form / 3.0 * np.eye(3)) ** 2 + left_out),
        np.sqrt(total / len(reported_angles) + left_out + unknown),
        np.sqrt(worst + scope.left_out_worst_m**2 + _WORST_OF_FORM * unknown),
        scope,
    )


def _under(scope: Scope, operating: OperatingConditions) -> Scope:
    """A scope with what goes with conditions that are not given among what is left out."""
    given = {"time": operating.time_s, "temperature": operating.temperature_c, "approach": operating.approach}
    missing = [entry for entry in scope.unstated if given[entry[0]] is None]
    return replace(
        scope,
        left_out=(*scope.left_out, *(f"what goes with the {name} (not given)" for name, _, _ in missing)),
        left_out_m=float(np.linalg.norm([scope.left_out_m, *(rms for _, rms, _ in missing)])),
        left_out_worst_m=float(np.linalg.norm([scope.left_out_worst_m, *(worst for _, _, worst in missing)])),
    )


def before_m(calibrated: CalibratedRobot, position: np.ndarray, rotation: np.ndarray, off: np.ndarray) -> np.ndarray:
    """How far an uncorrected robot misses poses, ndarray (N,), m.

    `off` (N, 6) is the pose less that of the calibrated robot, base axes; what a placement takes up is no error.
    """
    scope = scope_in(calibrated)
    return np.linalg.norm((off - placement(scope, position, rotation) @ scope.absorbed_before)[:, :3], axis=1)


def scope_in(calibrated: CalibratedRobot) -> Scope:
    """That of a calibrated robot; without one its errors are in base axes and nothing is left out."""
    if calibrated.scope is not None:
        return calibrated.scope
    return Scope(BASE, np.zeros(3), np.zeros((12, len(calibrated.covariance))), np.zeros(12))


def scope_about(position: np.ndarray) -> Scope:
    """That of positions (N, 3) without a fit: placements turn about their middle."""
    return Scope(ROBOT, position.mean(axis=0), np.zeros((12, 0)), np.zeros(12))


def placement(scope: Scope, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Displacement and turn of poses by shift and turn of the base, offset and turn of the end effector, (N, 6, 12)."""
    x, y, z = (position - scope.origin).T
    found = np.zeros((len(position), 6, 12))
    found[:, :3, :3] = found[:, 3:, 3:6] = np.eye(3)
    found[:, 0, 4], found[:, 0, 5] = z, -y
    found[:, 1, 3], found[:, 1, 5] = -z, x
    found[:, 2, 3], found[:, 2, 4] = y, -x
    found[:, :3, 6:9] = found[:, 3:, 9:] = rotation
    return found


def find_absorbed(columns: np.ndarray, field: np.ndarray, free: np.ndarray) -> np.ndarray:
    """How much of the free columns of `placement` takes up most of a field (N, 6, K) of displacements, ndarray (12, K).

    Positions decide on all but the constant turn of the end effector, which takes up what is left of orientations.
    """
    found = np.zeros((12, field.shape[2]))
    for rows, first, last in ((slice(0, 3), 0, 9), (slice(3, 6), 9, 12)):
        mine = np.flatnonzero(free[first:last]) + first
        if len(mine):
            left = (field - columns @ found)[:, rows].reshape(3 * len(field), field.shape[2])
            found[mine] = np.linalg.lstsq(columns[:, rows, mine].reshape(len(left), -1), left, rcond=None)[0]
    return found


def subtract_placement(scope: Scope, position: np.ndarray, rotation: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Displacements (N, 6, K) of poses less what the placement that a scope leaves free takes up of each over these poses."""
    columns = placement(scope, position, rotation)
    free = np.repeat([scope.frame == ROBOT, scope.frame == ROBOT, scope.offset_removed, False], 3)
    return np.asarray(fields - columns @ find_absorbed(columns, fields, free))


def remove_rigid_motion(displacement: np.ndarray, position: np.ndarray, rotation: np.ndarray | None = None) -> np.ndarray:
    """Displacements (..., N, 3) less the small rigid motion that explains most of their squares.

    With rotations (N, 3, 3) of the end effector less a constant offset there too.
    """
    scope = scope_about(position)
    columns = placement(scope, position, np.zeros((len(position), 3, 3)) if rotation is None else rotation)
    field = np.moveaxis(displacement.reshape(-1, *displacement.shape[-2:]), 0, -1)
    padded = np.concatenate([field, np.zeros_like(field)], axis=1)
    free = np.repeat([True, True, rotation is not None, False], 3)
    left = (padded - columns @ find_absorbed(columns, padded, free))[:, :3]
    return np.moveaxis(left, -1, 0).reshape(displacement.shape)


def quantile_of_length(covariance: np.ndarray) -> np.ndarray:
    """95 % quantile of the length of normal vectors of some covariances (N, 3, 3), ndarray (N,).

    By the gamma distribution that has the first two moments of the square [1].

    [1] Satterthwaite, F. E., An approximate distribution of estimates of variance components, Biometrics Bulletin 2, 1946.
    """
    mean = np.trace(covariance, axis1=1, axis2=2)
    variance = 2.0 * (covariance**2).sum(axis=(1, 2))
    safe = np.where(mean > 0.0, mean, 1.0)
    shape = np.where(mean > 0.0, safe**2 / np.where(variance > 0.0, variance, 1.0), 1.5)
    return np.sqrt(gammaincinv(shape, CONFIDENCE) * mean / shape)


def root_mean_square(displacement: np.ndarray) -> float:
    """Root mean square of the lengths of displacements (N, 3)."""
    return float(np.sqrt((displacement**2).sum(axis=1).mean()))


def accuracy_sentence(accuracy: Accuracy) -> str:
    """One sentence with everything that an accuracy statement has, the same wherever it stands."""
    offset = " and of a constant offset at the end effector" if accuracy.offset_removed else ""

    def value(size: float, bound: float | None) -> str:
        sure = "" if bound is None else f" ({100 * accuracy.confidence:g} % sure: below {millimetres(bound)})"
        return millimetres(size) + sure

    frame = FRAMES[accuracy.frame]
    frame = frame[:-1] + offset + ")" if accuracy.frame == ROBOT else frame + (" (after" + offset[4:] + ")" if offset else "")
    rms, worst = value(accuracy.rms_m, accuracy.rms_bound_m), value(accuracy.worst_m, accuracy.worst_bound_m)
    text = (
        f"{accuracy.kind.capitalize()} position error of the corrected robot {frame}: {rms} RMS over {accuracy.region} "
        f"({accuracy.poses}), {worst} at the worst of them; {accuracy.noise}."
    )
    if accuracy.left_out:
        names = ", ".join(accuracy.left_out)
        text += f" {millimetres(accuracy.left_out_m)} of it stand for {names}, which no command contains."
    if accuracy.form_m:
        why = "validation poses were missed by more than the fit says" if accuracy.contradicted else "other models fit as well"
        text += f" {millimetres(accuracy.form_m)} of it stand for the form of the model: {why}."
    return text


def millimetres(length_m: float) -> str:
    """A length as it is printed, to the micrometre, so that one error has one form everywhere."""
    return f"{1e3 * length_m:.3f} mm"
