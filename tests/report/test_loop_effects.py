"""Effects are described in words, with those of their parameters that matter in readable units."""

from made_loop_facts import CAMPAIGNS
from made_loop_tables import effect_entry

from elastocal.effects.catalogue import effects
from elastocal.report.loop_effects import description
from elastocal.report.loop_effects import effect_facts as facts_about


def effect_facts(effect):
    return facts_about(effect, CAMPAIGNS["named"]["heldout"])


def test_every_effect_of_the_catalogue_is_described_without_formulas():
    for name in effects():
        said = description(name)
        assert said and not set("=[]^_") & set(said), said


def test_few_parameters_are_all_there_in_readable_units():
    assert effect_facts(effect_entry())["parameters"] == [["half play", "120.0 ± 3.0", "µrad", "measurements"]]


def test_hundreds_of_parameters_are_summarised():
    found = effect_facts(CAMPAIGNS["hundreds of parameters"]["effects"][0])
    assert len(found["parameters"]) == 10 and "10 of 216 parameters" in found["rest"]
    # The farthest from zero in standard errors, which are alike here, is the last.
    assert found["parameters"][0][0] == "joint 6: orders 7-12: sin(6q)"
    assert found["members"] == "joints 1, 2, 3, 4, 5 and 6: orders 1-2, orders 3-6, orders 7-12"


def test_what_belongs_to_an_effect_as_a_whole_stands_without_a_member():
    effect = effect_entry("link_weight", ("link_weight@2", "link_weight@3"), (2, 3), ("compliance_times_mass",))
    effect["parameters"].insert(0, effect["parameters"][0] | {"name": "link_weight largest_sag", "unit": "m"})
    names = [row[0] for row in effect_facts(effect)["parameters"]]
    assert names[0] == "largest sag" and names[1].startswith("joint 2: ")


def test_when_a_step_was_is_said_and_not_called_unidentifiable():
    """A step has no slope in its row, so that the fit holds it where the search has put it."""
    effect = effect_entry("setup_step", ("setup_step",), (), ("dx",))
    when = {"name": "setup_step when", "value": 0.25, "std_error": 0.0, "unit": "1", "prior_std": None, "held": True}
    found = effect_facts(effect | {"parameters": [*effect["parameters"], when | {"shape": True}]})
    assert found["parameters"][1] == ["share of the measurements before it", "0.2500", "", "the best of those tried"]
    assert found["parameters"][0][0] == "shift along x" and found["held"] == ""
    # A parameter that the measurements do not determine still counts as such.
    assert effect_facts(effect | {"parameters": [*effect["parameters"], when]})["held"].startswith("1 of its parameters")


def test_waves_say_what_q_is():
    effect = effect_entry("transmission_harmonic", ("transmission_harmonic@3[orders 1-2]",), (3,), ("cos_1q", "sin_2q"))
    found = effect_facts(effect)
    assert [row[0] for row in found["parameters"]] == ["cos(q)", "sin(2q)"] and "q is the angle of the joint" in found["rest"]
    assert effect_facts(effect_entry())["rest"] == ""


def test_a_parameter_that_only_its_prior_determines_says_so():
    effect = effect_entry()
    effect["parameters"][0] |= {"std_error": 9e-6}
    assert effect_facts(effect)["parameters"][0][3] == "mostly the prior"
