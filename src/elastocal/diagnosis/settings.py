"""Settings of the diagnosis. settings.json has their values and reasons, and each
verdict.json records them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

_TABLE = json.loads(
    resources.files("elastocal")
    .joinpath("diagnosis", "settings.json")
    .read_text(encoding="utf-8")
)


def _read_value(name: str) -> Any:
    """Value of a setting in settings.json; a list becomes a tuple."""
    value = _TABLE[name]["value"]
    return tuple(value) if isinstance(value, list) else value


@dataclass(frozen=True)
class Settings:
    """Numbers that the diagnosis depends on; settings.json says what each is for and why
    it has this value."""

    alarm_level: float = _read_value("alarm_level")
    alarm_draws: int = _read_value("alarm_draws")
    mechanism_probability: float = _read_value("mechanism_probability")
    gravity_probability: float = _read_value("gravity_probability")
    other_probability: float = _read_value("other_probability")
    further_location: float = _read_value("further_location")
    scales: tuple[float, ...] = _read_value("scales")
    scale_center: float = _read_value("scale_center")
    scale_spread: tuple[float, float] = _read_value("scale_spread")
    pose_steps: tuple[float, ...] = _read_value("pose_steps")
    pose_error_probability: float = _read_value("pose_error_probability")
    pose_repeatability_rad: float = _read_value("pose_repeatability_rad")
    harmonic_decay: float = _read_value("harmonic_decay")
    other_features: int = _read_value("other_features")
    missed_loss: float = _read_value("missed_loss")
    ambiguity_loss: float = _read_value("ambiguity_loss")
    width_loss: float = _read_value("width_loss")
    useful: float = _read_value("useful")
    prior_share: float = _read_value("prior_share")
    law_tolerance: float = _read_value("law_tolerance")
    smooth_tolerance: float = _read_value("smooth_tolerance")
    credible: float = _read_value("credible")
    gross_error_level: float = _read_value("gross_error_level")
    gross_error_share: float = _read_value("gross_error_share")
    gross_start_numbers: int = _read_value("gross_start_numbers")
    extreme_load: float = _read_value("extreme_load")
    extrapolated_error: float = _read_value("extrapolated_error")
    gross_error_rounds: int = _read_value("gross_error_rounds")
    linearizations: int = _read_value("linearizations")
    relinearize_above: float = _read_value("relinearize_above")
    relinearize_noise: float = _read_value("relinearize_noise")
    largest_scatter: float = _read_value("largest_scatter")
    largest_pose_error_rad: float = _read_value("largest_pose_error_rad")
    negative_compliance: float = _read_value("negative_compliance")
    searched_observations: int = _read_value("searched_observations")
    linear_misfit: float = _read_value("linear_misfit")
    numbers_a_parameter: float = _read_value("numbers_a_parameter")
    beam: int = _read_value("beam")
    patience: int = _read_value("patience")
    largest_model: int = _read_value("largest_model")
    kept_models: int = _read_value("kept_models")

    @classmethod
    def from_document(cls, document: Mapping[str, Mapping[str, Any]]) -> Settings:
        """Settings from a document of `document`, also after JSON."""
        values: dict[str, Any] = {}
        for name, entry in document.items():
            value = entry["value"]
            values[name] = tuple(value) if isinstance(value, list) else value
        return cls(**values)

    def document(self) -> dict[str, dict[str, Any]]:
        """Value and reason of each setting by its name, JSON-serialisable."""
        return {
            name: {"value": value, "reason": _TABLE[name]["reason"]}
            for name, value in asdict(self).items()
        }
