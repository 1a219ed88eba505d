"""The verdict on a campaign: contents of verdict.json as frozen dataclasses.

`write_verdict` and `read_verdict` are the only writer and reader of the file. Fields have
the names and the order of its keys. Lengths are in m, angles in rad, probabilities
and shares in [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from elastocal.io.json_files import read_json, write_json
from elastocal.io.typed_json import (
    OMITTED_BY_DEFAULT,
    build_json_schema,
    from_document,
    to_document,
)

if TYPE_CHECKING:
    from pathlib import Path

# From this probability on, an effect is more probable than not.
_LIKELY = 0.5


@dataclass(frozen=True)
class Location:
    """A location of an effect.

    Attributes
    ----------
    location : str
        Joints or links in words: "joint 2", "links 2 and 3".
    probability : float
        Probability of the location, given that the effect is present.
    """

    location: str
    probability: float


@dataclass(frozen=True)
class EffectParameter:
    """An estimated parameter of an effect.

    Attributes
    ----------
    name : str
        Key of the candidate and name of the parameter, with a blank between them.
    value : float
        Estimate, in `unit`.
    std_error : float or None
        Standard error, in `unit`.
    prior_std : float or None
        Standard deviation of the normal prior about zero, if there is one.
    held : bool
        Whether the parameter keeps its value because the fit cannot determine it.
    identifiable : bool
        Whether the measurements say more of the parameter than its prior does.
    shape : bool
        Whether the parameter is a nonlinear one, which the search has chosen.
    """

    name: str
    value: float
    std_error: float | None
    unit: str
    prior_std: float | None
    held: bool
    identifiable: bool
    shape: bool = field(default=False, metadata=OMITTED_BY_DEFAULT)


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue that the declared model lacks.

    Attributes
    ----------
    name, family : str
        Names in the catalogue.
    joints : tuple of int
        Joints concerned, counted from 1.
    members : tuple of str
        Keys of the candidates that make up the effect.
    probability : float
        Posterior inclusion probability.
    locations : tuple of Location
        The most probable location first.
    parameters : tuple of EffectParameter
        Estimates of the most probable model, averaged over the other models.
    p_value : float
        p-value of the alarm.
    heldout_gain : float or None
        Share by which the effect lowers the RMS error of the validation poses.
    alternatives : tuple of str
        Mechanisms that may be meant instead.
    adopted : bool
        Whether the effect enters the model that is kept.
    cost_m : float or None
        RMS error over the campaign's poses and loads if this effect alone were left out
        of the correction; None if no command contains it.
    """

    name: str
    family: str
    joints: tuple[int, ...]
    members: tuple[str, ...]
    probability: float
    locations: tuple[Location, ...]
    parameters: tuple[EffectParameter, ...]
    p_value: float
    heldout_gain: float | None
    alternatives: tuple[str, ...]
    adopted: bool
    cost_m: float | None = None

    @property
    def is_likely(self) -> bool:
        """Whether the effect is more probable than not.

        The evidence chooses the effects of the model, and probabilities allow for laws
        that are only nearly true, so that an effect can be in the model without it.
        """
        return self.probability >= _LIKELY


@dataclass(frozen=True)
class FaultValue:
    """A number that describes a fault of the data; it has no standard error."""

    name: str
    value: float
    unit: str
    std_error: None = None


@dataclass(frozen=True, kw_only=True)
class DataFault:
    """A fault of the data, which stands among the effects of a verdict.

    Attributes
    ----------
    name, family : str
        Name of the fault, and "data".
    joints : tuple of int
        Joints concerned, counted from 1.
    detail : str
        The fault in a sentence.
    parameters : tuple of FaultValue
        Numbers that describe it.
    alternatives : tuple of str
        Other explanations of the measurements, in words.
    evidence : tuple of (float or None)
        RMS residual as written and with the correction, m.
    """

    # The file has the keys of an effect for a fault too; these never have a value.
    members: tuple[str, ...] = ()
    locations: tuple[Location, ...] = ()
    adopted: bool = False
    probability: None = None
    p_value: None = None
    heldout_gain: None = None
    name: str
    family: str
    joints: tuple[int, ...]
    detail: str
    parameters: tuple[FaultValue, ...]
    alternatives: tuple[str, ...]
    evidence: tuple[float | None, ...]
    cost_m: None = None


