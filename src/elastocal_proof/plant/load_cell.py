"""What the flange feels when the load cell shows the wanted force.

The experimenter pulls until the display shows what the plan says; a cell that errs makes the flange feel something else. So the
campaign holds what was shown, and the arm deflects by what was felt: the felt force solves shown = cell(felt).
"""

from dataclasses import dataclass

import numpy as np

from elastocal_proof.plant.arm import turned

_SWEEPS = 40
_SETTLED_N = 1e-9


@dataclass(frozen=True)
class LoadCell:
    """A cell between the pull and the flange, and where it pulls. The default is perfect.

    `scale`: shown = (1 + scale) felt. `turn_rad`: rotation vector by which the cell is mounted askew: it shows R(turn)^T felt.
    `bias_N`: shown without a force. It is not zeroed between poses. `shift_m`: where the force really acts, from where the plan
    says. `crosstalk_per_N`: quadratic: shown x gets k F_y F_z, and so on round the axes. `in_flange`: which of "turn", "bias"
    and "shift" are fixed in the flange's axes rather than in the base's. `mount`: in the line of pull one number is measured: a
    force that is wrong acts at the same lever and brings a wrong moment. Between flange and tool six are: the forces may be
    wrong where the moments are right.
    """

    scale: float = 0.0
    turn_rad: tuple[float, ...] = (0.0, 0.0, 0.0)
    bias_N: tuple[float, ...] = (0.0, 0.0, 0.0)
    shift_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    crosstalk_per_N: float = 0.0
    in_flange: tuple[str, ...] = ()
    mount: str = "pull"

    def shown(self, felt: np.ndarray, flange_rotation: np.ndarray) -> np.ndarray:
        """Force on the display for the force that is felt, both (S, 3), N, base axes."""
        turn, bias, _ = self._errors(flange_rotation)
        askew = np.einsum("sji,sj->si", turned(turn), felt)
        crossed = self.crosstalk_per_N * np.roll(felt, -1, axis=1) * np.roll(felt, -2, axis=1)
        return (1.0 + self.scale) * askew + bias + crossed

    def felt(self, force: np.ndarray, lever: np.ndarray, flange_rotation: np.ndarray) -> np.ndarray:
        """Wrench on the flange.

        By fixed-point iteration: what the display lacks is pulled more.

        `force` (S, 3): as shown, N, base axes; a row of zeros where nothing pulls. `lever` (S, 3): from the flange's origin to
        where the plan lets the force act, m, base axes. `flange_rotation` (S, 3, 3). Returns (S, 6): N, N m at the flange's
        origin, base axes.
        """
        found = force.copy()
        for _ in range(_SWEEPS):
            missing = force - self.shown(found, flange_rotation)
            found += missing
            if np.abs(missing).max() < _SETTLED_N:
                break
        felt = np.where(force.any(axis=1, keepdims=True), found, 0.0)
        moment = np.cross(lever, felt if self.mount == "pull" else force)
        return np.concatenate([felt, moment + np.cross(self._errors(flange_rotation)[2], felt)], axis=1)

    def _errors(self, flange_rotation: np.ndarray) -> list[np.ndarray]:
        """Turn, bias and shift in base axes, (S, 3) each."""
        named = {"turn": self.turn_rad, "bias": self.bias_N, "shift": self.shift_m}
        turns = [flange_rotation if name in self.in_flange else np.eye(3) for name in named]
        shape = (len(flange_rotation), 3)
        return [np.broadcast_to(axes @ np.array(error), shape) for axes, error in zip(turns, named.values(), strict=True)]
