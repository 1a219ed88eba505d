"""The formulas of effects, for programs that do not have this package.

The law of an effect is a function of numpy arrays. Called with expressions in place of
numbers, it returns its own formula, as in algorithmic differentiation by operator
overloading [1]. So the law of a plug-in needs no second form, and a law that does
something else than the operations below has no formula and is refused.

An expression is a sum of products of angles, loads, weights and waves exp(i k q), with
complex coefficients. Products of waves are waves, so that every law of the catalogue
becomes a sum of `Term`.

References
----------
[1] Griewank, A. and Walther, A., Evaluating Derivatives, chapter 6, SIAM, 2008.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.errors import InputError
from elastocal.io.typed_json import OMITTED_BY_DEFAULT

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate
    from elastocal.mechanics.sites import Sites

    # A kind, and what it belongs to.
    Atom = tuple[Any, ...]
    # Powers of atoms; of a wave its order.
    Monomial = frozenset[tuple[Atom, float]]
    # Formulas of the displaced coordinates, by coordinate.
    Formulas = dict[int, "Expression"]

_ALLOWED = (
    "a law of sums, products, sin, cos, tanh and symmetric clip of joint angles, loads"
    " and weights"
)
# Kinds of atoms.
_ANGLE = "angle"
_WAVE = "wave"
_LOAD = "load"
_WEIGHT = "weight"
_LIMITED = ("tanh", "clip")
_CONSTANT: Monomial = frozenset()


@dataclass(frozen=True)
class LimitedLoad:
    """A load that saturates.

    Attributes
    ----------
    kind : str
        "tanh" for tanh(load / limit), "clip" for the load between -limit and limit.
    coordinate : int
    limit : float
        N m, of a translation N.
    """

    kind: str
    coordinate: int
    limit: float


@dataclass(frozen=True)
class Weight:
    """Load on a joint by the weight of a body.

    Attributes
    ----------
    joint : int
        From 0.
    after : int
        Number of transforms before the frame of the body.
    mass : float
        kg, times the unit of the term.
    moment : tuple of float
        First moment in that frame, kg m, times the unit of the term.
    """

    joint: int
    after: int
    mass: float
    moment: tuple[float, float, float]


@dataclass(frozen=True)
class Term:
    """One term of the displacement of a coordinate: the product of all that is stated.

    Attributes
    ----------
    coordinate : int
        From 0, joints first.
    value : float
        Constant factor, SI units.
    wave : str
        "cos" or "sin" of the sum of orders times joint angles.
    orders : tuple of (int, float)
        Joint, from 0, and order.
    angles : tuple of int
        Joints whose angles are factors; a joint that occurs twice is squared.
    loads : tuple of int
        Coordinates whose loads are factors.
    limited : LimitedLoad, optional
        A load that saturates.
    weight : Weight, optional
        Load on a joint by the weight of a body.
    """

    coordinate: int
    value: float
    wave: str = field(default="cos", metadata=OMITTED_BY_DEFAULT)
    orders: tuple[tuple[int, float], ...] = field(
        default=(), metadata=OMITTED_BY_DEFAULT
    )
    angles: tuple[int, ...] = field(default=(), metadata=OMITTED_BY_DEFAULT)
    loads: tuple[int, ...] = field(default=(), metadata=OMITTED_BY_DEFAULT)
    limited: LimitedLoad | None = field(default=None, metadata=OMITTED_BY_DEFAULT)
    weight: Weight | None = field(default=None, metadata=OMITTED_BY_DEFAULT)


class Expression:
    """A sum of products of atoms, with their coefficients.

    Attributes
    ----------
    parts : mapping from products to complex coefficients.
    """

    def __init__(self, parts: Mapping[Monomial, complex]) -> None:
        self.parts = dict(parts)

    @classmethod
    def from_atom(cls, *atom: Any, power: float = 1) -> Expression:
        """Make the expression of one atom."""
        return cls({frozenset([(atom, power)]): 1.0})

    def __bool__(self) -> bool:
        return any(self.parts.values())

    def __add__(self, other: Any) -> Expression:
        parts: dict[Monomial, complex] = defaultdict(complex, self.parts)
        for product, coefficient in _express(other).parts.items():
            parts[product] += coefficient
        return Expression(parts)

    def __mul__(self, other: Any) -> Expression:
        parts: dict[Monomial, complex] = defaultdict(complex)
        for first, coefficient in self.parts.items():
            for second, factor in _express(other).parts.items():
                parts[_multiply(first, second)] += coefficient * factor
        return Expression(parts)

    __radd__ = __add__
    __rmul__ = __mul__

    def __neg__(self) -> Expression:
        return self * -1.0

    def __sub__(self, other: Any) -> Expression:
        return self + -_express(other)

    def __rsub__(self, other: Any) -> Expression:
        return -self + other

    def __truediv__(self, other: Any) -> Expression:
        return self * (1.0 / other)

    def __pow__(self, power: Any) -> Expression:
        result = _express(1.0)
        for _ in range(_as_count(power)):
            result = result * self
        return result

    def exp(self) -> Expression:
        """Evaluate exp(i sum k q), the only exponential that is a wave."""
        result = _express(1.0)
        for atom, coefficient in self._linear_parts(_ANGLE):
            if coefficient.real:
                raise TypeError("an exponential that is no wave")
            wave = Expression.from_atom(_WAVE, atom[1], power=coefficient.imag)
            result = result * wave
        return result

    def cos(self) -> Expression:
        """Evaluate the cosine by Euler's formula."""
        return 0.5 * ((1j * self).exp() + (-1j * self).exp())

    def sin(self) -> Expression:
        """Evaluate the sine by Euler's formula."""
        return -0.5j * ((1j * self).exp() - (-1j * self).exp())

    def tanh(self) -> Expression:
        """Evaluate the hyperbolic tangent of a load over a constant."""
        ((atom, coefficient),) = self._linear_parts(_LOAD)
        return Expression.from_atom("tanh", atom[1], 1.0 / coefficient.real)

    def clip(self, low: float, high: float) -> Expression:
        """Clip a load symmetrically."""
        ((atom, coefficient),) = self._linear_parts(_LOAD)
        if low != -high or coefficient != 1.0:
            raise TypeError("limits that are not symmetric")
        return Expression.from_atom("clip", atom[1], float(high))

    def conjugate(self) -> Expression:
        """Evaluate the complex conjugate."""
        parts = {}
        for product, coefficient in self.parts.items():
            conjugated = frozenset(
                (atom, -power if atom[0] == _WAVE else power) for atom, power in product
            )
            parts[conjugated] = complex(coefficient).conjugate()
        return Expression(parts)

    def _linear_parts(self, kind: str) -> Iterator[tuple[Atom, complex]]:
        """Yield the atoms of a linear combination of one kind, with coefficients."""
        for product, coefficient in self.parts.items():
            ((atom, power),) = product
            if atom[0] != kind or power != 1:
                raise TypeError("a function of something else")
            yield atom, complex(coefficient)