@dataclass(frozen=True)
class MechanismSet:
    """A hypothesis: a set of mechanisms with its probability and its locations."""

    mechanisms: tuple[str, ...]
    probability: float
    locations: dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Probabilities:
    """Posterior probabilities.

    Attributes
    ----------
    nothing : float
        That nothing is missing.
    stated : float or None
        That the verdict is right; None if nothing was tested.
    alarm_p_value : float
        p-value of the alarm test.
    mechanisms : dict
        Posterior inclusion probability by name of the mechanism.
    sets : tuple of MechanismSet
        The most probable set first.
    """

    nothing: float
    stated: float | None
    alarm_p_value: float
    mechanisms: dict[str, float]
    sets: tuple[MechanismSet, ...]


@dataclass(frozen=True)
class Misfit:
    """Reduced chi-square of the declared model and of the model with effects."""

    before: float
    after: float


@dataclass(frozen=True)
class NoiseEstimate:
    """The noise of the measurements.

    Attributes
    ----------
    source : str
        "repeats", "declared" or "residual".
    position_m, orientation_rad : float
        Standard deviations of the sensor, of each coordinate.
    joint_rad : tuple of float
        Repeatability of each joint.
    degrees_of_freedom : int
        Contrasts of repeats; 0 if the noise is declared.
    pose_rad : float
        Joint error that all measurements of a pose have in common.
    factor : float
        Ratio of the noise of the kept model to that of the measurements.
    """

    source: str
    position_m: float
    orientation_rad: float
    joint_rad: tuple[float, ...]
    degrees_of_freedom: int
    pose_rad: float
    factor: float


@dataclass(frozen=True)
class ErrorSummary:
    """Mean, root mean square, 95th percentile and maximum of position errors."""

    mean_m: float
    rms_m: float
    p95_m: float
    max_m: float


@dataclass(frozen=True)
class ErrorsBefore(ErrorSummary):
    """Errors of the robot before its calibration, with the 95 % interval of the share by
    which the calibration lowers their RMS."""

    reduction_ci95: tuple[float, float]


@dataclass(frozen=True)
class BeforeAfter:
    """Errors of the robot before its calibration (`HeldOut.before`) and of the final
    model."""

    before: ErrorSummary
    after: ErrorSummary


@dataclass(frozen=True)
class ErrorsByRange:
    """Errors within and beyond the range of the fitted poses.

    Attributes
    ----------
    poses : int
        Validation poses beyond the range.
    inside, outside : BeforeAfter or None
        None if there is no such pose.
    """

    poses: int
    inside: BeforeAfter | None
    outside: BeforeAfter | None


@dataclass(frozen=True)
class JointRange:
    """Smallest and largest coordinate of a joint, in "deg" or "m"."""

    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class BoardErrors:
    """RMS errors of a board in the camera, before the calibration and of the final
    model: what the camera reads less what the model predicts.

    Attributes
    ----------
    before_m, after_m : float
        Of the position.
    before_rad, after_rad : float
        Of the rotation.
    """

    before_m: float
    after_m: float
    before_rad: float
    after_rad: float


