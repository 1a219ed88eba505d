"""`elastocal compare`: diagnosed campaigns side by side."""


def test_campaigns_are_shown_side_by_side(elastocal, copied_checkout, tmp_path):
    page = tmp_path / "compared.html"
    result = elastocal("compare", "made", "made", "--output", page)
    assert result.exit_code == 0, result.output
    assert "2 campaigns side by side" in result.output
    assert "made (1)" in result.output
    assert "RMS error after, mm" in page.read_text("utf-8")


def test_a_single_campaign_is_refused(elastocal, copied_checkout):
    result = elastocal("compare", "made")
    assert result.exit_code == 1
    assert "two or more" in result.output + str(result.exception)


def test_a_file_of_the_user_is_not_replaced(elastocal, copied_checkout, tmp_path):
    page = tmp_path / "mine.html"
    page.write_text("mine", encoding="utf-8")
    result = elastocal("compare", "made", "made", "--output", page)
    assert result.exit_code == 1
    assert page.read_text("utf-8") == "mine"
