"""The statement of a diagnosis agrees with the fits that it describes."""

import numpy as np

from elastocal.fitting.model import get_joint_compliances


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