@dataclass(frozen=True)
class HeldOut:
    """Errors of the validation poses.

    Attributes
    ----------
    before : ErrorsBefore
        Errors of the robot that the user has: nominal geometry, springs only if the
        robot file states them, base and targets placed (`build_nominal_model`).
    declared, after : ErrorSummary
        Errors of the declared model, fitted, and of the final one.
    noise_floor_rms_m : float or None
        RMS error that the noise alone leaves; None if it is not known.
    reduction_ci95 : tuple of float
        95 % interval of the share by which the RMS falls from the declared model on.
    reduction_std_error : float
        Its standard error.
    poses, configurations : int
        Number of validation poses, and of different joint configurations.
    joint_ranges : tuple of JointRange
        Range of each joint.
    share_below_max : float
        Share of new poses whose error is below the largest one observed.
    outside_range : ErrorsByRange
        Errors within and beyond the range of the fitted poses.
    with_gross_errors : BeforeAfter or None
        Errors with all rows; None if there is no gross error.
    delivered : ErrorSummary
        Errors of the robot as it is corrected, the regression included.
    in_camera : BoardErrors or None
        Errors of the board in the camera; None if no camera measures.
    error : str
        What an error is, in words: of a position, or the distance from a socket.
    """

    before: ErrorsBefore
    declared: ErrorSummary
    after: ErrorSummary
    noise_floor_rms_m: float | None
    reduction_ci95: tuple[float, float]
    reduction_std_error: float
    poses: int
    configurations: int
    joint_ranges: tuple[JointRange, ...]
    share_below_max: float
    outside_range: ErrorsByRange
    with_gross_errors: BeforeAfter | None
    delivered: ErrorSummary
    in_camera: BoardErrors | None = field(default=None, metadata=OMITTED_BY_DEFAULT)
    error: str = field(default="position error", metadata=OMITTED_BY_DEFAULT)


@dataclass(frozen=True)
class Compliances:
    """Joint compliances in µrad/(N m), one for each joint.

    Attributes
    ----------
    before, after : tuple of float
        Of the declared model, and averaged over the probable models.
    std_error : tuple of float
        Standard errors; zeros if the compliances are not identified.
    identifiable : tuple of bool
        Whether the measurements say more of a compliance than its prior does.
    """

    before: tuple[float, ...]
    after: tuple[float, ...]
    std_error: tuple[float, ...]
    identifiable: tuple[bool, ...]


@dataclass(frozen=True)
class Convergence:
    """Whether the fits of the declared and of the final model converged."""

    declared: bool
    final: bool


@dataclass(frozen=True)
class Setting:
    """Value of a setting of the diagnosis, and the reason for it."""

    value: Any
    reason: str


@dataclass(frozen=True)
class GrossError:
    """A measurement that was left out as a gross error.

    Attributes
    ----------
    rows : tuple of int
        Rows in the file of measurements, counted from 1.
    session, pose, load, target
        Which measurement it is.
    held_out : bool
        Whether it belongs to the validation poses.
    distance_m, turn_rad : float
        Residual of the position and of the orientation; None without orientations.
    standard_deviations : float
        Size of the residual in standard deviations.
    probability : float
        Posterior probability that the measurement is wrong.
    detail : str
        The gross error in a sentence.
    """

    rows: tuple[int, ...]
    session: int
    pose: int
    load: int
    target: str
    held_out: bool
    distance_m: float
    turn_rad: float | None
    standard_deviations: float
    probability: float
    detail: str


@dataclass(frozen=True)
class RepeatableResidual:
    """The part of the residual of a model that is a function of the joints.

    Attributes
    ----------
    p_value : float
        Probability that chance alone predicts left-out configurations so well, by the
        best of a few regressions.
    remains : bool
        Whether the p-value is at most the level of the test.
    rms_m, rms_std_error_m : float
        RMS of the predictable part of each position, and its standard error.
    """

    p_value: float
    remains: bool
    rms_m: float
    rms_std_error_m: float


