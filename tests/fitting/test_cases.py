"""A case has the model that its campaign declares, and the noise that its kind shapes."""

import numpy as np
from contact_campaigns import build_contact_case, write_contacts


def test_a_case_of_contacts_averages_its_rows_and_has_their_channels(tmp_path):
    rows = [
        {"angles": np.full(6, 0.1 * number), "feature": "socket"}
        for number in range(20)
    ]
    document = {"measured": "point", "features": {"socket": {}}}
    case = build_contact_case(write_contacts(tmp_path / "cell", document, rows))
    assert len(case.observations) == len(case.campaign.measurements)
    assert case.model.measuring is case.campaign.measuring
    assert case.model.shaped_noise is None
    assert case.candidates
    assert not [name for name in case.candidates if name.startswith("joint_offset")]
