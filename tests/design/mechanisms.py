"""Small mechanisms whose links may change, and the parts of their design problems (mm, N, MPa)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.design import (
    Comparison,
    Objective,
    ParametricShape,
    Regulariser,
    SampleEquilibria,
    sample_numbers,
    shape_links,
    shape_request,
    split,
    with_followers,
)
from fenicsmech.multibody import assemble

from ..simulation.demo_scenes import describe
from .shapes import ARCH, DEPTH, JOINTS, RADIUS, ROD, THICKNESS

PLASTIC = fm.Material("plastic", 2000.0, 0.35)


@dataclass(frozen=True, eq=False)
class Case:
    """A mechanism, which of its links may change, and what is wanted of it."""

    scene: fm.Scene
    designs: Sequence[fm.SplineDesign | fm.Number]
    targets: Sequence[fm.Target] = ()

    def simulate(
        self,
        space: str = "plane-stress",
        *,
        size: float = 3.0,
        order: int = 2,
        formulation: fm.MixedFormulation | None = None,
        comm: MPI.Comm = MPI.COMM_SELF,
    ) -> fm.Simulation:
        """The mechanism at a fidelity."""
        given = {"space": space, "size": size, "order": order, "formulation": formulation}
        return fm.Simulation(self.scene, **given, comm=comm)

    def problem(self, *, regulariser: Regulariser | None = None, **fidelity) -> fm.DesignProblem:
        """The design problem at a fidelity."""
        options = {} if regulariser is None else {"regulariser": regulariser}
        return fm.DesignProblem(self.simulate(**fidelity), self.designs, targets=self.targets, **options)


@dataclass(frozen=True, eq=False)
class Bench:
    """Rest shape and targets' equilibria of one simulation."""

    simulation: fm.Simulation
    rest: ParametricShape
    equilibria: SampleEquilibria = field(repr=False)

    def direction(self, seed: int) -> np.ndarray:
        """A change of p, of typical size 1 in units of ``rest.lengths``."""
        return np.random.default_rng(seed).standard_normal(len(self.rest.lengths)) * self.rest.lengths

    def design(self, change: float = 0.05, seed: int = 1) -> np.ndarray:
        """A design away from the initial one."""
        return self.rest.initial + change * self.direction(seed)

    def field(self) -> np.ndarray:
        """The design field that the model holds, this rank's values, flat."""
        return self.simulation.model.design.field


def bench(case: Case, simulation: fm.Simulation) -> Bench:
    """The parts of ``case`` in ``simulation`` (collective)."""
    mechanism, linkage, model = case.scene.mechanism, simulation.linkage, simulation.model
    designs = [design for design in case.designs if isinstance(design, fm.SplineDesign)]
    numbers = [design for design in case.designs if isinstance(design, fm.Number)]
    designs = with_followers(designs, numbers)
    requests = [shape_request(design, mechanism, linkage, numbers=numbers) for design in designs]
    shapes = shape_links(model.mesh, requests)
    equilibria = SampleEquilibria(simulation, case.targets, numbers=[number.kind for number in numbers])
    return Bench(simulation, ParametricShape(model, shapes, designs, numbers), equilibria)


def objective(
    case: Case, regulariser: Regulariser, *, comm: MPI.Comm = MPI.COMM_SELF, **fidelity
) -> tuple[Objective, Bench]:
    """The objective of all processes of ``comm``, their targets shared out, and this group's parts (collective)."""
    group = split(comm, sample_numbers(case.targets))
    simulation = case.simulate(comm=group.comm, **fidelity)
    mine = bench(Case(case.scene, case.designs, [case.targets[k] for k in group.mine]), simulation)
    whole = Objective(
        mine.rest,
        mine.equilibria,
        comparison=Comparison(case.targets, case.scene.units),
        regulariser=regulariser,
        group=group,
        clock=simulation.clock,
    )
    return whole, mine


def truss(*wanted: tuple[float, float], **design) -> Case:
    """The truss finger with (force, displacement) targets."""
    scene, push = describe("truss")
    (diagonal,) = scene.mechanism.flexible_links
    design = {"thickness": (1.5, 6.0), **design}
    return Case(
        scene,
        [fm.SplineDesign(diagonal, 3, **design)],
        [fm.Target(push, force=force, displacement=displacement) for force, displacement in wanted],
    )


def pinned_links(unit: float = 1.0) -> Case:
    """The arch and the rod of ``shapes`` within tight bounds, in a unit of length ``unit`` mm long."""

    def scaled(points):
        return [tuple(c / unit for c in point) for point in points]

    mechanism = fm.Mechanism("pinned links")
    base = mechanism.rigid("base", fixed=True)
    links = []
    for name, centreline, joints in zip(("arch", "rod"), (ARCH, ROD), JOINTS, strict=True):
        shape = fm.strip(scaled(centreline), thickness=THICKNESS / unit, depth=DEPTH / unit)
        links.append(mechanism.flexible(name, shape, PLASTIC))
        for at in scaled(joints):
            mechanism.revolute(base, links[-1], at=at, interface_radius=RADIUS / unit)
    tight = {"thickness": (2.8 / unit, 3.2 / unit), "bend": 0.01}
    return Case(fm.Scene(mechanism), [fm.SplineDesign(link, 3, **tight) for link in links])


