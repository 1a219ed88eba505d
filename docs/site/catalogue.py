"""Make the page of the catalogue of effects.

Each effect has its physics and formula, from its docstring, its figure and parameters.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.campaigns.reading import read_robot
from elastocal.effects.catalogue import list_bundled_effects
from elastocal.figures.effect_signatures import compute_signature, list_candidates

from extensions import with_plain_references

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elastocal.effects.protocol import Effect

HEAD = """The catalogue of effects
========================

The physical effects that a calibrated model may lack. This page is made from the
functions of ``elastocal.effects``, so it states what the code computes. A diagnosis
compares all effects, at every location where they can act on the robot.

How to read the figures
-----------------------

Each effect acts on the same heavy arm (Yaskawa GP180, gears of 100:1), with all its
parameters at the *plausible size* of the table: a size that such an effect reaches on
real robots. The figure shows the displacement of a reflector at the flange, in
millimetres along the axes of the base; all three panels have the same scale.

- **Left**: one joint moves through its range, without a load (solid) and under an
  oblique force of 1 kN (dashed).
- **Middle**: the force rises from -1 to 1 kN in one pose; the joint approaches it from
  below (solid) or from above (dotted).
- **Right**: four hours in one pose without a load, while the arm warms up by 10 K. An
  event at one moment happens in the middle.

Effects are distinguishable if one panel is flat for one and not for the other: a joint
offset needs neither load nor time, an elastic joint does nothing without a load, a
drift does nothing at the beginning. Effects with similar figures are ambiguous, and a
verdict says so.

"""
FAMILIES = {
    "geometry": "Geometry: present without a load, fixed in time",
    "gravity": "Gravity: present without a load, by weights and joint compliances",
    "transmission": "Transmission: present without a load, by the angle of the joint",
    "elastic": "Elastic: in proportion to the load",
    "gearbox": "Gearboxes: by the load or the approach, but not in proportion",
    "load": "Loads: the force sensor and the acting force differ",
    "drift": "Drift: by time, temperature or the order of measurements",
}
# Robot of the figures, see workflow/rules/signatures.smk.
ROBOT = read_robot(
    Path(__file__).resolve().parents[2] / "config" / "robots" / "gp180.yaml"
)
NEEDS = {
    "load": "a load, or the weight of the arm",
    "load on the joints": "a load on the joints, or declared masses",
    "external load": "an external load",
    "approach": "the sense of approach of each joint",
    "time": "the time of each measurement",
    "temperature": "the temperature",
    "declared base": "a base whose placement is declared (``frame: base``)",
}


def page() -> str:
    """Write the page in reStructuredText, the markup of the docstrings."""
    effects = list_bundled_effects()
    sections = [HEAD, _thumbnails(effects)]
    families = [effect.family for effect in effects.values()]
    for family in dict.fromkeys([*FAMILIES, *families]):
        sections.append(_headed(FAMILIES.get(family, family.capitalize()), "-"))
        sections += [
            _section(effect) for effect in effects.values() if family == effect.family
        ]
    return "".join(sections)


def _thumbnails(effects: Mapping[str, Effect]) -> str:
    """Write a grid of the figures; a line below each leads to its section."""
    figures = []
    for name, effect in effects.items():
        # Sphinx makes this anchor from the label of an effect.
        options = f"   :alt: {effect.words}\n   :target: #{name.replace('_', '-')}\n"
        figures.append(
            f".. figure:: /signatures/{name}.svg\n{options}\n   {effect.words}\n\n"
        )
    body = "".join(figures).replace("\n", "\n   ").rstrip()
    return f".. container:: gallery\n\n   {body}\n\n"


def _headed(title: str, underline: str) -> str:
    return f"{title}\n{underline * len(title)}\n\n"


def _section(effect: Effect) -> str:
    title = f"{effect.words[0].upper()}{effect.words[1:]} (``{effect.name}``)"
    text = with_plain_references(effect.doc)
    moves = (
        "It moves the robot, so it affects tasks."
        if effect.moves_robot
        else "It affects the measurements alone, and no task."
    )
    picture = (
        f".. image:: /signatures/{effect.name}.svg\n"
        f"   :alt: Displacement of a measured point by {effect.words}\n\n"
    )
    summary, _, body = text.strip().partition("\n\n")
    # A heading of a docstring would be a heading of the page.
    body, _, references = body.partition("References\n----------\n")
    formula = f".. math:: {effect.formula}\n\n"
    head = f".. _{effect.name}:\n\n{_headed(title, '~')}"
    paragraphs = (summary, formula + body, moves, picture + _table(effect), references)
    text = "\n\n".join(paragraph.strip() for paragraph in paragraphs)
    return f"{head}{text}\n\n"


def _table(effect: Effect) -> str:
    candidate = compute_signature(effect.name, ROBOT).candidate
    count = len(list_candidates(effect.name, ROBOT))
    rows = [
        "".join(
            (
                f"   * - ``{parameter.name}``\n",
                f"     - {parameter.unit}\n",
                f"     - {parameter.plausible:.2g}\n",
                f"     - {_sign(parameter.sign)}\n",
            )
        )
        for parameter in candidate.parameters
    ]
    sentences = [
        f"It can act at {count} locations of this arm;"
        f" the figure shows ``{candidate.key}``."
    ]
    needs = set(candidate.needs)
    if "load on the joints" in needs:
        # It implies a load.
        needs.discard("load")
    if needs:
        conditions = " and ".join(NEEDS[need] for need in sorted(needs))
        sentences.append(f"It can be found only with {conditions}.")
    for shape in candidate.shapes:
        unit = "" if shape.unit == "1" else f" {shape.unit}"
        sentences.append(
            f"It is nonlinear in ``{shape.name}``,"
            f" between {shape.lowest:.3g} and {shape.highest:.3g}{unit}."
        )
    head = (
        ".. list-table::\n   :header-rows: 1\n\n"
        "   * - parameter\n     - unit\n     - plausible size\n     - sign\n"
    )
    return f"{' '.join(sentences)}\n\n{head}{''.join(rows)}"


def _sign(sign: int) -> str:
    return {-1: "negative", 0: "either", 1: "positive"}[sign]
