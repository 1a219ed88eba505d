"""Every number that a diagnosis rests on: with its reason in settings.json, and
recorded in verdict.json."""

import json
from dataclasses import asdict, dataclass
from importlib import resources
from typing import Any

_TABLE = json.loads(
    resources.files("elastocal")
    .joinpath("diagnosis", "settings.json")
    .read_text(encoding="utf-8")
)


def _stated(name: str) -> Any:
    value = _TABLE[name]["value"]
    return tuple(value) if isinstance(value, list) else value


@dataclass(frozen=True)
class Settings:
    """Choices of the diagnosing engine; their reasons are in settings.json."""

    alarm_level: float = _stated("alarm_level")
    alarm_draws: int = _stated("alarm_draws")
    mechanism_probability: float = _stated("mechanism_probability")
    gravity_probability: float = _stated("gravity_probability")
    other_probability: float = _stated("other_probability")
    further_location: float = _stated("further_location")
    scales: tuple[float, ...] = _stated("scales")
    scale_center: float = _stated("scale_center")
    scale_spread: tuple[float, float] = _stated("scale_spread")
    pose_steps: tuple[float, ...] = _stated("pose_steps")
    pose_error_probability: float = _stated("pose_error_probability")
    pose_repeatability_rad: float = _stated("pose_repeatability_rad")
    harmonic_decay: float = _stated("harmonic_decay")
    other_features: int = _stated("other_features")
    missed_loss: float = _stated("missed_loss")
    ambiguity_loss: float = _stated("ambiguity_loss")
    width_loss: float = _stated("width_loss")
    useful: float = _stated("useful")
    prior_share: float = _stated("prior_share")
    law_tolerance: float = _stated("law_tolerance")
    smooth_tolerance: float = _stated("smooth_tolerance")
    credible: float = _stated("credible")
    gross_error_level: float = _stated("gross_error_level")
    gross_error_share: float = _stated("gross_error_share")
    gross_start_numbers: int = _stated("gross_start_numbers")
    extreme_load: float = _stated("extreme_load")
    extrapolated_error: float = _stated("extrapolated_error")
    gross_error_rounds: int = _stated("gross_error_rounds")
    linearizations: int = _stated("linearizations")
    relinearize_above: float = _stated("relinearize_above")
    relinearize_noise: float = _stated("relinearize_noise")
    largest_scatter: float = _stated("largest_scatter")
    largest_pose_error_rad: float = _stated("largest_pose_error_rad")
    negative_compliance: float = _stated("negative_compliance")
    searched_observations: int = _stated("searched_observations")
    linear_misfit: float = _stated("linear_misfit")
    numbers_a_parameter: float = _stated("numbers_a_parameter")
    beam: int = _stated("beam")
    patience: int = _stated("patience")
    largest_model: int = _stated("largest_model")
    kept_models: int = _stated("kept_models")

    def document(self) -> dict[str, dict[str, Any]]:
        """Name, value and reason of every setting, JSON-serialisable."""
        return {
            name: {"value": value, "reason": _TABLE[name]["reason"]}
            for name, value in asdict(self).items()
        }
