"""The statement of a diagnosis agrees with the fits that it describes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from made_loop_tables import CAMPAIGNS

from elastocal.diagnosis.training_verdict import (
    warn_of_more_probable_causes,
    warn_of_unknown_times,
)
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.model import get_joint_compliances
from elastocal.mechanics.sites import build_sites


def test_compliances_before_are_those_of_the_declared_model(diagnosis):
    declared = diagnosis.declared
    compliances = diagnosis.document["compliance_urad_per_Nm"]
    before = 1e6 * get_joint_compliances(declared.model, declared.estimate)
    np.testing.assert_allclose(compliances["before"], before)
    assert len(compliances["after"]) == len(compliances["std_error"]) == len(before)
    # A compliance that the measurements tell has a standard error.
    identified = np.array(compliances["identifiable"])
    assert (np.array(compliances["std_error"])[identified] > 0).all()


def test_each_warning_is_stated_once(diagnosis):
    warnings = diagnosis.document["warnings"]
    assert len(warnings) == len(set(warnings))


def test_a_cause_that_is_more_probable_than_the_stated_one_is_mentioned():
    (effect,) = CAMPAIGNS["named"].effects
    stated = replace(effect, name="bearing_runout", probability=0.27)
    mechanisms = {"bearing_runout": 0.27, "link_weight": 0.8, "other": 0.1}
    (warning,) = warn_of_more_probable_causes([stated], mechanisms)
    assert "gravity sag (80 %) is more probable than bearing runout (27 %)" in warning
    (warning,) = warn_of_more_probable_causes([stated], mechanisms | {"other": 0.9})
    assert warning.startswith("a related mechanism (90 %) is more probable")
    sure = replace(stated, probability=0.85)
    assert warn_of_more_probable_causes([sure], mechanisms) == []


def test_effects_of_time_that_only_the_order_of_the_rows_shows_are_warned_of(kuka):
    candidates = candidates_on(build_sites(kuka))
    keys = ["thermal_growth[order]", "joint_offset@2"]
    fitted = SimpleNamespace(
        model=SimpleNamespace(effects=[candidates[key] for key in keys])
    )
    (warning,) = warn_of_unknown_times(fitted, keys)
    assert warning.startswith("times are not recorded: thermal growth of the links is")
    assert warn_of_unknown_times(fitted, keys[1:]) == []
