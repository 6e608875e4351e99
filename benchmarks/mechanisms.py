"""The mechanisms of the demos as drawn, with the demos' curves and targets."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass

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
        targets: requirements on the curves.
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
    module = importlib.import_module(f"demos.{name}")
    scene, force, configurations = module.describe()
    wanted = module.wanted(scene, force, configurations)
    return Case(scene, force, module.FORCES, configurations, **wanted, size=module.SIZE)
