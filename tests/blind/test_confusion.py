"""Every case is in the confusion table once."""

from made_blind_documents import effect, frame, oracle, silence, truth, verdict

from elastocal_proof.blind.confusion import confused

PAIR = truth(("payload",), ("joint_tilt", 2), group="pair", level=200.0)
ENTRIES = [
    (truth(), silence(), oracle(1.0), "adequate"),
    (truth(("payload",)), verdict("named", effect("link_weight", 2)), oracle(), "link_weight"),
    (
        truth(("payload",)),
        verdict("class", effect("link_weight", 2, alternatives=["payload"])),
        oracle(),
        "class with the truth",
    ),
    (truth(("payload",)), verdict("class", effect("link_weight", 2)), oracle(), "class without the truth"),
    (PAIR, verdict("several", effect("payload"), effect("joint_tilt", 2)), oracle(), "several"),
    (truth(("outside:refraction",), group="outside"), verdict("unexplained"), None, "unexplained"),
    (truth(("payload",)), verdict("not_testable"), oracle(), "not_testable"),
    (truth(("payload",)), verdict("named", effect("wrong_unit")), oracle(), "named: fault of the data"),
]


def test_each_case_is_counted_where_it_belongs():
    for *entry, column in ENTRIES:
        (row,) = confused(frame(tuple(entry))).to_dict("records")
        assert row[column] == 1
    table = confused(frame(*(tuple(entry) for *entry, _ in ENTRIES)))
    counts = table.drop(columns=["robots", "settings", "truth", "level"])
    assert counts.to_numpy().sum() == len(ENTRIES)
    assert set(table.truth) == {"none", "payload", "pair", "outside:refraction"}
