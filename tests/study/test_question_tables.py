"""Tables of the research questions, by hand."""

import numpy as np
import pandas as pd
import pytest

from elastocal.study.question_tables import (
    CHOSEN,
    designs_table,
    few_table,
    geometry_table,
    kinds_table,
    ladder_table,
    observability_table,
    places_table,
    simulated_designs_table,
    stiffness_table,
    tubes_table,
    weighting_table,
)


def ladder_frame():
    """Two data sets: errors of 4 and 2 µm without springs, 1 and 3 with one; the first stops at one, the second at none."""
    rows = [(200e-6, 10, 0, 0, 0, False, 16e-12), (200e-6, 10, 0, 1, 3, True, 1e-12)]
    rows += [(200e-6, 10, 1, 0, 0, True, 4e-12), (200e-6, 10, 1, 1, 3, False, 9e-12)]
    return pd.DataFrame(rows, columns=["noise", "length", "data_set", "link_springs", "added_link", "chosen", "mean_square"])


def test_the_ladder_has_a_row_for_each_number_of_springs_and_one_for_what_was_chosen():
    table = ladder_table({"arm": ladder_frame()})
    assert table.link_springs.tolist() == ["0", "1", CHOSEN]
    assert table.rms_um.tolist() == pytest.approx([np.sqrt(10), np.sqrt(5), np.sqrt(2.5)])
    assert table.chosen_percent.tolist()[:2] == [50, 50] and np.isnan(table.chosen_percent[2])
    assert table.usual_link[1] == 3 and table.usual_link.isna().tolist() == [True, False, True]
    assert table.noise_um.tolist() == [200.0] * 3


def test_designs_are_in_micrometres():
    frame = pd.DataFrame({"design": ["D"], "configurations": [4], "rms": [8e-5], "low": [7e-5], "high": [9e-5]})
    found = designs_table({"arm": frame.assign(joint_range="limits")}).iloc[0].tolist()
    assert found == pytest.approx(["arm", "limits", "D", 4, 80.0, 70.0, 90.0])


def test_an_index_that_orders_data_sets_as_the_bound_does_has_rank_correlation_one():
    rng = np.random.default_rng(1)
    bound = rng.uniform(1, 2, 400)
    frame = pd.DataFrame({f"O{number}": rng.uniform(size=400) for number in range(1, 6)})
    frame = frame.assign(O1=1 / bound, bound=bound, mean_square=bound * rng.chisquare(3, 400))
    table = observability_table({"arm": frame}).set_index("index")
    assert table.rank_correlation_with_bound["O1"] == pytest.approx(-1.0)
    # Unrelated: within four standard errors of nothing.
    assert abs(table.rank_correlation_with_bound["O2"]) < 4 * table.rank_correlation_with_bound_std_error["O2"]
    assert table.rank_correlation_with_error["bound"] == pytest.approx(-table.rank_correlation_with_error["O1"])


def test_noise_and_leak_add_as_squares_and_have_units_for_people():
    names = ["noise", "leak", "compliance_noise", "compliance_leak", "zero_noise", "zero_leak"]
    frame = pd.DataFrame([("at once", 3e-4, 4e-4, 8.0, 1.0, 3e-5, 1e-3)], columns=["estimator", *names])
    found = geometry_table({"arm": frame}).iloc[0].tolist()
    assert found[:2] == ["arm", "at once"] and found[2:] == pytest.approx([500, 300, 400, 8, 1, 30, 1000])


def test_weights_are_compared_by_a_ratio():
    frame = pd.DataFrame({"orientation_ratio": [3.0], "per_metre": [5e-5], "equal": [1.5e-4], "weighted": [1e-4]})
    found = weighting_table({"arm": frame}).iloc[0].tolist()
    assert found[0] == "arm" and found[1:] == pytest.approx([3, 50, 150, 100, 1.5])


def test_places_are_compared_by_the_ratio_of_root_mean_bounds_paired_by_data_set():
    frame = pd.DataFrame({"joints": 2, "along": 1.2, "side": "+y", "data_set": range(4), "bound": [4.0, 8.0, 4.0, 8.0]})
    frame = frame.assign(bound_end_effector=frame.bound / 4, turned=[0.5, 0.4, 0.5, 0.4], fixed=0.1)
    (row,) = places_table({"arm": frame}).to_dict("records")
    assert (row["ratio"], row["ratio_low"], row["ratio_high"]) == pytest.approx((2, 2, 2))
    assert (row["robot"], row["joints"], row["side"]) == ("arm", 2, "+y")
    assert (row["seen_turned_percent"], row["seen_fixed_percent"]) == pytest.approx((45, 10))


def test_tubes_show_single_data_sets_and_what_joints_leave():
    frame = pd.DataFrame({"diameter": 0.25, "data_set": [0, 1], "mean": [1e-3, 3e-3], "mean_square": [2e-6, 10e-6]})
    frame = frame.assign(maximum=[4e-3, 6e-3], left=[1e-8, 3e-8])
    (row,) = tubes_table({"arm": frame}).to_dict("records")
    assert (row["diameter_mm"], row["mean_mm"], row["mean_mm_between"]) == pytest.approx((250, 2, np.sqrt(2)))
    assert (row["std_mm"], row["max_mm"], row["left_um"]) == pytest.approx((1, 5, 1e6 * np.sqrt(2e-8)))
    assert tubes_table({}).empty


def test_few_configurations_are_given_by_strategy_and_error_of_the_nominal_values():
    frame = pd.DataFrame({"nominal_error": 0.3, "strategy": "A", "length": [1, 1, 1, 2, 2, 2], "data_set": [0, 1, 2] * 2})
    frame["mean_square"] = [1e-10, 4e-10, 13e-10, np.nan, 1e-10, 1e-10]
    table = few_table({"arm": frame})
    assert table.nominal_error_percent.tolist() == [30, 30] and table.rms_um[0] == pytest.approx(1e6 * np.sqrt(6e-10))
    assert table.median_um[0] == pytest.approx(20.0) and np.isnan(table.rms_um[1])


def test_kinds_are_given_at_as_many_configurations_and_at_as_many_scalars():
    frame = pd.DataFrame({"kind": "one", "scalars": 3, "length": np.arange(1, 41), "data_set": 0, "mean_square": 1e-10})
    table = kinds_table({"arm": pd.concat([frame, frame.assign(data_set=1)])}, 20)
    assert table[["configurations", "scalars"]].to_numpy().tolist() == [[20, 60], [40, 120]]
    assert table.rms_um.tolist() == pytest.approx([10.0, 10.0])


def test_the_gain_of_a_design_is_over_random_ones_of_its_size_and_load():
    rows = [("a", "random", 5, 80e-6), ("a", "I", 5, 40e-6), ("b", "random", 5, 60e-6), ("b", "I", 5, 40e-6)]
    frame = pd.DataFrame(rows, columns=["load", "design", "configurations", "rms"])
    frame = frame.assign(unobservable="", std_error=1e-6, there=frame.rms)
    assert simulated_designs_table({"arm": frame}).gain.tolist() == pytest.approx([1.0, 2.0, 1.0, 1.5])


def test_stiffness_is_given_in_newtons_per_micrometre():
    frame = pd.DataFrame([{"force": 1000.0, "softest": 8e5, "first_order": 0.1, "loaded": 0.2, "by_k_c": 0.3, "bias": 0.4}])
    table = stiffness_table({"arm": frame.assign(k_sigma=0.5, offset_rank=5, rank=6)})
    assert table.softest_N_per_um[0] == pytest.approx(0.8) and table.by_k_c_percent[0] == 0.3 and table["rank"][0] == 6
