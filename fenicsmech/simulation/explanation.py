"""Assumptions of a simulation as text, with figures where omitted effects may matter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import hypot, pi

import numpy as np
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from fenicsmech.checks import positive
from fenicsmech.collective import from_one
from fenicsmech.compat import compile_form
from fenicsmech.effects import Gravity
from fenicsmech.equilibrium import Iteration, Quantity
from fenicsmech.estimates import Equilibrium, adjoint_at
from fenicsmech.mechanism import FlexibleLink, Strip, Units
from fenicsmech.model import MechanismModel
from fenicsmech.simulation.fields import gather
from fenicsmech.simulation.frame import Frame


@dataclass(frozen=True)
class ExplanationOptions:
    """Thresholds from which an omitted effect matters.

    Attributes:
        tolerance: relative change of the displacement.
        weight: per volume, of the flexible links, in the units of the scene; None is unknown.
        locking: Poisson's ratio from which displacement elements of an order lose accuracy.
        slender: fraction of the out-of-plane buckling load from which a link needs a simulation in space.
    """

    tolerance: float = 0.01
    weight: float | None = None
    locking: Mapping[int, float] = field(default_factory=lambda: {1: 0.40, 2: 0.48, 3: 0.49})
    slender: float = 0.2

    def __post_init__(self) -> None:
        positive("tolerance of an explanation", self.tolerance)
        if self.weight is not None:
            positive("weight per volume of an explanation", self.weight)


@dataclass(frozen=True)
class Hint:
    """A hint on an omitted effect.

    Attributes:
        what: its name.
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
    model: MechanismModel, solver: Iteration, at: Equilibrium, frame: Frame, units: Units, options: ExplanationOptions
) -> Explanation:
    """The assumptions of a simulation, and hints on omitted effects, from one frame of a curve.

    Args:
        model, solver: the discretised mechanism, and the solver that found the frame.
        at: the equilibrium of the frame.
        frame: of the curve.
        units: of the description, for labels.
        options: thresholds of the hints.

    Raises:
        EquilibriumError: the tangent of the frame is singular.
    """
    hints = [
        _weight_hint(model, solver, at, frame, units, options),
        _compressibility_hint(model, options.locking[model.elastic.order]),
        _touching_hint(model, frame),
    ]
    if model.linkage.dim == 2:
        hints.append(_buckling_hint(model, frame, options.slender))
    return Explanation(_simulated(model), tuple(hint for hint in hints if hint is not None))


def _simulated(model: MechanismModel) -> tuple[str, ...]:
    mechanism, elastic = model.mechanism, model.elastic
    kinds = sorted({joint.kind.name for joint in mechanism.joints})
    links = ", ".join(
        f"{link.name} ({material.name}, {type(material.law).__name__})"
        for link, material in zip(mechanism.flexible_links, model.materials, strict=True)
    )
    mixed = [link.name for link, own in zip(mechanism.flexible_links, model.mixed, strict=True) if own]
    items = [
        f"flexible links in large deformation ({elastic.model.name}, order {elastic.order}): {links}",
        f"rigid links: {', '.join(link.name for link in mechanism.rigid_links)}",
        f"ideal joints, without play, friction or compliance: {', '.join(kinds)}",
        "forces that keep their direction, applied without inertia",
    ]
    if mixed:
        items.insert(1, f"pressure as an unknown (u–p elements) in {', '.join(mixed)}")
    return (*items, *(effect.explain() for effect in model.effects))


def _weight_hint(
    model: MechanismModel, solver: Iteration, at: Equilibrium, frame: Frame, units: Units, options: ExplanationOptions
) -> Hint | None:
    if any(isinstance(effect, Gravity) for effect in model.effects):
        return None
    per_volume = f"{units.force}/{units.length}³"
    if options.weight is None:
        return Hint("weight", f"its influence needs explain(weight=…), the weight per volume in {per_volume}", False)
    change = options.weight * float(np.linalg.norm(weight_influence(model, solver, at)))
    part = change / max(abs(frame.displacement), 1e-300)
    return Hint(
        "weight",
        f"flexible links of {options.weight:.3g} {per_volume} would move the point by at most {change:.2g} "
        f"{units.length}, {part:.2%} of its way; "
        "list Gravity(…) to include it (one form to compile, a few per cent of a frame)",
        part > options.tolerance,
    )