def _express(value: Any) -> Expression:
    if isinstance(value, Expression):
        return value
    return Expression({_CONSTANT: complex(value)})


def _as_count(power: Any) -> int:
    if power != int(power) or power < 0:
        raise TypeError("a power that is no natural number")
    return int(power)


def _multiply(first: Monomial, second: Monomial) -> Monomial:
    powers: dict[Atom, float] = defaultdict(float, first)
    for atom, power in second:
        powers[atom] += power
    for kinds in ((_WEIGHT,), _LIMITED):
        if sum(power for atom, power in powers.items() if atom[0] in kinds) > 1:
            raise TypeError("a product that no term has")
    return frozenset((atom, power) for atom, power in powers.items() if power)


class _Formulas(np.ndarray):
    """An array of expressions, with the functions of arrays that do not look at their
    elements."""

    @property  # type: ignore[misc]
    def real(self) -> Any:
        """Real parts."""
        return 0.5 * (self + self._conjugated())

    @property  # type: ignore[misc]
    def imag(self) -> Any:
        """Imaginary parts."""
        return -0.5j * (self - self._conjugated())

    def clip(self, *limits: Any, **options: Any) -> Any:
        """Clip each element."""
        return _collect([entry.clip(*limits) for entry in self.flat], self.shape)

    def _conjugated(self) -> _Formulas:
        return _collect([entry.conjugate() for entry in self.flat], self.shape)


