"""Which kind of robots a figure shows."""

import pytest

from elastocal_proof.blind.robots import PROOF, TUNED, leading


@pytest.mark.parametrize("kinds", [[PROOF], [TUNED, PROOF], [TUNED, TUNED, PROOF, TUNED]])
def test_robots_of_the_proof_go_before_the_one_that_was_tuned_on(kinds):
    assert leading(kinds) == leading(iter(kinds)) == "proof"


def test_the_tuned_robot_is_shown_where_there_is_no_other():
    assert leading([TUNED, TUNED]) == leading([]) == "tuned"
