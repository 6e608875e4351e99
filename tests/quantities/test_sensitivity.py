"""Derivatives of every quantity pass Taylor tests in the design field and in the value of the control."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.equilibrium import Control, DisplacementControl, LoadControl, State
from fenicsmech.quantities import Gradient, Observable, Sensitivity

from ..design.in_plane import design_field
from ..oracles.dense import linear_term, taylor_rates

PLASTIC = fm.Material("plastic", 2000.0, 0.35, expansion=1e-4)
FORCE, PLACE = 8.0, 1.5


class Bench:
    """A four-bar of two flexible links and a rigid, loaded one; the design field is a free function.

    Quantities are those of all kinds; points lie on the rigid link, inside a flexible one, and in a cell of the latter
    that touches an interface.
    """

    def __init__(
        self,
        space: str,
        comm: MPI.Comm,
        formulation: fm.MixedFormulation | None = None,
        *,
        moved: bool = False,
        springs: bool = False,
        effects: Callable[[fm.Mechanism], Sequence[fm.Effect]] = lambda mechanism: (),
    ) -> None:
        mechanism = fm.Mechanism("four-bar")
        ground, coupler = mechanism.rigid("ground", fixed=True), mechanism.rigid("coupler")
        left = mechanism.flexible("left", fm.strip([(0, 0), (-4, 15), (0, 30)], thickness=3.0, depth=6.0), PLASTIC)
        right = mechanism.flexible("right", fm.strip([(40, 0), (46, 15), (40, 30)], thickness=3.0, depth=6.0), PLASTIC)
        shaft = mechanism.revolute(ground, left, at=(0, 0), interface_radius=2.0, name="shaft")
        pin = mechanism.revolute(left, coupler, at=(0, 30), interface_radius=2.0, name="pin")
        mechanism.revolute(ground, right, at=(40, 0), interface_radius=2.0)
        end = mechanism.revolute(right, coupler, at=(40, 30), interface_radius=2.0, name="end")
        motor = mechanism.motor(shaft)
        self.force = mechanism.force(on=coupler, at=(20, 35), direction=(1, 0.3))
        lift = mechanism.output(on=coupler, at=(0, 40), direction=(0, 1), name="lift")
        sprung = [fm.JointSpring(end, 300.0, rest=0.4)] if springs else []
        scene = fm.Scene(mechanism, [*sprung, *effects(mechanism)])
        self.turned = scene.configuration("turned", {motor: 0.3})
        self.simulation = fm.Simulation(scene, space=space, size=4.0, formulation=formulation, comm=comm)
        self.model, self.moved = self.simulation.model, moved
        self.solver, self.adjoint = self.simulation.solver(self.force), Sensitivity(self.model)
        self.space = self.model.elastic.shape.function_space
        self.owned = self.space.dofmap.index_map.size_local * self.space.dofmap.index_map_bs
        self.quantities: list[fm.Quantity] = [
            fm.ForceMagnitude(self.force) if moved else fm.Displacement(self.force),
            fm.Displacement(lift),
            fm.Displacement(right, at=(45.5, 15)),
            fm.Displacement(right, at=(40.8, 2.4)),
            fm.Rotation(coupler),
            fm.Rotation(left, pin),
            fm.MotorTorque(motor),
            fm.JointForce(pin),
            fm.JointMoment(shaft),
            fm.JointMoment(end),
            fm.StrainEnergy(),
            fm.StrainEnergy(right),
            fm.LinkVolume(),
            fm.LinkMass(left, density=3.0),
            fm.CentrelineLength(right),
        ]
        for quantity in self.quantities:
            quantity.check(scene, self.model.linkage.dim)
        self.observables: list[Observable] = [quantity.on(self.model) for quantity in self.quantities]

    def field(self, seed: int) -> np.ndarray:
        """A smooth design field, the same on any number of ranks."""
        random = np.random.default_rng(seed)
        dim = self.model.linkage.dim
        positions = self.space.tabulate_dof_coordinates()
        waves, phases = random.uniform(-0.08, 0.08, (3, dim)), random.uniform(0.0, 6.0, dim)
        return design_field(self.model, 0.3 * np.sin(positions @ waves + phases))

    def control(self, change: float = 0.0) -> Control:
        """The control."""
        return DisplacementControl(PLACE + self.origin + change) if self.moved else LoadControl(FORCE + change)

    def state(self, design: fm.Design | np.ndarray) -> State:
        """The equilibrium of the given design from zero load, near which those of ``values`` are found."""
        self.model.reshape(design)
        samples = {"displacements": [PLACE]} if self.moved else {"forces": [FORCE]}
        curve = self.simulation.load_displacement(self.force, configuration=self.turned, **samples)
        self.model.load(curve.unloaded)
        self.origin = self.model.travel(self.force, curve.unloaded)
        self.known, self.design = curve.frames[-1].state, self.model.design
        return self.known

    def values(self, design: fm.Design | np.ndarray, change: float = 0.0) -> np.ndarray:
        """All components of all quantities at the equilibrium near the last ``state``."""
        self.model.reshape(self.design)
        near = self.model.carry(self.known, design)
        state = self.solver.solve(near, self.control(change)).state
        self.model.load(state)
        return np.concatenate([own.values(state) for own in self.observables])

    def gradients(self, design: fm.Design | np.ndarray) -> list[Gradient]:
        """The derivatives of all components."""
        state = self.state(design)
        return self.adjoint.gradients(self.solver, state, self.control(), self.observables)

    def named(self) -> list[str]:
        """The quantity of each component."""
        return [q.name for q, own in zip(self.quantities, self.observables, strict=True) for _ in range(own.size)]


# with "pressure", links have one of their own; with "moved", a displacement is prescribed
CASES = ("plane-stress moved", "plane-strain pressure", "3d-symmetric", "3d moved", "3d pressure")


@pytest.fixture(scope="module", params=[pytest.param("plane-stress", marks=pytest.mark.parallel), *CASES])
def bench(request) -> Bench:
    space, *more = request.param.split()
    formulation = fm.MixedFormulation(above=0.3) if "pressure" in more else None
    made = Bench(space, MPI.COMM_WORLD, formulation, moved="moved" in more)
    assert bool(made.model.pressure_dofs) == ("pressure" in more)
    return made


def assert_slopes(
    bench: Bench, values: Callable[[float], np.ndarray], slopes: Sequence[float], steps: Sequence[float]
) -> None:
    """Taylor tests of the derivative of each component by one number."""
    known = {h: values(h) for h in (0.0, *steps)}
    for place, (name, slope) in enumerate(zip(bench.named(), slopes, strict=True)):
        first = max(abs(known[h][place] - known[0.0][place]) for h in steps)
        if first <= 1e-9 * max(abs(known[0.0][place]), 1e-3):  # does not depend on the number
            assert abs(slope) * steps[0] <= 1e-8 * max(abs(known[0.0][place]), 1e-3), name
            continue
        # the field of a rank is part of the number: t alone is common to all of them
        rates = taylor_rates(lambda t, place=place: known[t[0]][place], [0.0], [1.0], [slope], steps)
        remainders = [known[h][place] - known[0.0][place] - h * slope for h in steps]
        if np.max(np.abs(remainders)) <= 1e-7 * first:  # linear in the number
            continue
        # the cubic term shows in the first steps, rounding in the last
        linear = linear_term(remainders[-3:]) <= 0.035 * np.max(np.abs(remainders[-3:]))
        assert np.max(rates.with_gradient[-2:]) >= 1.95 or linear, (name, rates.with_gradient, remainders)


@pytest.mark.thorough
def test_derivatives_by_the_design_field_away_from_the_drawn_shape(bench):
    base, direction = bench.field(1), bench.field(2)
    shares = np.array([gradient.design @ direction[: bench.owned] for gradient in bench.gradients(base)])
    slopes = bench.simulation.comm.allreduce(shares, op=MPI.SUM)
    assert_slopes(bench, lambda t: bench.values(base + t * direction), slopes, [0.2, 0.1, 0.05, 0.025])


@pytest.mark.thorough
def test_derivatives_by_the_value_of_the_control(bench):
    base, scale = bench.field(1), 0.1 if bench.moved else 1.0
    slopes = [gradient.control for gradient in bench.gradients(base)]
    steps = [scale * step for step in (0.4, 0.2, 0.1, 0.05, 0.025)]
    assert_slopes(bench, lambda t: bench.values(base, t), slopes, steps)