@dataclass(frozen=True)
class NextExperiment:
    """What the next experiment can resolve.

    Attributes
    ----------
    poses : int
        Number of proposed poses.
    reason : str
        Why there is nothing to measure; empty if there is.
    best, nearest : tuple of str
        Mechanisms of the best hypothesis and of its closest alternative.
    indistinguishable : tuple
        Hypotheses that no experiment within reach tells from the best one.
    separation, resolved : float or None
        Separation after all poses, and the probability that they resolve the ambiguity.
    """

    poses: int
    reason: str
    best: tuple[str, ...]
    nearest: tuple[str, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    separation: float | None
    resolved: float | None


@dataclass(frozen=True)
class Spread:
    """Scale of the intervals of a regression.

    Attributes
    ----------
    times : float or None
        Factor of the standard deviations that the regression states.
    otherwise_m : float
        Standard deviation of a coordinate where the regression states none.
    typical : float
        Root mean square of the errors, divided by `otherwise_m`.
    """

    times: float | None
    otherwise_m: float
    typical: float


@dataclass(frozen=True)
class CrossValidatedGain:
    """What a regression gains on configurations that it was not fitted to.

    Attributes
    ----------
    factor : float
        Shrinkage factor of the predictions, in [0, 1].
    statistic, p_value : float
        Student's t of the mean fall of the squared error, and its p-value.
    rms_m, rms_std_error_m : float
        RMS of the predictable part of each position, and its standard error.
    level : float
        Level of the test that the regression had to pass.
    """

    factor: float
    statistic: float
    p_value: float
    rms_m: float
    rms_std_error_m: float
    level: float


@dataclass(frozen=True)
class HalfWidths:
    """Half of the median width of the 95 % intervals within and outside the range."""

    within: float | None
    outside: float | None


@dataclass(frozen=True)
class RegressionChoice:
    """A regression on the residuals of a model, chosen by its training poses.

    Attributes
    ----------
    regression, words : str
        Name of the regression, and in words; empty if nothing is corrected.
    seed : int
        Seed of its folds.
    setting : dict or None
        Hyperparameters.
    spread : Spread or None
        Scale of its intervals.
    left_out : CrossValidatedGain or None
        Its gain; None with too few configurations.
    """

    regression: str
    words: str
    seed: int
    setting: dict[str, Any] | None
    spread: Spread | None
    left_out: CrossValidatedGain | None


@dataclass(frozen=True)
class Remainder(RegressionChoice):
    """A regression on the residuals of the final model, judged on validation poses.

    Attributes
    ----------
    errors : ErrorSummary
        Errors of the validation poses with it.
    rms_ci95_m, reduction_ci95 : tuple of float
        95 % intervals of their RMS, and of the share by which the regression lowers it.
    physics, regression_share, left : float
        Shares of the squared error of the declared model: explained by effects,
        explained by the regression, and left.
    outside : int
        Poses beyond the range that was fitted, where nothing is corrected.
    covered : float or None
        Share of the coordinates inside their 95 % intervals.
    half_width_m : HalfWidths or None
        Sizes of these intervals.
    """

    errors: ErrorSummary
    rms_ci95_m: tuple[float, float]
    reduction_ci95: tuple[float, float]
    physics: float
    regression_share: float
    left: float
    outside: int
    covered: float | None
    half_width_m: HalfWidths | None


@dataclass(frozen=True)
class Accuracy:
    """Size, scope and certainty of a predicted error, without the tracker's noise.

    Attributes
    ----------
    frame : str
        "robot" or "base".
    rms_m, worst_m : float
        Root mean square over the poses, and the error at the worst of them.
    rms_bound_m, worst_bound_m : float or None
        Their upper limits with one-sided `confidence`; None if they are not known.
    poses : int
        Number of poses.
    region : str
        Which poses these are, in words.
    offset_removed, left_out, contradicted
        As in `elastocal.application.frames.Scope`.
    left_out_m : float
        Share of `rms_m` by what is left out.
    form_m : float
        Share of `rms_m` by what the form of the model leaves open.
    repeated_m : float
        Share of `rms_m` by the repeatability of the joints and the error that each
        pose has of its own.
    regression_m : float
        Share of `rms_m` that a regression leaves beyond parameters and repeatability.
    confidence : float
        Confidence of the limits.
    fitted : bool
        Whether any parameter of the robot was fitted; if not, there is no prediction.
    """

    frame: str
    rms_m: float
    worst_m: float
    rms_bound_m: float | None
    worst_bound_m: float | None
    poses: int
    region: str
    offset_removed: bool = False
    left_out: tuple[str, ...] = ()
    left_out_m: float = 0.0
    form_m: float = 0.0
    contradicted: bool = False
    repeated_m: float = 0.0
    regression_m: float = 0.0
    confidence: float = 0.95
    fitted: bool = True


@dataclass(frozen=True)
class MisplacedFrame:
    """A tool, base or link that does not sit where it was declared.

    Attributes
    ----------
    place : str
        The frame in words.
    alternatives : tuple of str
        Frames that may be misplaced instead.
    shift_m : tuple of float
        Shift along x, y and z, m.
    sizes : float
        Length of the shift in usual errors of such a length.
    sentence : str
        The finding in words.
    """

    place: str
    alternatives: tuple[str, ...]
    shift_m: tuple[float, ...]
    sizes: float
    sentence: str


@dataclass(frozen=True, kw_only=True)
class TrainingVerdict:
    """The part of a verdict that the training poses decide.

    Attributes
    ----------
    verdict : str
        "adequate", "named", "class", "several", "unexplained" or "not_testable".
    effects : tuple of (Effect or DataFault)
        Missing effects, or faults of the data; never both.
    probabilities, misfit, other_models_m
        None if the data are at fault. `other_models_m` is the RMS difference of the
        predictions of other probable models.
    campaign : str
        Name of the campaign.
    noise : NoiseEstimate
        Noise of the measurements.
    heldout : HeldOut or None
        None until the validation poses are judged.
    kept : str
        Kind of the model that is kept: "frames", "declared" or "effect".
    compliance_urad_per_Nm : Compliances
        Joint compliances before and after.
    held : tuple of str
        Parameters that the fit cannot determine and that keep their values.
    candidates_tested : int
        Number of candidates.
    untestable : dict
        Reasons why candidates could not be tested, by key.
    converged : Convergence
        Whether the fits converged.
    warnings : tuple of str
        Sentences.
    settings : dict
        Settings of the diagnosis by name.
    contradictions : tuple of str
        Reasons why the declared model is not called adequate.
    gross_errors : tuple of GrossError
        Measurements that were left out.
    repeatable : RepeatableResidual or None
        Part of the residual that is a function of the joints.
    next_experiment : NextExperiment or None
        None if no experiment was asked for.
    """

    verdict: str
    effects: tuple[Effect | DataFault, ...]
    probabilities: Probabilities | None
    misfit: Misfit | None
    other_models_m: float | None
    campaign: str
    noise: NoiseEstimate
    heldout: HeldOut | None
    kept: str
    compliance_urad_per_Nm: Compliances
    held: tuple[str, ...]
    candidates_tested: int
    untestable: dict[str, str]
    converged: Convergence
    warnings: tuple[str, ...]
    settings: dict[str, Setting]
    contradictions: tuple[str, ...]
    gross_errors: tuple[GrossError, ...]
    repeatable: RepeatableResidual | None
    next_experiment: NextExperiment | None = field(
        default=None, metadata=OMITTED_BY_DEFAULT
    )

    @property
    def missing_effects(self) -> tuple[Effect, ...]:
        """Effects that the declared model lacks."""
        return tuple(effect for effect in self.effects if isinstance(effect, Effect))

    @property
    def faults(self) -> tuple[DataFault, ...]:
        """Faults of the data, after which a verdict says nothing of the robot."""
        return tuple(fault for fault in self.effects if isinstance(fault, DataFault))


@dataclass(frozen=True, kw_only=True)
class Verdict(TrainingVerdict):
    """Contents of verdict.json: the verdict with what the validation poses add.

    Attributes
    ----------
    heldout : HeldOut
        Errors of the validation poses.
    remainder : Remainder or None
        Regression on the residuals; None if the campaign asks for none.
    accuracy : Accuracy or None
        Predicted accuracy of the corrected robot; None if the data are at fault.
    physics : Accuracy or None
        The same of a robot that is corrected without the regression; None if there is none.
    misplaced : tuple of MisplacedFrame
        Frames that were declared in the wrong place.
    """

    heldout: HeldOut
    remainder: Remainder | None
    accuracy: Accuracy | None = None
    physics: Accuracy | None = None
    misplaced: tuple[MisplacedFrame, ...] = ()


def read_verdict(path: str | Path) -> Verdict:
    """Read and check verdict.json."""
    return from_document(Verdict, read_json(path), path)


def write_verdict(path: str | Path, verdict: Verdict) -> None:
    """Write verdict.json as an atomic write."""
    write_json(path, to_document(verdict), allow_nan=False)


def build_verdict_schema() -> dict[str, Any]:
    """Return the JSON schema of verdict.json."""
    return build_json_schema(Verdict)