def bow(*forces: float) -> Case:
    """An arch on two pins, pushed by forces on the arch itself: their point moves with the design."""
    mechanism = fm.Mechanism("bow")
    base = mechanism.rigid("base", fixed=True)
    arch = mechanism.flexible("arch", fm.strip([(0, 0), (30, 14), (60, 0)], thickness=4.0, depth=8.0), PLASTIC)
    for at in ((0, 0), (60, 0)):
        mechanism.revolute(base, arch, at=at, interface_radius=3.0)
    push = mechanism.force(on=arch, at=(25, 13), direction=(0.6, -0.8))
    return Case(
        fm.Scene(mechanism),
        [fm.SplineDesign(arch, 2)],
        [fm.Target(push, force=force, displacement=force / 40.0) for force in forces],
    )


def strained(*forces: float, angle: float = 0.1) -> Case:
    """A four-bar whose motor can only turn while a brace across it gives way; the rocker is loaded."""
    mechanism = fm.Mechanism("braced four-bar")
    base = mechanism.rigid("base", fixed=True)
    crank, rocker = mechanism.rigid("crank"), mechanism.rigid("rocker")
    coupler = mechanism.flexible("coupler", fm.strip([(0, 30), (20, 36), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
    brace = mechanism.flexible("brace", fm.strip([(80, 0), (64, 20), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
    shaft = mechanism.revolute(base, crank, at=(0, 0))
    mechanism.revolute(base, rocker, at=(40, 0))
    mechanism.revolute(crank, coupler, at=(0, 30), interface_radius=2.5)
    mechanism.revolute(coupler, rocker, at=(40, 30), interface_radius=2.5)
    mechanism.revolute(rocker, brace, at=(40, 30), interface_radius=2.5)
    mechanism.revolute(brace, base, at=(80, 0), interface_radius=2.5)
    motor = mechanism.motor(shaft)
    push = mechanism.force(on=rocker, at=(40, 30), direction=(1, 0))
    scene = fm.Scene(mechanism)
    turned = scene.configuration("turned", {motor: angle})
    return Case(
        scene,
        [fm.SplineDesign(coupler, 2), fm.SplineDesign(brace, 2)],
        [fm.Target(push, force=force, displacement=force / 20.0, configuration=turned) for force in forces],
    )


def sprung(*forces: float, angle: float = 0.4) -> Case:
    """A four-bar whose motor winds up a spring at its rocker's foot by bending the coupler; the rocker is loaded."""
    mechanism = fm.Mechanism("sprung four-bar")
    base = mechanism.rigid("base", fixed=True)
    crank, rocker = mechanism.rigid("crank"), mechanism.rigid("rocker")
    coupler = mechanism.flexible("coupler", fm.strip([(0, 30), (20, 36), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
    shaft = mechanism.revolute(base, crank, at=(0, 0))
    foot = mechanism.revolute(base, rocker, at=(40, 0))
    mechanism.revolute(crank, coupler, at=(0, 30), interface_radius=2.5)
    mechanism.revolute(coupler, rocker, at=(40, 30), interface_radius=2.5)
    motor = mechanism.motor(shaft)
    push = mechanism.force(on=rocker, at=(40, 30), direction=(1, 0))
    scene = fm.Scene(mechanism, [fm.JointSpring(foot, 600.0, rest=0.1)])
    turned = scene.configuration("turned", {motor: angle})
    return Case(
        scene,
        [fm.SplineDesign(coupler, 2)],
        [fm.Target(push, force=force, displacement=force / 20.0, configuration=turned) for force in forces],
    )


def turned_beam(*forces: float, angle: float = 0.75 * np.pi) -> Case:
    """A beam clamped to a hub that a motor turns by ``angle`` from the drawing, with a loaded hand at its end."""
    mechanism = fm.Mechanism("turned beam")
    base, hub, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hub"), mechanism.rigid("hand")
    beam = mechanism.flexible("beam", fm.strip([(0, 0), (25, 8), (50, 10)], thickness=3.0, depth=6.0), PLASTIC)
    motor = mechanism.motor(mechanism.revolute(base, hub, at=(0, 0)))
    mechanism.weld(hub, beam, at=(0, 0), interface_radius=2.5)
    mechanism.weld(beam, hand, at=(50, 10), interface_radius=2.5)
    push = mechanism.force(on=hand, at=(52, 10), direction=(0, 1))
    scene = fm.Scene(mechanism)
    turned = scene.configuration("turned", {motor: angle})
    return Case(
        scene,
        [fm.SplineDesign(beam, 2)],
        [fm.Target(push, force=force, displacement=force, configuration=turned) for force in forces],
    )


def strains(simulation: fm.Simulation, target: fm.Target) -> bool:
    """Whether the motors strain the links in the target's configuration."""
    return assemble(simulation.linkage, target.sample.configuration).fraction < 1.0
