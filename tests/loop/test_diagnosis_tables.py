"""The final model of a diagnosis is that of its last step."""

import numpy as np

from elastocal.loop.diagnosis_tables import final_parameters


def test_the_last_step_is_the_final_model():
    facts = {"steps": [{"kind": kind} for kind in ("frames", "declared", "effect", "effect")]}
    columns = {"step": np.repeat(np.arange(4), 2), "value": np.arange(8.0)}
    assert final_parameters(facts, columns)["value"].tolist() == [6.0, 7.0]
    assert final_parameters({"steps": facts["steps"][:2]}, columns)["value"].tolist() == [2.0, 3.0]
