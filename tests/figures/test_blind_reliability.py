"""The reliability diagram shows how often what was stated with a probability is so."""

import pandas as pd
import pytest
from drawn_figures import texts_in_axes

from elastocal_proof.figures.blind_reliability import reliability_diagram


def test_the_reliability_diagram_shows_shares_against_what_was_stated_and_numbers_of_cases():
    rows = [
        ("proof", "all", 0.9, 1.0, 0.97, 95, 100),
        ("proof", "all", 0.3, 0.4, 0.35, 1, 4),
        ("tuned", "all", 0.9, 1.0, 0.95, 9, 9),
    ]
    rows.append(("proof", "single", 0.9, 1.0, 0.5, 0, 7))
    table = pd.DataFrame(rows, columns=["robots", "group", "from", "to", "stated", "hits", "cases"])
    table = table.assign(rate=table.hits / table.cases, low=0.0, high=1.0)
    shares, counts = reliability_diagram(table).axes
    drawn = [container.lines[0].get_xydata().tolist() for container in shares.containers]
    assert drawn == [[[0.97, 0.95], [0.35, 0.25]], [[0.95, 1.0]]]
    assert [patch.get_height() for patch in counts.patches] == [100, 4, 9]
    assert "No verdict" in texts_in_axes(reliability_diagram(table.iloc[:0]))[0]


def of_bins(*rows):
    """The table of rows (robots, from, to, stated, rate, low, high, cases)."""
    names = ["robots", "from", "to", "stated", "rate", "low", "high", "cases"]
    return reliability_diagram(pd.DataFrame(rows, columns=names).assign(group="all"))


def test_intervals_reach_from_their_lower_to_their_upper_end():
    shares, _ = of_bins(("proof", 0.5, 0.6, 0.55, 0.5, 0.2, 0.9, 10), ("proof", 0.6, 0.7, 0.64, 0.7, 0.6, 0.75, 20)).axes
    (bars,) = shares.collections
    assert [path.vertices.tolist() for path in bars.get_paths()] == [
        [[0.55, pytest.approx(0.2)], [0.55, pytest.approx(0.9)]],
        [[0.64, pytest.approx(0.6)], [0.64, pytest.approx(0.75)]],
    ]
    diagonal = next(line for line in shares.lines if line.get_linestyle() == ":")
    assert diagonal.get_xydata().tolist() == [[0, 0], [1, 1]]