def weight_influence(model: MechanismModel, solver: Iteration, at: Equilibrium) -> np.ndarray:
    """Derivative of the displacement by a weight per volume along each axis the mechanism moves in.

    dQ/dw_k = û · ∫ e_k dV, û the nodal adjoint of the displacement
    """
    elastic = model.elastic
    with model.shaped(at.design):
        adjoint = adjoint_at(solver, replace(at, quantity=Quantity.DISPLACEMENT))
        displacements = elastic.split(adjoint.nodal)[0]
        depths = [elastic.model.multiplier(link.shape.depth) for link in model.mechanism.flexible_links]
        v = ufl.TestFunction(elastic.u.function_space)
        depth = elastic.cellwise(depths) * ufl.det(elastic.rest_gradient)
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
        for link, material, own in zip(links, model.materials, model.mixed, strict=True)
        if material.law.nu > limit and elastic.model.confined and not own
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


def _touching_hint(model: MechanismModel, frame: Frame) -> Hint:
    """Links that come closer than an element, those that share a joint apart."""
    pairs = _close_pairs(model, frame)
    text = "no links come close to each other"
    if pairs:
        names = "; ".join(f"{a} and {b}" for a, b in pairs)
        text = f"in one plane these links would touch: {names}; stack them, or list Contact(…) with obstacles"
    return Hint("contact between links", text, bool(pairs))


def _close_pairs(model: MechanismModel, frame: Frame) -> list[tuple[str, str]]:
    """Names of links that come closer than half an element to each other and share no joint."""
    snapshot = gather(model, frame)
    mesh, links = model.mesh, model.mechanism.flexible_links

    def search() -> list[tuple[str, str]]:
        if snapshot is None:
            return []
        places = (snapshot.rest + snapshot.displacement)[:, :2]
        trees = [cKDTree(places[np.unique(mesh.cells[mesh.link_of_cell == k])]) for k in range(len(links))]
        edge = np.linalg.norm(np.diff(places[mesh.cells[:, :2]], axis=1)[:, 0], axis=1).mean()
        pairs = []
        for i, j in combinations(range(len(links)), 2):
            joined = any({links[i], links[j]} == {joint.a, joint.b} for joint in model.mechanism.joints)
            if not joined and trees[i].count_neighbors(trees[j], 0.5 * edge):
                pairs.append((links[i].name, links[j].name))
        return pairs

    return from_one(mesh.comm, search)


def _buckling_hint(model: MechanismModel, frame: Frame, slender: float) -> Hint | None:
    """The largest compression of a strip between two joints over its Euler load out of the plane.

    N_cr = π² E I / L²,     I = h b³ / 12,     h in the plane, b the depth
    """
    worst = max((_slenderness(model, link, frame) for link in model.mechanism.flexible_links), default=(0.0, ""))
    part, name = worst
    if not name:
        return None
    return Hint(
        "bending out of the plane",
        f"the compression of {name} is about {part:.2g} of what buckles it out of the plane"
        + ("; use space='3d'" if part > slender else ""),
        part > slender,
    )


def _slenderness(model: MechanismModel, link: FlexibleLink, frame: Frame) -> tuple[float, str]:
    joints = [joint for joint in model.mechanism.joints if link in (joint.a, joint.b)]
    if not isinstance(link.shape, Strip) or len(joints) < 2:
        return 0.0, ""
    first, last = (np.array(joint.at[:2]) for joint in (joints[0], joints[-1]))
    length = hypot(*(last - first))
    forces = [frame.reactions[joint.name].force[:2] for joint in joints if joint.name in frame.reactions]
    load = max((float(np.linalg.norm(force)) for force in forces), default=0.0)
    young = model.materials[model.mechanism.flexible_links.index(link)].law.E
    critical = pi**2 * young * link.shape.thickness * link.shape.depth**3 / 12.0 / length**2
    return load / critical, link.name
