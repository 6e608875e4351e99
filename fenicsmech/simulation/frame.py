"""The record of one equilibrium of a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium import Reaction, State
from fenicsmech.mechanism import Motor, Output


@dataclass(frozen=True, eq=False)
class Frame:
    """An equilibrium and its measured quantities; prints numbers, not arrays.

    Attributes:
        force: magnitude of the prescribed force, or torque or force of the prescribed motors.
        displacement: of the force's point along it, from the assembled configuration, or the motors' position, from
            the drawing.
        stable: whether small disturbances die out under dead loads.
        snapped_through: whether the mechanism snapped on the way from the frame before: the path turns back there, and
            this equilibrium lies on another one, perhaps not the one that dynamics would lead to.
        unstable_modes: directions in which the energy has a maximum, under dead loads.
        stable_under_control: whether it is stable while its control is held.
        strain_energy: elastic energy of all links.
        max_stress: largest von Mises stress at cell midpoints.
        outputs: displacement of each output of the mechanism, from the assembled configuration.
        reactions: force and moment of each joint on its second link, by joint name.
        motors: torque or force of each motor.
        iterations: Newton iterations, load steps on the way included.
        residuals: relative residual before each iteration of the last step, and at the end.
        seconds: wall-clock time.
        phases: the same, by phase.
        state: the equilibrium itself.
        design: the rest shape it belongs to, this rank's values of the design field, flat.
    """

    force: float
    displacement: float
    stable: bool
    snapped_through: bool
    unstable_modes: int
    stable_under_control: bool
    strain_energy: float
    max_stress: float
    outputs: Mapping[Output, float]
    reactions: Mapping[str, Reaction]
    motors: Mapping[Motor, float]
    iterations: int
    residuals: tuple[float, ...]
    seconds: float
    phases: Mapping[str, float]
    state: State
    design: np.ndarray

    def __repr__(self) -> str:
        figures = [f"force {self.force:.6g}", f"displacement {self.displacement:.6g}"]
        named: list[tuple[Output | Motor, float]] = [*self.outputs.items(), *self.motors.items()]
        figures += [f"{part.name} {value:.6g}" for part, value in named]
        figures += [f"strain energy {self.strain_energy:.4g}", f"stress {self.max_stress:.4g}"]
        figures.append("stable" if self.stable else f"{self.unstable_modes} unstable modes")
        figures += ["snapped through"] * self.snapped_through
        return f"<Frame: {', '.join(figures)}>"
