from dataclasses import replace

import pytest

import elastocal as ec


def test_table_has_a_column_for_each_diagnosis(result):
    later = replace(result.verdict, campaign="later")
    table = ec.compare(result, later).table
    assert list(table) == ["campaign", "later"]
    assert (
        table.loc["RMS error after, mm", "later"] == f"{1e3 * result.after.rms_m:.3f}"
    )
    assert "±" in table.loc["joint_offset@2 offset, rad", "campaign"]


def test_equal_names_are_numbered(result):
    assert list(ec.compare(result, result).table) == ["campaign (1)", "campaign (2)"]


def test_an_effect_that_only_one_has_found_leaves_the_other_cell_empty(result):
    adequate = replace(result.verdict, campaign="repaired", effects=())
    table = ec.compare(result, adequate).table
    assert table.loc["joint_offset@2 offset, rad", "repaired"] == ""
    assert table.loc["effects", "repaired"] == "none"
    assert "<table" in ec.compare(result, adequate)._repr_html_()


def test_page_escapes_names_of_campaigns(result):
    hostile = replace(result.verdict, campaign="<script>")
    page = ec.compare(result, hostile).to_page()
    assert "<h1>Diagnoses side by side</h1>" in page
    assert "<script>" not in page


def test_what_is_no_diagnosis_is_refused(result):
    with pytest.raises(ec.InputError, match="diagnoses: found 'reports/loop/cell'"):
        ec.compare(result, "reports/loop/cell")


def test_a_single_diagnosis_is_refused(result):
    with pytest.raises(ec.InputError, match="found 1; allowed: two or more"):
        ec.compare(result)
