"""Omitted effects: the assumptions of a simulation as text, hints where they may matter, and friction in hinges.

Friction gives bounds on the load of a curve computed without it. Dry friction of a pin of radius r turns the force R on
it into a moment of at most μ r |R| against its turning. While the mechanism creeps along its curve, the power
dissipated in the pins is that of the additional force:

    |Δf| |du| = Σ_j μ_j r_j |R_j| |dφ_j|,      f ∈ [f − Δf, f + Δf].

Within this band the mechanism sticks; loaded it moves along the upper bound, unloaded along the lower one.
Reactions are those without friction: bounds are of first order in μ. Source: Coulomb's law.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import ROUND_FLOOR, Context
from itertools import combinations
from math import pi
from typing import Literal

import numpy as np
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from fenicsmech.collective import from_one
from fenicsmech.compat import compile_form
from fenicsmech.effects import Gravity
from fenicsmech.equilibrium import EquilibriumSolver, Unknown
from fenicsmech.errors import DescriptionError, expect, positive, set_fields, set_options
from fenicsmech.estimates import Equilibrium, adjoint_at, cause_of_growth, growth_by_halving
from fenicsmech.mechanism import FlexibleLink, Force, Joint, Output, PrescribedPart, Shape, Strip, Units
from fenicsmech.meshing import thinnest_stretch
from fenicsmech.model import MechanismModel, plan_sites
from fenicsmech.multibody import JointCoordinate
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.fields import gather
from fenicsmech.simulation.frame import Frame
from fenicsmech.stress import allowables


@dataclass(frozen=True)
class ExplanationOptions:
    """Thresholds above which an omitted effect matters.

    Attributes:
        tolerance: relative change of the displacement.
        weight: per volume, of the flexible links, in the units of the scene; None is unknown.
        locking: Poisson's ratio above which displacement elements of an order lose accuracy.
        slender: fraction of the out-of-plane buckling load above which a link needs a simulation in 3D.
        longest: element length of each order, over the thickness of the thinnest stretch of the link, above which
            elements bend too little. Displacements of straight leaves and quarter circles, 40 times as long as thick,
            change by 1 % to elements of length zero; of order 1 by 8 % at 0.25, 30 % at 0.5 and 67 % at 1; of order 2
            by 0.2 % at 2, 2 % at 4, and 7 % at 6, where the error estimates are of no use. Of order 3, in quarter
            circles 80 times as long as thick, by 0.03 % up to 8, and from 9 on by 6 % to 11 % on some meshes.
    """

    tolerance: float = 0.01
    weight: float | None = None
    locking: Mapping[int, float] = field(default_factory=lambda: {1: 0.40, 2: 0.48, 3: 0.49})
    slender: float = 0.2
    longest: Mapping[int, float] = field(default_factory=lambda: {1: 0.1, 2: 3.0, 3: 8.0})

    def __post_init__(self) -> None:
        set_options(self, "an explanation")
        if self.weight is not None:
            set_fields(self, weight=positive("weight per volume of an explanation", self.weight))


@dataclass(frozen=True)
class Hint:
    """A hint on an omitted effect.

    Attributes:
        what: name of the effect.
        text: the consequence of omitting it.
        matters: whether it changes the displacement by more than the tolerance, or may change it altogether.
    """

    what: str
    text: str
    matters: bool


@dataclass(frozen=True)
class Explanation:
    """Assumptions of a simulation, and hints on omitted effects; prints as plain text."""

    simulated: tuple[str, ...]
    left_out: tuple[Hint, ...]

    def __str__(self) -> str:
        lines = ["Simulated:", *(f"  - {item}" for item in self.simulated), "Left out:"]
        return "\n".join([*lines, *(f"  {'!' if h.matters else '-'} {h.what}: {h.text}" for h in self.left_out)])


def explain(
    discretisation: Discretisation,
    part: PrescribedPart,
    solver: EquilibriumSolver,
    at: Equilibrium,
    frame: Frame,
    units: Units,
    options: ExplanationOptions,
) -> Explanation:
    """The assumptions of a simulation, and hints on omitted effects, from one ``frame`` of the curve of a part.

    ``at`` is the equilibrium of the frame.
    """
    model = discretisation.model
    with model.shaped(frame.design):
        growth = growth_by_halving(part, model, discretisation.fidelity.sizes) * frame.force
    hints = [_point_force_hint(part, growth, frame.displacement, units, options)]
    if not any(isinstance(effect, Gravity) for effect in model.effects):
        weight = options.weight
        change = None if weight is None else weight * float(np.linalg.norm(weight_influence(model, solver, at)))
        hints.append(_weight_hint(change, frame.displacement, units, options))
    hints += [_length_hint(discretisation, units, options), _spin_hint(model, solver, at)]
    hints += [_compressibility_hint(model, options.locking[model.elastic.order]), _touching_hint(model, frame)]
    hints += [_strength_hint(frame), _law_hint(frame)]
    if model.linkage.dim == 2:
        with model.shaped(at.design):
            hints.append(_buckling_hint(model, frame, options.slender))
    return Explanation(_simulated(model), tuple(hint for hint in hints if hint is not None))


def _simulated(model: MechanismModel) -> tuple[str, ...]:
    mechanism, elastic = model.mechanism, model.elastic
    kinds = sorted({joint.kind.name for joint in mechanism.joints})
    links = ", ".join(
        f"{link.name} ({material.name}, {type(material.law).__name__})"
        for link, material in zip(mechanism.flexible_links, model.materials, strict=True)
    )
    mixed = [link.name for link, is_mixed in zip(mechanism.flexible_links, model.mixed, strict=True) if is_mixed]
    softened = any(effect.soften(model.linkage) for effect in model.effects)
    compliance = "other compliance than listed below" if softened else "compliance"
    items = [
        f"flexible links in large deformation ({elastic.model.name}, order {elastic.order}): {links}",
        f"rigid links: {', '.join(link.name for link in mechanism.rigid_links)}",
        f"ideal joints, without play, friction or {compliance}: {', '.join(kinds)}",
        "forces that keep their direction, applied without inertia",
    ]
    if mixed:
        items.insert(1, f"pressure as an unknown (u–p elements) in {', '.join(mixed)}")
    return (*items, *(effect.explain() for effect in model.effects))


def _weight_hint(change: float | None, displacement: float, units: Units, options: ExplanationOptions) -> Hint:
    """The hint on weight, whose ``change`` of the displacement is None where the weight is unknown."""
    per_volume = f"{units.force}/{units.length}³"
    if change is None:
        return Hint("weight", f"call explain(weight=…) with the weight per volume in {per_volume}", False)
    part = change / max(abs(displacement), 1e-300)
    return Hint(
        "weight",
        f"flexible links of {options.weight:.3g} {per_volume} would move the point by at most {change:.2g} "
        f"{units.length}, {part:.2%} of its displacement; "
        "list Gravity(…) to include it (one form to compile, a few per cent of a frame)",
        part > options.tolerance,
    )


def _strength_hint(frame: Frame) -> Hint | None:
    """The factor of safety; None, and nothing computed, where no material has an allowable."""
    if not allowables(frame.stresses.materials):
        return None
    safety = frame.safety
    return Hint("yield and fracture", str(safety), safety.factor - safety.error < 1.0)


def _law_hint(frame: Frame) -> Hint | None:
    """The least stable law; None, and nothing computed, where all are known to be stable."""
    if all(material.law.stable for material in frame.stresses.materials.values()):
        return None
    least = min(frame.law_stability.values(), key=lambda own: own.value)
    return Hint("instability of the material", str(least), not least.stable)


def _point_force_hint(
    part: PrescribedPart, growth: float, displacement: float, units: Units, options: ExplanationOptions
) -> Hint | None:
    """Growth of the displacement by each halving of the elements; None if there is none."""
    if not growth:
        return None
    fraction = abs(growth) / max(abs(displacement), sys.float_info.min)
    added = f"each halving adds about {abs(growth):.2g} {units.length}, {fraction:.2%} of it"
    return Hint("extent of the force", f"{cause_of_growth(part)} ({added})", fraction > options.tolerance)


def weight_influence(model: MechanismModel, solver: EquilibriumSolver, at: Equilibrium) -> np.ndarray:
    """Derivative of the displacement by a weight per volume along each axis the mechanism moves in.

    dQ/dw_k = û · ∫ e_k dV, û the nodal adjoint of the displacement
    """
    elastic = model.elastic
    with model.shaped(at.design):
        adjoint = adjoint_at(solver, replace(at, unknown=Unknown.DISPLACEMENT))
        displacements = elastic.split(adjoint.nodal)[0]
        v = ufl.TestFunction(elastic.u.function_space)
        depth = elastic.model.multiplier(elastic.depth) * ufl.det(elastic.rest_gradient)
        direction = fem.Constant(elastic.mesh, np.zeros(elastic.model.dim))
        form = compile_form(ufl.dot(direction, v) * depth * elastic.dx(metadata={"quadrature_degree": elastic.order}))
        slopes = []
        for axis in np.eye(elastic.model.dim)[: model.linkage.dim]:
            direction.value = axis
            slopes.append(model.mesh.mesh.comm.allreduce(float(elastic.assembled(form) @ displacements)))
    return np.array(slopes)


def _compressibility_hint(model: MechanismModel, limit: float) -> Hint | None:
    elastic, links = model.elastic, model.mechanism.flexible_links
    stiff = [
        link.name
        for link, material, is_mixed in zip(links, model.materials, model.mixed, strict=True)
        if material.law.nu > limit and elastic.model.confined and not is_mixed
    ]
    if not stiff:
        return None
    remedy = "use order 2 or 3 with" if elastic.order == 1 else "use"
    return Hint(
        "pressure as an unknown",
        f"Poisson's ratio of {', '.join(stiff)} is above {limit:g}: elements of order {elastic.order} are too stiff "
        f"there; {remedy} formulation=MixedFormulation(above={limit:g}), or compare two sizes",
        True,
    )


def _spin_hint(model: MechanismModel, solver: EquilibriumSolver, at: Equilibrium) -> Hint | None:
    """Outputs, and points of forces that do not act, on links that spin idly, away from the line of the spin."""
    mechanism, linkage, names = model.mechanism, model.linkage, list[str]()
    if not solver.system.idle:
        return None
    parts: tuple[Force | Output, ...] = (*mechanism.outputs, *mechanism.forces)
    with model.shaped(at.design):
        for spin in solver.system.idle:
            start, along = spin.line(linkage.rigid.drawn)
            for part in parts:
                if linkage.body_of(part.on) not in spin.bodies:
                    continue
                arm = model.rest_position(part) - start
                if np.linalg.norm(arm - (arm @ along) * along) > 1e-9 * linkage.length:
                    names.append(repr(part.name))
    if not names:
        return None
    return Hint(
        "idle spins",
        f"nothing keeps the links of {', '.join(names)} from turning about the line between their ball joints: how far "
        "they turn is set by a gauge, and these points, away from the line, move with it; place them on the line, or "
        "hold the spin, for example by a universal joint in place of a ball",
        True,
    )


def _length_hint(discretisation: Discretisation, units: Units, options: ExplanationOptions) -> Hint | None:
    text = coarse_links(discretisation, units, options)
    # at any tolerance: beyond the limit nothing bounds the error, and estimates do not see it
    return Hint("length of elements", text, True) if text else None


def coarse_links(discretisation: Discretisation, units: Units, options: ExplanationOptions | None = None) -> str:
    """Drawn links whose elements are too long to bend with them, and a remedy; empty if there are none.

    Designs, which keep the mesh, do not count.
    """
    own, linkage, options = discretisation.fidelity, discretisation.linkage, options or ExplanationOptions()
    allowed = options.longest[own.order]

    def measured(link: FlexibleLink, shape: Shape) -> tuple[float, float]:
        """Thickness and largest size; measured thicknesses are good to less than the margin."""
        sites = plan_sites(linkage, link)
        thickness = thinnest_stretch(link.name, shape, sites, dim=own.model.dim, length=own.sizes[link])
        return thickness, (1.0 + 1e-6) * allowed * thickness

    shapes = discretisation.shapes.items()
    limits = from_one(discretisation.comm, lambda: [measured(link, shape) for link, shape in shapes])
    thin = {link: limit for (link, _), limit in zip(shapes, limits, strict=True) if own.sizes[link] > limit[1]}
    if not thin:
        return ""
    each = "; ".join(
        f"{link.name!r} is drawn {thickness:.3g} {units.length} thick at its thinnest, its elements "
        f"{own.sizes[link]:.3g} {units.length} long"
        for link, (thickness, _) in thin.items()
    )
    finer = "order=2, or " if own.order == 1 else ""
    size = Context(prec=2, rounding=ROUND_FLOOR).create_decimal_from_float(min(size for _, size in thin.values()))
    return (
        f"{each}: elements of order {own.order} longer than {allowed:g} thicknesses can bend too little, by more than "
        f"about one per cent; use {finer}size={float(size):g} or less"
    )


def _touching_hint(model: MechanismModel, frame: Frame) -> Hint:
    """Links that come closer to each other than half an element, except those that share a joint."""
    mesh, links = model.mesh, model.mechanism.flexible_links
    snapshot, joined = gather(model, frame), [{joint.a, joint.b} for joint in model.mechanism.joints]

    def search() -> str:
        if snapshot is None:
            return ""
        places = (snapshot.rest + snapshot.displacement)[:, :2]
        trees = [cKDTree(places[np.unique(mesh.cells[mesh.link_of_cell == k])]) for k in range(len(links))]
        reach = 0.5 * np.linalg.norm(np.diff(places[mesh.cells[:, :2]], axis=1)[:, 0], axis=1).mean()
        return "; ".join(
            f"{a.name} and {b.name}"
            for (a, one), (b, other) in combinations(zip(links, trees, strict=True), 2)
            if {a, b} not in joined and one.count_neighbors(other, reach)
        )

    names, text = from_one(mesh.comm, search), "no links come close to each other"
    if names:
        text = f"in one plane these links would touch: {names}; stack them, or list Contact(…) with obstacles"
    return Hint("contact between links", text, bool(names))


def _buckling_hint(model: MechanismModel, frame: Frame, slender: float) -> Hint | None:
    """The largest compression of a strip between its joints over its Euler load out of the plane.

    N_cr = π² E I / L²,     I = h b³ / 12,     h in the plane, b the depth
    """
    fraction, name = 0.0, ""
    links = zip(model.mechanism.flexible_links, model.shapes, model.materials, model.depths, strict=True)
    for link, shape, material, depth in links:
        compression, length = _compression(model, frame, link)
        if isinstance(shape, Strip) and length:
            critical = pi**2 * material.law.E * shape.thickness * depth**3 / 12.0 / length**2
            fraction, name = max((fraction, name), (compression / critical, link.name))
    if not name:
        return None
    text = f"the compression of {name} is about {fraction:.2g} of its buckling load out of the plane"
    remedy = "; use space='3d'" if fraction > slender else ""
    return Hint("bending out of the plane", text + remedy, fraction > slender)


def _compression(model: MechanismModel, frame: Frame, link: FlexibleLink) -> tuple[float, float]:
    """The largest compression of a link along the line between its joints farthest apart, and their distance at rest.

    Between two joints it is the sum of the reactions along the line on one side of them, or on the other side where
    forces act between.
    """
    linkage, drawn, ends = model.linkage, model.linkage.joints.drawn, []
    for joint in model.mechanism.joints:
        if link in (joint.a, joint.b):
            k = linkage.connection_of(joint)
            connection = linkage.joints.connections[k]
            body, sign = (connection.b, 1.0) if joint.b == link else (connection.a, -1.0)
            at_rest, here = (linkage.joints.place(k, body, poses) for poses in (drawn, frame.state.poses))
            ends.append((at_rest, here, sign * frame.reactions[joint.name].force))
    if not ends:
        return 0.0, 0.0
    at_rest, here, forces = (np.array(each) for each in zip(*ends, strict=True))
    distances = np.linalg.norm(at_rest[:, None] - at_rest, axis=2)
    first, last = np.unravel_index(np.argmax(distances), distances.shape)
    length = float(distances[first, last])
    if length <= 1e-9 * linkage.length:
        return 0.0, 0.0
    line = (here[last] - here[first]) / np.linalg.norm(here[last] - here[first])
    pushing = np.cumsum((forces @ line)[np.argsort(at_rest @ (at_rest[last] - at_rest[first]))])
    before, after = pushing[:-1], pushing[:-1] - pushing[-1]
    return max(0.0, float(before.max()), float(after.max())), length


@dataclass(frozen=True)
class PinFriction:
    """Dry friction in a hinge.

    Attributes:
        coefficient: Coulomb's μ.
        radius: of the pin.

    Raises:
        DescriptionError: one of them is not positive.
    """

    coefficient: float
    radius: float

    def __post_init__(self) -> None:
        set_fields(self, coefficient=positive("coefficient of friction", self.coefficient))
        set_fields(self, radius=positive("radius of a pin with friction", self.radius))


def friction_band(
    frames: Sequence[Frame], pins: Mapping[Joint, PinFriction], model: MechanismModel
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the force between which friction holds the mechanism, see ``Curve.friction_band``."""
    expect("friction band", pins, Mapping, "a mapping", "Give {joint: PinFriction(coefficient, radius)}")
    poses, linkage = [frame.state.poses for frame in frames], model.linkage
    if len(poses) < 2:
        raise DescriptionError("friction band", "the curve has one frame only", "Give two values or more")
    turning = []  # moment of friction and angle of each pin, (frames,) each
    for joint, pin in pins.items():
        is_hinge = isinstance(joint, Joint) and joint.kind.motorised and not joint.kind.sliding
        if not is_hinge or joint not in model.mechanism.joints or joint.name not in frames[0].reactions:
            name = getattr(joint, "name", joint)
            raise DescriptionError(
                "friction band", f"{name!r} is not a hinge of this curve that turns", "Name its revolute joints"
            )
        expect(f"friction of {joint.name!r}", pin, PinFriction, "a friction", "Give PinFriction(coefficient, radius)")
        coordinate = JointCoordinate(linkage, joint)
        turned = np.array([coordinate.value(z) for z in poses])
        forces = np.array([frame.reactions[joint.name].force for frame in frames])
        if linkage.dim == 3:
            turned = np.unwrap(turned, period=4.0 * np.pi)
            first, axis = coordinate.bodies[0], np.array(joint.axis)
            axes = np.array([linkage.joints.space.rotate(z[first], axis) for z in poses])
            forces = forces - np.sum(forces * axes, axis=1, keepdims=True) * axes
        turning.append((pin.coefficient * pin.radius * np.linalg.norm(forces, axis=1), turned))
    # length of the path of all bodies and the force's point, in lengths of the mechanism and rad
    space = linkage.joints.space
    scale = np.concatenate([np.full(space.dim, linkage.length), np.ones(space.rotation_size)])
    motion = [np.append(frame.state.poses / scale, frame.displacement / linkage.length) for frame in frames]
    steps = np.linalg.norm(np.diff(motion, axis=0), axis=1)
    # frames closer than that, in lengths of the mechanism or rad, differ by the tolerance of their equilibria
    if not np.all(steps > 1e-8):
        raise DescriptionError("friction band", "two frames of the curve are the same", "Give different values")
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    order: Literal[1, 2] = 1 if len(poses) == 2 else 2
    loss = np.zeros_like(arc)
    for moment, turned in turning:
        loss += moment * np.abs(np.gradient(turned, arc, edge_order=order))
    speed = np.abs(np.gradient([frame.displacement for frame in frames], arc, edge_order=order))
    surplus = np.divide(loss, speed, out=np.where(loss > 0.0, np.inf, 0.0), where=speed > 0.0)
    forces = np.array([frame.force for frame in frames])
    return forces - surplus, forces + surplus
