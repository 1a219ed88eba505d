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


def test_stands_of_sockets_may_creep_in_each_session_and_planes_may_not(tmp_path):
    rows = [
        {"angles": np.full(6, 0.1 * number), "feature": "place", "session": number // 8}
        for number in range(24)
    ]
    place = {"measured": "point", "frame": "unknown", "features": {"place": {}}}
    case = build_contact_case(write_contacts(tmp_path / "sockets", place, rows))
    sessions = [f"stand_creep[session {number}]" for number in range(3)]
    assert [key for key in case.candidates if key.startswith("stand")] == sessions
    spans = [(each.start, each.end) for each in case.model.sites.pushed_sessions]
    fitted = case.campaign.measurements
    progress = (fitted.row - fitted.row.min()) / np.ptp(fitted.row)
    by_session = [progress[fitted.session == number] for number in range(3)]
    np.testing.assert_allclose(spans, [(each.min(), each.max()) for each in by_session])

    plane = {"measured": "plane", "features": {"place": {}}}
    touched = [row | {"session": 0} for row in rows]
    case = build_contact_case(write_contacts(tmp_path / "planes", plane, touched))
    assert not [key for key in case.candidates if key.startswith("stand")]
