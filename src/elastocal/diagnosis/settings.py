"""Every number that a diagnosis rests on, with its reason and its source; recorded in verdict.json."""

from dataclasses import asdict, dataclass, field, fields
from typing import Any, TypeVar

_Value = TypeVar("_Value")


def _setting(default: _Value, reason: str) -> _Value:
    return field(default=default, metadata={"reason": reason})


@dataclass(frozen=True)
class Settings:
    """Choices of the diagnosing engine."""

    alarm_level: float = _setting(
        0.02,
        "probability of an alarm where nothing is missing, exact by simulation; half of a 4 % budget; the rest for the noise",
    )
    alarm_draws: int = _setting(
        499, "draws of the null distribution; (1 + exceedances) / (1 + draws) is exact (Davison and Hinkley 1997, 4.2)"
    )
    mechanism_probability: float = _setting(
        0.02, "prior probability of each mechanism, of which there are some thirty: what it states fits development cases best"
    )
    gravity_probability: float = _setting(
        0.5,
        "prior probability of link_weight where no masses are declared: every arm has weight; what is open is whether it shows",
    )
    other_probability: float = _setting(
        0.1, "prior probability of what the catalogue does not have: more than of any one mechanism, less than of all together"
    )
    further_location: float = _setting(
        0.5, "ratio of the geometric prior on the number of locations of a mechanism: one defect at five joints is one finding"
    )
    scales: tuple[float, ...] = _setting(
        (0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
        "sizes of an effect to average over, in those of the table: three times what such an effect reaches is a bad case",
    )
    scale_center: float = _setting(0.1, "most likely size of an effect, in sizes of the table")
    scale_spread: tuple[float, float] = _setting(
        (3.0, 1.0),
        "spread of the logarithm of the size below and above the center: small effects are common, large ones are met",
    )
    pose_steps: tuple[float, ...] = _setting(
        (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0),
        "grid of the error common to the measurements of a pose, in standard errors of a joint angle from one pose",
    )
    pose_error_probability: float = _setting(0.5, "prior probability that the measurements of a pose have an error in common")
    pose_repeatability_rad: float = _setting(
        5e-5,
        "error of a joint common to the measurements of a pose that chance makes: robots repeat a pose to 20 to 50 µrad (ISO"
        " 9283); more is thought of where what is left is no function of the joints, and what repeats show is noise already",
    )
    harmonic_decay: float = _setting(0.3, "amplitudes of gear harmonics fall with the order to this power (measured UR10)")
    other_features: int = _setting(
        8, "principal components of the random functions of each law at each joint; few inputs need no more"
    )
    missed_loss: float = _setting(
        5.0,
        "loss of an effect that is not stated after an alarm, in losses of a wrong name: the alarm is exact, so that a class is"
        " stated unless the odds for nothing are twenty-four to one",
    )
    ambiguity_loss: float = _setting(
        0.2,
        "loss of a class in losses of a wrong name, so that names below some 80 % are not stated alone: a further experiment"
        " costs a fifth of a wrong repair",
    )
    width_loss: float = _setting(
        0.02,
        "loss of each further hypothesis that a class lists, in wrong names: what is less probable is not worth an experiment",
    )
    useful: float = _setting(
        1.96, "standard errors by which the expected gain of what was found exceeds nothing where it enters the model (95 %)"
    )
    prior_share: float = _setting(
        0.5,
        "part of a parameter's prior variance that is left with the measurements, from which on the parameter counts as not"
        " identifiable: the prior says more of it than the measurements do",
    )
    law_tolerance: float = _setting(
        0.2,
        "part of a mechanism's displacements, root mean square, by which a machine may depart from its law: the laws of the"
        " catalogue at the true joints explain 96 % of the squares of those of another simulator in the median",
    )
    smooth_tolerance: float = _setting(
        0.5,
        "the same of the smooth error of unknown cause, which has few functions of few inputs: of what is twice as large as a"
        " mechanism beside it, that mechanism is a part",
    )
    credible: float = _setting(0.95, "probability of the hypotheses between which a next experiment shall decide")
    gross_error_level: float = _setting(
        0.005,
        "probability that a row of good measurements is left out as a gross error, by Bonferroni's bound; half for what is held"
        " out, so that 98 % of good campaigns lose no row",
    )
    gross_error_share: float = _setting(
        0.2, "share of rows beyond which none counts as a gross error: below the quarter at which the scale breaks down"
    )
    gross_start_numbers: int = _setting(
        1200,
        "numbers that are judged by all candidates at once before the search; of more, those that stand out beside the declared"
        " model and a sample of the others: one that does not stand out there hardly moves what a search finds",
    )
    extreme_load: float = _setting(
        3.0,
        "times the upper quartile of forces beyond which a few rows are first judged by the others: ladders of loads stay"
        " within, and honest rows beyond it come back as soon as the others predict them",
    )
    extrapolated_error: float = _setting(
        3.0,
        "times the limit of a gross error that a held-out row may be off where its prediction is extrapolated: on public data"
        " models err there by up to 1.6 times (WAM)",
    )
    gross_error_rounds: int = _setting(
        4, "times that a model is searched for at most, each without the rows that the one before does not explain"
    )
    linearizations: int = _setting(
        5, "times that the problem is linearised at most, each about the model found before; met, it is warned of"
    )
    relinearize_above: float = _setting(
        100.0,
        "log Bayes factor above which what is missing is so large that the problem is linearised again about what was found",
    )
    relinearize_noise: float = _setting(
        1.5,
        "times the noise taken that a model leaves, above which the problem is whitened again by that: sizes of effects and of"
        " errors are in units of the noise taken, so that plausible sizes mean nothing where it is far off",
    )
    largest_scatter: float = _setting(
        5.0,
        "times the noise of repeats beyond which no model that leaves it is adequate: trackers err from one hour to the next by"
        " up to three times what they repeat to at once (measured FANUC)",
    )
    largest_pose_error_rad: float = _setting(
        5e-4, "error of a joint common to the measurements of a pose beyond which no model is adequate: gears err by half of it"
    )
    negative_compliance: float = _setting(
        3.0, "standard errors by which an identified compliance is negative, which none is, beyond which no model is adequate"
    )
    searched_observations: int = _setting(
        5_000,
        "averaged measurements, at poses spread over the campaign, that the search and every fit on the way look at; on UR10 A"
        " they name all but the smallest of the effects that all 8,350 rows name (docs/method.md), and the last fit takes all",
    )
    linear_misfit: float = _setting(
        0.02,
        "relative difference between the mean square that an exact fit leaves and that which the linear problem promised, below"
        " which the problem was linear enough: it changes the log likelihood of a hundred measurements by one",
    )
    numbers_a_parameter: float = _setting(
        10.0,
        "numbers measured for each effective parameter below which the model is cross-validated against frames alone: above,"
        " errors of poses left out exceed those of the fit by less than a tenth",
    )
    beam: int = _setting(4, "models that a round of the search extends; more change probabilities by less than 1 %")
    patience: int = _setting(3, "rounds without a better model after which the search ends")
    largest_model: int = _setting(100, "most units of one model; UR10 series use some 40 bands of gear harmonics")
    kept_models: int = _setting(
        60, "models whose evidence is computed in full; the rest holds less than 1 % of the probability"
    )

    def document(self) -> dict[str, dict[str, Any]]:
        """Name, value and reason of every setting, JSON-serialisable."""
        values = asdict(self)
        return {entry.name: {"value": values[entry.name], "reason": entry.metadata["reason"]} for entry in fields(self)}
