"""Links that come into contact with obstacles (mm, N, MPa)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.compat import assemble_vector, compile_form
from fenicsmech.effects import Contact, Cylinder, HalfPlane, LinkFields
from fenicsmech.mechanism import Force


class ContactGauge:
    """Measures the contact of a flexible link in the state that the fields of a simulation hold."""

    def __init__(self, contact: Contact, fields: LinkFields) -> None:
        self._obstacle, self._fields = contact.obstacle, fields
        self._form = compile_form(-ufl.derivative(contact.link_energy(fields), fields.u))
        (faces,) = contact.faces
        V = fields.u.function_space
        self._shape, self._forces = fem.Function(V), fem.Function(V)
        self._straight = V.tabulate_dof_coordinates()[:, : fields.dim]
        self._nodes = fem.locate_dofs_topological(V, fields.dim - 1, fields.boundaries[faces].facets)

    def force(self) -> np.ndarray:
        """The force of the obstacle on the link, (dim,)."""
        # shape functions sum up to one: so do nodal forces to the resultant
        force = assemble_vector(self._form, self._forces).reshape(-1, self._fields.dim).sum(axis=0)
        return self._fields.mesh.comm.allreduce(force, op=MPI.SUM)

    def gap(self) -> float:
        """The smallest gap at nodes of the link's boundary; where negative, the largest penetration."""
        fields = self._fields
        self._shape.interpolate(fields.body.shape)
        moved = self._straight + (self._shape.x.array + fields.u.x.array).reshape(-1, fields.dim)
        gaps = self._obstacle.gap(moved[self._nodes].T, self._obstacle.numbers, np.sqrt)
        return fields.mesh.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)


@dataclass(frozen=True, eq=False)
class Touching:
    """A simulation, its force and its contact."""

    simulation: fm.Simulation
    force: Force
    contact: Contact

    def measure(self, frame: fm.Frame) -> tuple[np.ndarray, float]:
        """Force on the link and smallest gap."""
        gauge = ContactGauge(self.contact, self.simulation.model.fields)
        self.simulation.model.load(frame.state)
        return gauge.force(), gauge.gap()


def cantilever(
    space: str, *, gap: float, length: float = 100.0, thickness: float = 2.0, depth: float = 3.0
) -> Touching:
    """A straight link clamped at x = 0, pushed down at mid-length, above a plane ``gap`` below its underside."""
    mechanism = fm.Mechanism("cantilever")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(-thickness, 0), (length, 0)], thickness=thickness, depth=depth)
    beam = mechanism.flexible("beam", shape, fm.Material("nylon", 2000.0, 0.0))
    clamp = fm.Rectangle(thickness, 1.5 * thickness)
    mechanism.weld(base, beam, at=(-0.5 * thickness, 0), region=clamp)
    push = mechanism.force(on=beam, at=(0.5 * length, 0), direction=(0, -1))
    contact = Contact(beam, HalfPlane((0, -0.5 * thickness - gap), (0, 1)))
    return Touching(_simulation(mechanism, [contact], space, 2.0 * thickness), push, contact)


def touching_beside_another(comm: MPI.Comm) -> Touching:
    """The cantilever above a plane, and far from it a far larger block, which touches nothing."""
    mechanism = fm.Mechanism("cantilever beside a block")
    base, nylon = mechanism.rigid("base", fixed=True), fm.Material("nylon", 2000.0, 0.0)
    beam = mechanism.flexible("beam", fm.strip([(-2, 0), (100, 0)], thickness=2.0, depth=3.0), nylon)
    mechanism.weld(base, beam, at=(-1, 0), region=fm.Rectangle(2.0, 3.0))
    other = mechanism.flexible("block", fm.polygon([(300, 0), (400, 0), (400, 90), (300, 90)], depth=3.0), nylon)
    mechanism.weld(base, other, at=(302, 45), region=fm.Rectangle(4.0, 92.0))
    push = mechanism.force(on=beam, at=(50, 0), direction=(0, -1))
    contact = Contact(beam, HalfPlane((0, -2), (0, 1)))
    return Touching(_simulation(mechanism, [contact], "plane-stress", 4.0, comm), push, contact)


def finger(
    space: str,
    *,
    stiffness: float | None = None,
    size: float = 3.0,
    centre: tuple[float, float] = (-10.0, 38.0),
    active: bool = True,
    comm: MPI.Comm = MPI.COMM_SELF,
    solver: fm.PrimalDualNewton | None = None,
) -> Touching:
    """A soft upright finger, clamped at its root, whose tip is pulled to the left over a cylinder at ``centre``.

    active: whether the scene lists the contact.
    """
    mechanism = fm.Mechanism("finger")
    base = mechanism.rigid("base", fixed=True)
    strip = fm.strip([(0, 0), (0, 60)], thickness=3.0, depth=6.0)
    link = mechanism.flexible("finger", strip, fm.Material("rubber", 50.0, 0.4))
    mechanism.weld(base, link, at=(0, 0), interface_radius=3.0)
    pull = mechanism.force(on=link, at=(0, 60), direction=(-1, 0))
    contact = Contact(link, Cylinder(centre, 6.0), stiffness)
    return Touching(_simulation(mechanism, [contact] if active else [], space, size, comm, solver), pull, contact)


