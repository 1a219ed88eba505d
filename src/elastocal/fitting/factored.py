"""Columns of sensitivities in two factors, and their products without the columns.

An effect displaces coordinates of the sites, by an amount that belongs to the state; how a coordinate moves what is measured
belongs to the measurement. In row r of state s a column is the sum over coordinates c of

    J[r, c] f_c(s),

so that products of two columns are sums over states of f_c(s) g_d(s) H_cd(s), with H = J'J of the rows of one state: as many
terms as states, where the columns themselves have a term for each component of each target in it. Two columns differ by what
they have in common times the rounding of one, as differences of squares do: 1e-16 of the larger.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from elastocal.fitting.observations import groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence


# Entries of a coordinate that make a product of their own worth its call.
_MANY_ENTRIES = 16
# Numbers of products by state that are in memory at once.
_AT_ONCE = 1_500_000


@dataclass(frozen=True)
class Displacements:
    """What columns do to coordinates, entry by entry; entries of one coordinate lie side by side, those of many first.

    `columns`: K. `values` (E, S): displacement of one coordinate by one column, in each state. `coordinate`, `column` (E,) of
    int.
    """

    columns: int
    values: np.ndarray
    coordinate: np.ndarray
    column: np.ndarray

    @classmethod
    def of(cls, laws: Sequence[Mapping[int, np.ndarray]], sizes: np.ndarray, states: int) -> Displacements:
        """Gather laws, each a displacement of some coordinates.

        `laws` (S,): one for each column. `sizes` (K,): by which columns are multiplied. `states`: S.
        """
        count = Counter(coordinate for law in laws for coordinate in law)
        entries = sorted((-count[coordinate], coordinate, column) for column, law in enumerate(laws) for coordinate in law)
        values = np.empty((len(entries), states))
        for place, (_, coordinate, column) in zip(values, entries, strict=True):
            np.multiply(laws[column][coordinate], sizes[column], out=place)
        return cls(len(laws), values, *np.array(entries, int).reshape(-1, 3).T[1:])

    def of_columns(self, kept: np.ndarray) -> Displacements:
        """The same of some of the columns, ndarray of bool (K,), which are numbered anew."""
        mine = kept[self.column]
        column = (np.cumsum(kept) - 1)[self.column[mine]]
        return Displacements(int(kept.sum()), self.values[mine], self.coordinate[mine], column)

    @cached_property
    def spans(self) -> list[tuple[int, slice]]:
        """Coordinates that are displaced, and the entries of each."""
        first = np.flatnonzero(np.diff(self.coordinate, prepend=-1)).tolist()
        return [(int(self.coordinate[a]), slice(a, b)) for a, b in pairwise([*first, len(self.coordinate)])]

    @cached_property
    def _fold(self) -> csr_array:
        """Ones where an entry is of a column, sparse (K, E)."""
        entries = len(self.column)
        return csr_array((np.ones(entries), (self.column, np.arange(entries))), (self.columns, entries))

    def folded(self, values: np.ndarray) -> np.ndarray:
        """Sum over the entries of each column, of ndarray (E, q): ndarray (K, q)."""
        return self._fold @ values


@dataclass(frozen=True)
class Factored:
    """Rows of columns that displace coordinates.

    `displacements`: K columns in S states. `jacobian` (M, rows, C): of each observation with respect to the coordinates,
    whitened or not. `state` (M,) of int: its state.
    """

    displacements: Displacements
    jacobian: np.ndarray
    state: np.ndarray

    @property
    def columns(self) -> int:
        """K."""
        return self.displacements.columns

    def of_columns(self, kept: np.ndarray) -> Factored:
        """The same of some of the columns, ndarray of bool (K,)."""
        return replace(self, displacements=self.displacements.of_columns(kept))

    def at(self, seen: np.ndarray) -> Factored:
        """The same of some of the observations, ndarray of bool (M,), whose states are numbered anew."""
        states, state = np.unique(self.state[seen], return_inverse=True)
        displacements = replace(self.displacements, values=self.displacements.values[:, states])
        return Factored(displacements, self.jacobian[seen], state)

    @cached_property
    def _by_state(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """For each number of observations in a state, these and their rows for the coordinates used, (G, k rows, C')."""
        used = [coordinate for coordinate, _ in self.displacements.spans]
        rows = self.jacobian[..., used]
        groups = groups_by_size(self.state)
        height = rows.shape[1]
        return [(members, rows[members].reshape(len(members), members.shape[1] * height, len(used))) for members in groups]

    def _products_by_state(self, right: np.ndarray | None = None) -> np.ndarray:
        """J' times some rows (M, rows, q), or times J itself, summed over each state: ndarray (S, C', q)."""
        spans, states = self.displacements.spans, self.displacements.values.shape[1]
        width = len(spans) if right is None else right.shape[2]
        found = np.zeros((states, len(spans), width))
        for members, rows in self._by_state:
            other = rows if right is None else right[members].reshape(*rows.shape[:2], width)
            found[self.state[members[:, 0]]] = rows.transpose(0, 2, 1) @ other
        return found

    def gram(self) -> np.ndarray:
        """Products of the columns with each other, ndarray (K, K)."""
        fold = self.displacements.folded
        entries = np.zeros((len(self.displacements.values),) * 2)
        for _, part in self._parts(len(self.displacements.spans)):
            entries += part._gram_of_entries()
        return fold(fold(entries).T)

    def _parts(self, width: int) -> Iterator[tuple[np.ndarray | slice, Factored]]:
        """Some states at a time, whose products with so many other columns take no more memory than is given to them."""
        step, states = max(_AT_ONCE // max(len(self.displacements.spans) * width, 1), 1), self.displacements.values.shape[1]
        if states <= step:
            yield slice(None), self
            return
        for start in range(0, states, step):
            seen = (self.state >= start) & (self.state < start + step)
            yield seen, self.at(seen)

    def _gram_of_entries(self) -> np.ndarray:
        values, spans = self.displacements.values, self.displacements.spans
        pairs = np.ascontiguousarray(self._products_by_state().transpose(1, 2, 0))
        place = np.repeat(np.arange(len(spans)), [span.stop - span.start for _, span in spans])
        found = np.empty((len(values), len(values)))
        large = sum(span.stop - span.start >= _MANY_ENTRIES for _, span in spans)
        for number, (_, span) in enumerate(spans):
            # Coordinates from this one on, for the others are alike: those of many entries one by one, those of few together.
            for other in range(number, large):
                beside = spans[other][1]
                np.matmul(values[span] * pairs[number, other], values[beside].T, out=found[span, beside])
            rest = slice(spans[max(number, large)][1].start if max(number, large) < len(spans) else len(values), None)
            found[span, rest] = values[span] @ (values[rest] * pairs[number][place[rest]]).T
            found[span.start :, span] = found[span, span.start :].T
        return found

    def times(self, right: np.ndarray) -> np.ndarray:
        """Products of the columns with other rows.

        `right` (M, rows, q). Returns (K, q).
        """
        found = np.zeros((len(self.displacements.values), right.shape[2]))
        for chosen, part in self._parts(right.shape[2]):
            seen = part._products_by_state(right[chosen])
            for number, (_, span) in enumerate(self.displacements.spans):
                found[span] += part.displacements.values[span] @ seen[:, number]
        return self.displacements.folded(found)

    def times_by_pose(self, right: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Products of the columns with other rows, of the measurements of each pose.

        `right` (M, rows, n). `pose` (M,) of int: 0 .. G-1; all measurements of a state are of one pose. Returns (G, n, K).
        """
        values, states = self.displacements.values, self.displacements.values.shape[1]
        seen, poses = self._products_by_state(right), int(pose.max()) + 1
        of_state = np.full(states, -1)
        of_state[self.state] = pose
        found = np.zeros((len(values), poses, right.shape[2]))
        taken = np.flatnonzero(of_state >= 0)
        for members in groups_by_size(of_state[taken]):
            mine = taken[members]
            at = of_state[mine[:, 0]]
            for number, (_, span) in enumerate(self.displacements.spans):
                some = values[span][:, mine].transpose(1, 0, 2)
                found[span, at] = (some @ seen[mine, number]).transpose(1, 0, 2)
        folded = self.displacements.folded(found.reshape(len(values), poses * right.shape[2]))
        return np.ascontiguousarray(folded.T).reshape(poses, right.shape[2], self.columns)

    def dense(self) -> np.ndarray:
        """The columns themselves, ndarray (M, rows, K); the observations of each lie side by side."""
        displacements, jacobian = self.displacements, self.jacobian.transpose(2, 1, 0)
        found = np.zeros((self.columns, jacobian.shape[1], len(self.state)))
        entries = zip(displacements.coordinate, displacements.column, displacements.values, strict=True)
        for coordinate, column, values in entries:
            found[column] += jacobian[coordinate] * values[self.state]
        return found.transpose(2, 1, 0)
