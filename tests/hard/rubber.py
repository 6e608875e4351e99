"""Rubber that all but keeps its volume: displacements alone lock, a pressure must neither lock nor ripple."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import fenicsmech as fm
from fenicsmech.elasticity import PLANE_STRAIN, SPATIAL
from fenicsmech.mechanism import Force, Motor

from ..elasticity.even_stretch import free_stretch, stretch
from ..elasticity.single_link import distorted, nodes, single_link
from ..oracles import beam, centreline, flexure
from .case import Check, Fact, HardCase, deviation

STRAIN, SPACE = "plane-strain", "3d"
RUBBERS = (0.45, 0.49, 0.499, 0.4999)  # Poisson's ratios
ALONE, PRESSED = fm.DisplacementFormulation(), fm.MixedFormulation(above=0.4)
SHEAR_MODULUS, THICKNESS, LENGTH = 1.0, 4.0, 60.0


def _young(poisson: float) -> float:
    return 2.0 * SHEAR_MODULUS * (1.0 + poisson)


def _stretched_block(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Pulled along its first axes, free along the others; rounding of J counts 1/(1 − 2ν) times in the pressure."""
    model = {STRAIN: PLANE_STRAIN, SPACE: SPATIAL}[space]
    dim = model.dim
    for poisson in (RUBBERS[0], RUBBERS[-1]):
        for own, how in ((False, "displacements alone"), (True, "with a pressure")):
            young = _young(poisson)
            block = single_link(*distorted(dim), model=model, young=young, poisson=poisson, mixed=own, comm=comm)
            stretch(block, 1.5, pulled=1)
            free, pressure = free_stretch((1.5,), dim - 1, young=young, poisson=poisson)
            exact = nodes(block.u) * np.array([0.5] + [free - 1.0] * (dim - 1))
            yield deviation(f"{how}: positions", block.u.x.array.reshape(-1, dim), exact, 1e-8)
            if own:
                yield deviation("pressure at all nodes", block.pressure.p.x.array / pressure, 1.0, 1e-7)


def strip(
    space: str, comm: MPI.Comm, *, poisson: float, size: float, formulation: fm.Formulation, driven: bool = False
) -> tuple[fm.Simulation, Force, Motor | None]:
    """The strip clamped outside of 0 < x < LENGTH; if ``driven``, a motor turns its hand, which slides freely."""
    mechanism = fm.Mechanism("strip")
    base, hand = mechanism.rigid("base", fixed=True), mechanism.rigid("hand")
    shape = fm.strip([(-THICKNESS, 0), (LENGTH + THICKNESS, 0)], thickness=THICKNESS, depth=THICKNESS)
    link = mechanism.flexible("link", shape, fm.Material("rubber", _young(poisson), poisson))
    clamp, motor = fm.Rectangle(THICKNESS, 2.0 * THICKNESS), None
    mechanism.weld(base, link, at=(-0.5 * THICKNESS, 0), region=clamp)
    mechanism.weld(link, hand, at=(LENGTH + 0.5 * THICKNESS, 0), region=clamp)
    if driven:
        cart, lift = mechanism.rigid("cart"), mechanism.rigid("lift")
        mechanism.prismatic(base, cart, at=(LENGTH, 0), axis=(1, 0))
        mechanism.prismatic(cart, lift, at=(LENGTH, 0), axis=(0, 1))
        motor = mechanism.motor(mechanism.revolute(lift, hand, at=(LENGTH, 0)))
    push = mechanism.force(on=hand, at=(LENGTH, 0), direction=(0, 1))
    return fm.Simulation(fm.Scene(mechanism), space=space, size=size, formulation=formulation, comm=comm), push, motor


