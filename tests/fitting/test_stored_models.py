"""A stored model is restored number by number."""

import json

import numpy as np
from synthetic import find_candidate, make_estimate, make_model

from elastocal.fitting.stored_models import restore_model, serialize_model

KEYS = ("joint_offset@2", "lost_motion@3", "transmission_harmonic@2[orders 1-2]")


def test_a_model_survives_its_document(kuka):
    effects = [find_candidate(kuka.chain, key) for key in KEYS]
    model = make_model(kuka, effects=effects, identified=True)
    estimate = make_estimate(model)
    document = json.loads(json.dumps(serialize_model(model, estimate)))
    catalogue = {effect.key: effect for effect in model.effects}
    restored, values = restore_model(model, catalogue, document)
    assert restored.effects == model.effects
    for name in vars(estimate):
        np.testing.assert_equal(getattr(values, name), getattr(estimate, name))


def test_a_prior_that_was_estimated_is_kept(kuka):
    model = make_model(kuka, effects=[find_candidate(kuka.chain, KEYS[2])])
    document = serialize_model(model, make_estimate(model))
    document["priors"][0][1] = 0.5
    catalogue = {effect.key: effect for effect in model.effects}
    (effect,) = restore_model(model, catalogue, document)[0].effects
    assert [p.sized for p in effect.parameters] == [False, True, False, False]
    assert effect.parameters[1].prior_std == 0.5