def _collect(expressions: Sequence[Expression], shape: tuple[int, ...]) -> _Formulas:
    array = np.empty(len(expressions), object)
    array[:] = expressions
    return array.reshape(shape).view(_Formulas)


@dataclass(frozen=True)
class _SymbolicConditions:
    """Conditions of one state, as expressions; see `Conditions`.

    Attributes
    ----------
    sites : Sites
    compliance : (n,) array
    """

    sites: Sites
    compliance: np.ndarray

    @property
    def ones(self) -> _Formulas:
        """One."""
        return _collect([_express(1.0)], (1,))

    @property
    def joint_angles(self) -> np.ndarray:
        """Joint angles, (1, n) array."""
        return make_symbolic_angles(self.sites.joints)

    @property
    def total(self) -> _Formulas:
        """Loads, (1, C) array."""
        coordinates = range(self.sites.chain.coordinates)
        return _collect([Expression.from_atom(_LOAD, k) for k in coordinates], (1, -1))

    def weight(self, link: int, axis: int | None = None) -> _Formulas:
        """Torques of a unit mass or moment at the end of a link, (1, n) array."""
        after = self.sites.tracked_points[1 + link].after
        return self._weigh(after, np.eye(4)[0 if axis is None else 1 + axis])

    @property
    def mass_torques(self) -> _Formulas:
        """Torques per unit of each correction of a mass, (4 m, 1, n) array."""
        bodies = self.sites.tracked_points[self.sites.joints + 2 :]
        torques = []
        for body, mass in zip(bodies, self.sites.masses, strict=True):
            units = np.eye(MASS_PARAMETERS)
            units[0, 1:] = mass.centre_m
            torques += [self._weigh(body.after, unit) for unit in units]
        return np.stack(torques).view(_Formulas)

    def _weigh(self, after: int, body: np.ndarray) -> _Formulas:
        """Torques of a body with a mass and first moments (4,), (1, n) array."""
        torques = []
        for joint in range(self.sites.joints):
            torque = _express(0.0)
            if self._carries(joint, after):
                for component, amount in enumerate(body.tolist()):
                    atom = Expression.from_atom(_WEIGHT, joint, after, component)
                    torque = torque + amount * atom
            torques.append(torque)
        return _collect(torques, (1, -1))

    def _carries(self, joint: int, after: int) -> bool:
        before = self.sites.chain.transforms[:after]
        return any(transform.coordinate == joint for transform in before)


def make_symbolic_angles(joints: int) -> np.ndarray:
    """Make the angles of all joints as expressions, (1, n) array."""
    angles = [Expression.from_atom(_ANGLE, joint) for joint in range(joints)]
    return _collect(angles, (1, -1))


def derive_formulas(
    effect: Candidate,
    shapes: Iterable[float],
    sites: Sites,
    compliance: np.ndarray,
    source: str,
) -> list[Formulas]:
    """Derive the formulas of an effect.

    Parameters
    ----------
    effect, shapes : effect with the values of its shapes
    sites : sites of the robot
    compliance : (n,) joint compliances, rad/(N m)
    source : what cannot have the effect if it has no formula, for messages

    Returns
    -------
    For each parameter the displacement of each coordinate per unit.

    Raises
    ------
    InputError
        The law of this effect has no formula.
    """
    conditions = cast("Conditions", _SymbolicConditions(sites, compliance))
    formulas = []
    try:
        for per_unit in effect.displacement(conditions, *shapes):
            formulas.append({k: _express(v.item()) for k, v in per_unit.items()})
    except (TypeError, AttributeError, ValueError):
        finding = f"effect {effect.key}, whose law has no formula"
        raise InputError(source, "", finding, _ALLOWED) from None
    return formulas


