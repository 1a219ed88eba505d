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


def test_what_belongs_to_an_effect_as_a_whole_stands_without_a_member():
    effect = effect_entry("link_weight", ("link_weight@2", "link_weight@3"), (2, 3), ("compliance_times_mass",))
    effect["parameters"].insert(0, effect["parameters"][0] | {"name": "link_weight largest_sag", "unit": "m"})
    names = [row[0] for row in effect_facts(effect)["parameters"]]
    assert names[0] == "largest sag" and names[1].startswith("joint 2: ")


def test_a_parameter_that_only_its_prior_determines_says_so():
    effect = effect_entry()
    effect["parameters"][0] |= {"std_error": 9e-6}
    assert effect_facts(effect)["parameters"][0][3] == "mostly the prior"
