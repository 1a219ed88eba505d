"""A fitted model as a JSON document: which effects it has, under which priors, and the
values of its parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.fitting.model import Estimate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.model import Model

# Fields of an estimate: single arrays, and tuples with one array for each effect.
_PLACEMENTS = ("frame_rotation", "frame_position", "target_offset", "target_rotation")
_EFFECT_PARAMETERS = ("coefficients", "shapes")


def serialize_model(model: Model, estimate: Estimate) -> dict[str, Any]:
    """Return the keys of the effects, their priors and the estimate."""
    stated: dict[str, Any] = {"sessions": [int(entry) for entry in estimate.sessions]}
    for name in _PLACEMENTS:
        stated[name] = getattr(estimate, name).tolist()
    for name in _EFFECT_PARAMETERS:
        stated[name] = [values.tolist() for values in getattr(estimate, name)]
    if estimate.features:
        stated["features"] = [values.tolist() for values in estimate.features]
    return {
        "effects": [effect.key for effect in model.effects],
        "priors": [_list_priors(effect) for effect in model.effects],
        "estimate": stated,
    }


def _list_priors(effect: Candidate) -> list[float | None]:
    return [parameter.prior_std for parameter in effect.parameters]


def restore_model(
    model: Model, catalogue: Mapping[str, Candidate], stated: Mapping[str, Any]
) -> tuple[Model, Estimate]:
    """Restore a model and its estimate from `serialize_model`.

    Parameters
    ----------
    model : model of the same campaign, with any effects
    catalogue : effects by key
    stated : document
    """
    effects = []
    for key, priors in zip(stated["effects"], stated["priors"], strict=True):
        effect = catalogue[key]
        # If a prior differs from the catalogue's, the diagnosis has estimated its size.
        parameters = tuple(
            replace(parameter, prior_std=prior, sized=prior != parameter.prior_std)
            for parameter, prior in zip(effect.parameters, priors, strict=True)
        )
        effects.append(replace(effect, parameters=parameters))
    document = stated["estimate"]
    values: dict[str, Any] = {}
    for name in _PLACEMENTS:
        values[name] = np.array(document[name], float)
    for name in _EFFECT_PARAMETERS:
        values[name] = tuple(np.array(entry, float) for entry in document[name])
    features = document.get("features", [])
    values["features"] = tuple(np.array(entry, float) for entry in features)
    estimate = Estimate(tuple(document["sessions"]), **values)
    return replace(model, effects=tuple(effects)), estimate