def wrapped(*, gap: float = 0.0, unit: float = 1.0, stress: float = 1.0, comm: MPI.Comm = MPI.COMM_SELF) -> Touching:
    """A slender cantilever, 100 × 0.5 × 10 of 2000 MPa, over a cylinder of 50 times its length, ``gap`` below its root.

    unit, stress: of a mm and a MPa in the units of the scene.
    """
    length, thickness = 100.0 * unit, 0.5 * unit
    mechanism = fm.Mechanism("wrapped cantilever")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(-thickness, 0), (length, 0)], thickness=thickness, depth=10.0 * unit)
    beam = mechanism.flexible("beam", shape, fm.Material("nylon", 2000.0 * stress, 0.0))
    mechanism.weld(base, beam, at=(-0.5 * thickness, 0), region=fm.Rectangle(thickness, 1.5 * thickness))
    push = mechanism.force(on=beam, at=(length, 0), direction=(0, -1))
    radius = 50.0 * length
    contact = Contact(beam, Cylinder((0, -0.5 * thickness - gap - radius), radius))
    return Touching(_simulation(mechanism, [contact], "plane-stress", unit, comm), push, contact)


def wrapped_tip(load: float) -> float:
    """The tip's deflection in mm under P with P L² / EI = ``load``, by linear beam theory.

    The beam lies on the cylinder up to a, where its moment is EI / R, and the rest b = L − a is free:

        P b = EI / R,     w = a² / 2 R + a b / R + P b³ / 3 EI.
    """
    length, radius = 100.0, 50.0 * 100.0
    free = min(length, length**2 / (load * radius))
    lying = length - free
    return (0.5 * lying**2 + lying * free) / radius + load * free**3 / (3.0 * length**2)


def wrapping_force(load: float, *, unit: float = 1.0, stress: float = 1.0) -> float:
    """P with P L² / EI = ``load``."""
    return load * 2000.0 * stress * 10.0 * unit * (0.5 * unit) ** 3 / 12.0 / (100.0 * unit) ** 2


def channel() -> Touching:
    """A nearly straight strip, pressed along its axis by a slide, between walls 3 above and 2 below its ends."""
    mechanism = fm.Mechanism("channel")
    base, slide = mechanism.rigid("base", fixed=True), mechanism.rigid("slide")
    shape = fm.strip([(0, 0), (50, 0.6), (100, 0)], thickness=1.5, depth=5.0)
    strip = mechanism.flexible("strip", shape, fm.Material("nylon", 2000.0, 0.35))
    mechanism.weld(base, strip, at=(0, 0), interface_radius=0.7)
    mechanism.weld(strip, slide, at=(100, 0), interface_radius=0.7)
    mechanism.prismatic(base, slide, at=(100, 0), axis=(1, 0))
    push = mechanism.force(on=slide, at=(100, 0), direction=(-1, 0))
    above, below = Contact(strip, HalfPlane((0, 3), (0, -1))), Contact(strip, HalfPlane((0, -2), (0, 1)))
    return Touching(_simulation(mechanism, [above, below], "plane-stress", 2.0), push, above)


def arch_over_floor() -> Touching:
    """A shallow arch, pushed down beside its crown, that snaps through onto a plane 3 below its ends."""
    mechanism = fm.Mechanism("arch over a floor")
    base = mechanism.rigid("base", fixed=True)
    shape = fm.strip([(-40, 0), (-20, 3), (0, 4), (20, 3), (40, 0)], thickness=1.0, depth=5.0)
    arch = mechanism.flexible("arch", shape, fm.Material("nylon", 2000.0, 0.35))
    for end in (-40, 40):
        mechanism.weld(base, arch, at=(end, 0), interface_radius=0.45)
    push = mechanism.force(on=arch, at=(1, 4), direction=(0, -1))
    floor = Contact(arch, HalfPlane((0, -3), (0, 1)))
    return Touching(_simulation(mechanism, [floor], "plane-stress", 1.5), push, floor)


def block(space: str, stiffness: float) -> Touching:
    """A block of 10 × 8 × 5 on a plane, pressed by a rigid plate on a slider."""
    mechanism = fm.Mechanism("block")
    base, plate = mechanism.rigid("base", fixed=True), mechanism.rigid("plate")
    square = fm.polygon([(-5, 0), (5, 0), (5, 8), (-5, 8)], depth=5.0)
    link = mechanism.flexible("block", square, fm.Material("cork", 200.0, 0.0))
    mechanism.prismatic(base, plate, at=(0, 7), axis=(0, 1))
    mechanism.weld(plate, link, at=(0, 7), region=fm.Rectangle(11.0, 2.0))
    push = mechanism.force(on=plate, at=(0, 8), direction=(0, -1))
    contact = Contact(link, HalfPlane((0, 0), (0, 1)), stiffness)
    return Touching(_simulation(mechanism, [contact], space, 4.0), push, contact)


def _simulation(mechanism, effects, space: str, size: float, comm=MPI.COMM_SELF, solver=None) -> fm.Simulation:
    return fm.Simulation(fm.Scene(mechanism, effects=effects), space=space, size=size, comm=comm, solver=solver)
