"""The final model of a diagnosis is the last that is no control."""

import numpy as np

from elastocal.diagnosis.tables import final_parameters


def test_controls_are_not_the_final_model():
    facts = {"steps": [{"kind": kind} for kind in ("frames", "declared", "effect", "effect", "control")]}
    columns = {"step": np.repeat(np.arange(5), 2), "value": np.arange(10.0)}
    assert final_parameters(facts, columns)["value"].tolist() == [6.0, 7.0]
    assert final_parameters({"steps": facts["steps"][:2]}, columns)["value"].tolist() == [2.0, 3.0]
