"""The page of the catalogue of effects: physics and formula of each from its docstring,
its figure and its parameters."""

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

What a calibrated model may lack, one physical effect each. Made of the functions of ``elastocal.effects``: what it says is what
the code computes. A diagnosis compares all of them, at every location where they can act on the robot.

How to read the figures
-----------------------

Each effect acts on the same heavy arm (Yaskawa GP180, gears of 100:1), with all its parameters at the *plausible size* that the
table states: a size that such an effect reaches on real robots. Shown is by how much a reflector at the flange is displaced, in
millimetres along the axes of the base; all three panels have the same scale.

- **Left**: one joint turns through its range, without a load (solid) and under an oblique pull of 1 kN (dashed).
- **Middle**: the pull rises from -1 to 1 kN in one pose; where a joint comes from below (solid) or from above (dotted).
- **Right**: four hours in one pose without a load, while the arm warms up by 10 K. Something that happens at one moment
  happens in the middle.

What is flat in one panel and not in another is what distinguishes effects: an offset of a joint needs neither load nor time,
a spring does nothing without a load, a drift nothing at the beginning. Effects with alike figures are ambiguous, and a verdict
says so.

"""
FAMILIES = {
    "geometry": "Geometry: present without a load, fixed in time",
    "gravity": "Gravity: present without a load, by weights and joint compliances",
    "transmission": "Transmission: present without a load, by the angle of the joint",
    "elastic": "Elastic: in proportion to the load",
    "gearbox": "Gearboxes: by the load or the approach, but not in proportion",
    "load": "Loads: what the force sensor shows is not what acts",
    "drift": "Drift: by time, temperature or the order of measurements",
}
# That of the figures, see workflow/rules/signatures.smk.
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
    "declared base": "a base whose place is declared (``frame: base``)",
}


def page() -> str:
    """The page, in reStructuredText as the docstrings are."""
    listed = list_bundled_effects()
    parts = [HEAD, _thumbnails(listed)]
    families = dict.fromkeys([*FAMILIES, *(e.family for e in listed.values())])
    for family in families:
        parts.append(_headed(FAMILIES.get(family, family.capitalize()), "-"))
        parts += [
            _section(effect) for effect in listed.values() if family == effect.family
        ]
    return "".join(parts)


def _thumbnails(listed: Mapping[str, Effect]) -> str:
    """A grid of the effects' figures, each with a line below it that leads to its
    section."""
    figures = []
    for name, effect in listed.items():
        # Sphinx makes such an anchor of the label of an effect.
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
        "Moves the robot, so that tasks feel it."
        if effect.moves_robot
        else "In the measurements alone: tasks do not feel it."
    )
    picture = f".. image:: /signatures/{effect.name}.svg\n   :alt: What {effect.words} does to a measured point\n\n"
    summary, _, rest = text.strip().partition("\n\n")
    # A heading of a docstring would be a heading of the page.
    rest, _, references = rest.partition("References\n----------\n")
    formula = f".. math:: {effect.formula}\n\n"
    head = f".. _{effect.name}:\n\n{_headed(title, '~')}"
    parts = (summary, formula + rest, moves, picture + _table(effect), references)
    return head + "\n\n".join(part.strip() for part in parts) + "\n\n"


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
    lines = [
        f"Where it can act on the arm shown: {count} candidates; shown is ``{candidate.key}``."
    ]
    # A load on the joints is a load.
    if needs := sorted(
        candidate.needs
        - ({"load"} if "load on the joints" in candidate.needs else set())
    ):
        lines.append(
            f"It can be found only with {' and '.join(NEEDS[need] for need in needs)}."
        )
    for shape in candidate.shapes:
        unit = "" if shape.unit == "1" else f" {shape.unit}"
        lines.append(
            f"Not linear in ``{shape.name}``, between {shape.lowest:.3g} and {shape.highest:.3g}{unit}."
        )
    head = ".. list-table::\n   :header-rows: 1\n\n   * - parameter\n     - unit\n     - plausible size\n     - sign\n"
    return f"{' '.join(lines)}\n\n{head}{''.join(rows)}"


def _sign(sign: int) -> str:
    return {-1: "negative", 0: "either", 1: "positive"}[sign]
