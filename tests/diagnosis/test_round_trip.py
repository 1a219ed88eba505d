"""What a diagnosis is written as: tables of models and candidates, of sound campaigns and of faulty ones."""

import numpy as np
import pandas as pd
from made_folders import made_folder, made_table

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.loop.diagnosis_tables import candidate_rows
from elastocal.loop.whole import cases_in


def test_every_candidate_is_in_the_table_tested_or_with_a_reason(diagnosis):
    table = {name: column.to_numpy() for name, column in pd.DataFrame(candidate_rows(diagnosis)).items()}
    assert set(table["candidate"]) == set(diagnosis.case.candidates)
    tested = np.isfinite(table["log_bayes_factor"])
    assert (tested == (table["note"] == "")).all() and tested.any() and not tested.all()
    assert (np.diff(table["log_bayes_factor"][tested]) <= 0).all()
    assert (table["probability"][tested] >= 0).all()
    assert table["candidate"][table["chosen"]].tolist() == ["joint_offset@3"]
    assert table["probability"][table["chosen"]][0] > 0.9
    for key, joints, effect in zip(table["candidate"], table["joints"], table["effect"], strict=True):
        assert joints == "+".join(map(str, diagnosis.case.candidates[key].joints)) and key.startswith(effect)


def test_tables_of_a_faulty_campaign_have_no_rows_but_for_the_candidates(kuka, config_folder, tmp_path):
    """Loads turned round."""
    table = made_table(kuka, "made")
    table |= {name: -table[name] for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    diagnosis = diagnose(
        cases_in(made_folder(tmp_path / "made", kuka, table=table), config_folder / "robots")[0], Settings(), 1
    )
    assert diagnosis.evidence is None
    notes = {(row["note"], row["chosen"]) for row in candidate_rows(diagnosis)}
    assert notes == {("the measurements are at fault", False)}
