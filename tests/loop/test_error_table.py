"""Which errors stand in the one table of errors."""

from made_loop_tables import verdict_document

from elastocal.application.accuracy import Accuracy
from elastocal.loop.error_table import error_lines, error_rows

STATED = Accuracy("base", "predicted", 2e-4, 3e-4, 2.2e-4, 4e-4, "", 20, "the poses and loads that were fitted")


def test_each_error_says_over_which_poses_and_in_which_frame_it_is_and_data_at_fault_have_none():
    verdict = verdict_document("adequate") | {"accuracy": STATED.document()}
    (measured, *rest) = error_rows(verdict, (STATED, 1e-3))
    heldout = verdict["heldout"]
    assert measured[1:] == [f"{1e3 * heldout[stage]['rms_m']:.3f} mm" for stage in ("uncalibrated", "after")]
    assert [row[1:] for row in rest] == [["0.700 mm", "0.200 mm"], ["1.000 mm", "0.200 mm"]]
    assert all(row[0].endswith("fitted, in the frame of the declared base") for row in rest)
    assert len(error_lines(verdict)) == 2 and error_rows(verdict | {"accuracy": None}) == []
