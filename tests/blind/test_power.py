"""Detection by size beside the oracle, and what cannot be found."""

import pytest
from made_blind_documents import effect, frame, oracle, silence, truth, verdict

from elastocal_proof.blind.power import powers, undetectable

PAYLOAD = verdict("named", effect("payload"))


def scale():
    document = truth(("force_scale",))
    document["defects"][0] |= {"of": "raw", "signal": {"raw": 50.0, "retained": 5e-5, "rms_m": 6e-5, "rms_rad": 6e-5}}
    return document


def test_an_effect_has_a_row_for_each_level_beside_the_oracle():
    table = powers(
        frame(
            (truth(("payload",)), PAYLOAD, oracle()),
            (truth(("payload",)), silence(), oracle(0.2)),
            (truth(("payload",), level=200.0), PAYLOAD, oracle()),
        )
    ).set_index(["effect", "level"])
    row = table.loc[("payload", 50.0)]
    assert (row.cases, row.detected, row.named, row.oracle_detected) == (2, 0.5, 0.5, 0.5)
    assert 0 < row.detected_low < 0.5 < row.detected_high < 1
    assert table.loc[("payload", 200.0), "detected"] == 1.0
    assert row.signal_rms_um == pytest.approx(60.0)


def test_reasons_are_absorption_missing_covariates_and_implausible_size():
    hidden = truth(("hysteresis", 1), group="setting", setting="without_approach", design={"covariates": []})
    large = truth(("application_point",))
    large["defects"][0]["share_of_plausible"] = 2.5
    table = undetectable(
        frame(
            (scale(), silence(), oracle(1.0)),
            (hidden, PAYLOAD, oracle(1.0)),
            (large, PAYLOAD, oracle()),
            (truth(("payload",)), PAYLOAD, oracle()),
        )
    ).set_index("effect")
    assert table.reason.to_dict() == {
        "force_scale": "absorbed by the joint compliances",
        "hysteresis": "needs approach, not recorded",
        "application_point": "larger than plausible",
    }
    assert table.loc["force_scale", "retained_share"] == pytest.approx(1e-3)
    assert table.loc["hysteresis", "wrong_name"] == 1