def _bent_strip(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Under P L²/EI = 1 a beam's tip moves by the same, whatever ν is.

    What is left is the clamp, which hinders lateral contraction over no more than a thickness: there the strip bends
    by a share ν² less, at most a quarter, and at the root a share of the length counts three times in the tip of a
    cantilever. From ν = 0.49 to the limit ν² changes by 4 %.
    """
    clamp = 3.0 * 0.25 * THICKNESS / LENGTH
    lost = {}
    for formulation, rubbers in ((ALONE, RUBBERS[1::2]), (PRESSED, RUBBERS)):
        tips = []
        for poisson in rubbers:
            section = beam.Section.rectangle(
                young=_young(poisson),
                poisson=poisson,
                thickness=THICKNESS,
                depth=THICKNESS,
                plane_strain=space == STRAIN,
            )
            force = section.bending / LENGTH**2
            line = beam.Beam(centreline.straight((0, 0), (LENGTH, 0)), section)
            wanted = beam.solve(line, beam.CLAMPED, beam.End(force_y=force)).end.displacement[1]
            simulation, push, _ = strip(space, comm, poisson=poisson, size=THICKNESS, formulation=formulation)
            tips.append(simulation.load_displacement(push, forces=[force]).displacements[0] / wanted)
        lost[formulation] = abs(tips[rubbers.index(0.49)] - tips[-1])
        if formulation is PRESSED:
            yield deviation("with a pressure: tip against the beam", tips, 1.0, clamp)
            yield deviation("change from ν = 0.49 to 0.4999", tips[1:], tips[1], 0.04 * clamp)
    yield Fact("displacements alone lose ten times as much", lost[ALONE] > 10.0 * lost[PRESSED])


def _pressure(space: str, comm: MPI.Comm) -> Iterator[Check]:
    """Strips bent by their ends alone; the curvature is that of the torque, the ends' surroundings are left out.

    In the plane Rivlin's flexure of an incompressible block by 1.5 rad, to the order of 1 − 2ν; in space p = μ κ y,
    that which keeps sides free of stress whose strain is −½ ε, to the order of the strain ε, at most 0.5 %.
    """
    angle, size = (1.5, 0.25 * THICKNESS) if space == STRAIN else (0.15, 0.5 * THICKNESS)
    for poisson in RUBBERS[2:]:
        simulation, push, motor = strip(space, comm, poisson=poisson, size=size, formulation=PRESSED, driven=True)
        turned = simulation.scene.configuration("turned", {motor: angle})
        frame = simulation.load_displacement(push, forces=[0.0], configuration=turned).frames[0]
        simulation.model.load(frame.state)
        field = simulation.model.elastic.pressure
        x, y = field.p.function_space.tabulate_dof_coordinates()[: len(field.unknown), :2].T
        middle = (x > 2.0 * THICKNESS) & (x < LENGTH - 2.0 * THICKNESS)
        torque = abs(frame.motors[motor]) / THICKNESS  # per depth
        bent, wanted = _evenly_bent(space, torque, poisson, y)
        # the ends lose less than a quarter of a thickness
        yield deviation("curvature of the torque", bent * LENGTH, angle, 0.25 * THICKNESS / LENGTH)
        largest = comm.allreduce(float(np.max(np.abs(wanted[middle]), initial=0.0)), op=MPI.MAX)
        missed = np.abs(field.p.x.array[: len(y)] - wanted)[middle]
        worst = comm.allreduce(float(np.max(missed, initial=0.0)), op=MPI.MAX)
        yield deviation("pressure at every single node against the smooth one", worst, 0.0, 1e-2, scale=largest)


def _evenly_bent(space: str, torque: float, poisson: float, y: np.ndarray) -> tuple[float, np.ndarray]:
    """Curvature under a torque per depth, and the pressures at the heights ``y`` (n,) above the middle."""
    if space == SPACE:
        bent = torque * 12.0 / (_young(poisson) * THICKNESS**3)
        return bent, SHEAR_MODULUS * bent * y
    bent = brentq(lambda turn: flexure.moment(turn, THICKNESS, shear_modulus=SHEAR_MODULUS) - torque, 1e-4, 0.2)
    return bent, flexure.pressure(bent, THICKNESS, -y, shear_modulus=SHEAR_MODULUS)


CASES = (
    HardCase(
        "block of rubber",
        "ν = 0.45 to 0.4999, stretched by half in a few distorted cells, against the closed form",
        _stretched_block,
        (STRAIN, SPACE),
    ),
    HardCase(
        "bent strip of rubber",
        "ν = 0.45 to 0.4999 in cells as long as the strip is thick",
        _bent_strip,
        (STRAIN, SPACE),
    ),
    HardCase(
        "pressure in bent rubber",
        "ν = 0.499 and 0.4999: oscillates where elements are ill-chosen",
        _pressure,
        (STRAIN, SPACE),
    ),
)