def sum_formulas(values: Iterable[float], formulas: Iterable[Formulas]) -> list[Term]:
    """Sum the displacements by an effect with parameters, as terms."""
    sums: dict[int, Expression] = {}
    for value, per_unit in zip(values, formulas, strict=True):
        for coordinate, expression in per_unit.items():
            scaled = float(value) * expression
            sums[coordinate] = sums.get(coordinate, _express(0.0)) + scaled
    return [term for k in sorted(sums) for term in list_terms(k, sums[k])]


def list_terms(coordinate: int, expression: Expression) -> Iterator[Term]:
    """List the terms of a real expression, which displaces a coordinate."""
    amplitudes: dict[Any, np.ndarray] = defaultdict(lambda: np.zeros((2, 4)))
    for product, coefficient in expression.parts.items():
        orders, sense = _split_waves(product)
        factors, body, component = _split_weight(product)
        # Of c exp(i phi) and its conjugate, the sum is 2 Re(c) cos phi - 2 Im(c) sin phi.
        wave = (complex(coefficient).real, -sense * complex(coefficient).imag)
        amplitudes[orders, factors, body][:, component] += wave
    for (orders, factors, body), by_wave in amplitudes.items():
        for name, amounts in zip(("cos", "sin"), by_wave, strict=True):
            if amounts.any():
                yield _make_term(coordinate, name, orders, factors, body, amounts)


def _split_waves(product: Monomial) -> tuple[tuple[tuple[int, float], ...], float]:
    """Split off the orders of a wave by joint, the first of them positive, and whether
    their sign was changed, +1 or -1."""
    orders = sorted((atom[1], power) for atom, power in product if atom[0] == _WAVE)
    sense = math.copysign(1.0, orders[0][1]) if orders else 1.0
    return tuple((joint, sense * order) for joint, order in orders), sense


def _split_weight(product: Monomial) -> tuple[Monomial, Atom | None, int]:
    """Split off a weight: all factors but weight and waves, the body, and which of its
    mass and moments counts."""
    weights = [entry for entry in product if entry[0][0] == _WEIGHT]
    if not weights:
        return frozenset(entry for entry in product if entry[0][0] != _WAVE), None, 0
    ((atom, _),) = weights
    factors = frozenset(e for e in product if e[0][0] not in (_WAVE, _WEIGHT))
    return factors, atom[1:3], atom[3]


def _make_term(
    coordinate: int,
    wave: str,
    orders: tuple[tuple[int, float], ...],
    factors: Monomial,
    body: Atom | None,
    amounts: np.ndarray,
) -> Term:
    """Make a term of a product and its amounts (4,) by mass and moments, or (amount, 0,
    0, 0) without a weight."""
    repeated: dict[str, list[int]] = {_ANGLE: [], _LOAD: []}
    limited = None
    for atom, power in sorted(factors):
        if atom[0] in repeated:
            repeated[atom[0]] += [atom[1]] * _as_count(power)
        else:
            limited = LimitedLoad(*atom)
    value = float(amounts[0])
    weight = None
    if body is not None:
        mass, *moment = amounts.tolist()
        x, y, z = moment
        weight = Weight(body[0], body[1], mass, (x, y, z))
        value = 1.0
    angles = tuple(repeated[_ANGLE])
    loads = tuple(repeated[_LOAD])
    return Term(coordinate, value, wave, orders, angles, loads, limited, weight)
