"""The next experiment is told so that somebody can carry it out, or why there is none."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import experiment_rows


def test_the_next_experiment_is_in_degrees_and_says_what_it_separates():
    facts = facts_of(CAMPAIGNS["class"], experiment=experiment_rows(count=3))["experiment"]
    loads = ["fx N", "fy N", "fz N", "mx N·m", "my N·m", "mz N·m"]
    assert facts["heads"] == ["point", *(f"q{k} °" for k in range(1, 7)), *loads, "separation"]
    angles, wrench = ["−5.7", "−11.5", "−17.2", "−22.9", "−28.6", "−34.4"], ["910", "0", "−412", "−206", "0", "455"]
    assert facts["rows"][2] == ["6DoF", *angles, *wrench, "12.0"]
    unloaded = [row | dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), 0.0) for row in experiment_rows()]
    assert facts_of(CAMPAIGNS["class"], experiment=unloaded)["experiment"]["heads"][-2:] == ["q6 °", "separation"]
