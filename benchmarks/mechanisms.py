"""The mechanisms of the demos as drawn, with what the demos simulate and ask for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import fenicsmech as fm
from fenicsmech.mechanism import Force

NAMES = ("truss", "claw", "klann")


@dataclass(frozen=True)
class Case:
    """A mechanism and its task.

    Attributes:
        scene: as drawn.
        force: the force that grows.
        loads: its magnitudes.
        configurations: of the curves.
        designs: links that may change.
        targets: what is wanted of the curves.
        size: element size of the demo, mm.
    """

    scene: fm.Scene
    force: Force
    loads: Sequence[float]
    configurations: Sequence[fm.Configuration]
    designs: Sequence[fm.SplineDesign]
    targets: Sequence[fm.Target]
    size: float

    @property
    def middle(self) -> fm.Configuration:
        """The configuration in the middle."""
        return self.configurations[len(self.configurations) // 2]

    def curves(self, simulation: fm.Simulation) -> list[fm.Curve]:
        """The curve in every configuration."""
        return [
            simulation.load_displacement(self.force, forces=self.loads, configuration=place)
            for place in self.configurations
        ]

    def optimise(self, simulation: fm.Simulation, **options) -> fm.DesignResult:
        """The optimum of the demo's design problem."""
        return fm.DesignProblem(simulation, self.designs, targets=self.targets).optimise(**options)


def mechanism(name: str) -> Case:
    """The case ``name``, one of NAMES."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
    try:
        module = importlib.import_module(name)
    finally:
        sys.path.pop(0)
    scene, force, *others = module.describe()
    task = module.task(scene, force, *others)
    return Case(scene, force, task.loads, task.configurations, task.designs, task.targets, module.SIZE)
