"""Settings of the diagnosis. settings.json has their values and reasons, and each
verdict.json records them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib import resources
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

_TABLE = json.loads(
    resources.files("elastocal")
    .joinpath("diagnosis", "settings.json")
    .read_text(encoding="utf-8")
)


def _to_value(entry: Mapping[str, Any]) -> Any:
    """Value of an entry of settings.json; a list becomes a tuple."""
    value = entry["value"]
    return tuple(value) if isinstance(value, list) else value


_DEFAULT = SimpleNamespace(**{name: _to_value(entry) for name, entry in _TABLE.items()})


@dataclass(frozen=True)
class Settings:
    """Numbers that the diagnosis depends on; settings.json says what each is for and why
    it has this value."""

    alarm_level: float = _DEFAULT.alarm_level
    detection_level: float = _DEFAULT.detection_level
    alarm_draws: int = _DEFAULT.alarm_draws
    nothing_probability: float = _DEFAULT.nothing_probability
    mechanism_probability: float = _DEFAULT.mechanism_probability
    gravity_probability: float = _DEFAULT.gravity_probability
    other_probability: float = _DEFAULT.other_probability
    further_location: float = _DEFAULT.further_location
    scales: tuple[float, ...] = _DEFAULT.scales
    scale_center: float = _DEFAULT.scale_center
    scale_spread: tuple[float, float] = _DEFAULT.scale_spread
    pose_steps: tuple[float, ...] = _DEFAULT.pose_steps
    pose_error_ratio: float = _DEFAULT.pose_error_ratio
    pose_error_probability: float = _DEFAULT.pose_error_probability
    pose_repeatability_rad: float = _DEFAULT.pose_repeatability_rad
    harmonic_decay: float = _DEFAULT.harmonic_decay
    other_features: int = _DEFAULT.other_features
    missed_loss: float = _DEFAULT.missed_loss
    ambiguity_loss: float = _DEFAULT.ambiguity_loss
    width_loss: float = _DEFAULT.width_loss
    useful: float = _DEFAULT.useful
    adoption_groups: int = _DEFAULT.adoption_groups
    useless_prediction: float = _DEFAULT.useless_prediction
    prior_share: float = _DEFAULT.prior_share
    law_tolerance: float = _DEFAULT.law_tolerance
    confusable_share: float = _DEFAULT.confusable_share
    smooth_tolerance: float = _DEFAULT.smooth_tolerance
    credible: float = _DEFAULT.credible
    gross_error_level: float = _DEFAULT.gross_error_level
    gross_error_probability: float = _DEFAULT.gross_error_probability
    gross_error_reach: float = _DEFAULT.gross_error_reach
    gross_group_level: float = _DEFAULT.gross_group_level
    gross_error_share: float = _DEFAULT.gross_error_share
    gross_start_numbers: int = _DEFAULT.gross_start_numbers
    extreme_load: float = _DEFAULT.extreme_load
    extrapolated_error: float = _DEFAULT.extrapolated_error
    gross_error_rounds: int = _DEFAULT.gross_error_rounds
    linearizations: int = _DEFAULT.linearizations
    relinearize_above: float = _DEFAULT.relinearize_above
    relinearize_noise: float = _DEFAULT.relinearize_noise
    scatter_level: float = _DEFAULT.scatter_level
    largest_scatter: float = _DEFAULT.largest_scatter
    largest_pose_error_rad: float = _DEFAULT.largest_pose_error_rad
    negative_compliance: float = _DEFAULT.negative_compliance
    searched_observations: int = _DEFAULT.searched_observations
    linear_misfit: float = _DEFAULT.linear_misfit
    numbers_a_parameter: float = _DEFAULT.numbers_a_parameter
    beam: int = _DEFAULT.beam
    patience: int = _DEFAULT.patience
    largest_model: int = _DEFAULT.largest_model
    kept_models: int = _DEFAULT.kept_models

    @classmethod
    def from_document(cls, document: Mapping[str, Mapping[str, Any]]) -> Settings:
        """Settings from a document of `document`, also after JSON."""
        return cls(**{name: _to_value(entry) for name, entry in document.items()})

    def document(self) -> dict[str, dict[str, Any]]:
        """Value and reason of each setting by its name, JSON-serialisable."""
        return {
            name: {"value": value, "reason": _TABLE[name]["reason"]}
            for name, value in asdict(self).items()
        }
