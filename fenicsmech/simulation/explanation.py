"""What a simulation simulates and what it leaves out, in plain words, with figures where leaving it out may matter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from math import hypot, pi

import numpy as np
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from fenicsmech.collective import from_one
from fenicsmech.compat import compile_form
from fenicsmech.effects import Gravity
from fenicsmech.mechanism import FlexibleLink, Strip, Units
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.goal import Goal
from fenicsmech.simulation.influence import Equilibrium, influence
from fenicsmech.simulation.model import MechanismModel
from fenicsmech.simulation.snapshot import gather

PLASTIC_WEIGHT = 1.2e-9 * 9810.0
"""Weight per volume of plastics and silicones, N/mm³ (1.2 g/cm³)."""

_LOCKS = {1: 0.40, 2: 0.48, 3: 0.49}  # ν from which pure displacement elements of an order lose accuracy
_SLENDER = 0.2  # of the out-of-plane buckling load: from here a link deserves a simulation in space


@dataclass(frozen=True)
class Hint:
    """Something that is left out.

    Attributes:
        what: its name.
        text: what leaving it out means here.
        matters: whether it changes the displacement by more than the tolerance, or may change it altogether.
    """

    what: str
    text: str
    matters: bool


@dataclass(frozen=True)
class Explanation:
    """What is simulated, and hints on what is not; prints as plain text."""

    simulated: tuple[str, ...]
    left_out: tuple[Hint, ...]

    def __str__(self) -> str:
        lines = ["Simulated:", *(f"  - {item}" for item in self.simulated), "Left out:"]
        return "\n".join([*lines, *(f"  {'!' if h.matters else '-'} {h.what}: {h.text}" for h in self.left_out)])


def simulated(model: MechanismModel, space: str, order: int) -> tuple[str, ...]:
    """What is simulated, in plain words."""
    mechanism = model.mechanism
    kinds = sorted({joint.kind.name for joint in mechanism.joints})
    links = ", ".join(
        f"{link.name} ({link.material.name}, {type(link.material.law).__name__})" for link in mechanism.flexible_links
    )
    bulky = [link.name for link, own in zip(mechanism.flexible_links, model.mixed, strict=True) if own]
    items = [
        f"flexible links in large deformation ({space}, order {order}): {links}",
        f"rigid links: {', '.join(link.name for link in mechanism.rigid_links)}",
        f"ideal joints, without play, friction or compliance: {', '.join(kinds)}",
        "forces that keep their direction, applied without inertia",
    ]
    if bulky:
        items.insert(1, f"u–p (mixed) formulation of {', '.join(bulky)}")
    return (*items, *(effect.explain() for effect in model.effects))


def hints(model: MechanismModel, newton, curve: Curve, *, order: int, tolerance: float, units: Units) -> list[Hint]:
    """Hints from the last frame of ``curve`` (collective).

    Args:
        model, newton: of the simulation, for the curve's forces.
        curve: of this simulation.
        order: degree of the displacement field.
        tolerance: relative change of the displacement from which something matters.
        units: of the description; weights are only known in N and mm.
    """
    frame = curve.frames[-1]
    found = [
        _weight_hint(model, newton, curve, frame, tolerance, units),
        _compressibility_hint(model, order),
        _touching_hint(model, frame),
    ]
    if model.linkage.dim == 2:
        found.append(_buckling_hint(model, frame))
    return [hint for hint in found if hint is not None]


def _weight_hint(model, newton, curve: Curve, frame: Frame, tolerance: float, units: Units) -> Hint | None:
    if any(isinstance(effect, Gravity) for effect in model.effects):
        return None
    if (units.length, units.force) != ("mm", "N"):
        return Hint("weight", "list Gravity(…) with densities in your units to include it", False)
    change = PLASTIC_WEIGHT * float(np.linalg.norm(weight_influence(model, newton, curve, frame)))
    share = change / max(abs(frame.displacement), 1e-300)
    return Hint(
        "weight",
        f"flexible links of 1.2 g/cm³ would move the point by at most {change:.2g} mm, {share:.2%} of its way; "
        "list Gravity(…) to include it (one form to compile, a few per cent of a frame)",
        share > tolerance,
    )


def weight_influence(model: MechanismModel, newton, curve: Curve, frame: Frame) -> np.ndarray:
    """Derivative of the displacement by a weight per volume along each axis the mechanism moves in (collective).

    dQ/dw_k = z · ∫ e_k dV, z the adjoint of the displacement
    """
    elastic = model.elastic
    at = replace(Equilibrium.on(curve, frame), goal=Goal.DISPLACEMENT)
    with influence(model, newton, at) as adjoint:
        z = elastic.split(adjoint.on(None))[0]
        depths = [elastic.model.multiplier(link.shape.depth) for link in model.mechanism.flexible_links]
        v = ufl.TestFunction(elastic.u.function_space)
        depth = elastic.cellwise(depths) * ufl.det(elastic.rest_gradient)
        direction = fem.Constant(elastic.mesh, np.zeros(elastic.model.dim))
        form = compile_form(ufl.dot(direction, v) * depth * elastic.dx(metadata={"quadrature_degree": elastic.order}))
        slopes = []
        for axis in np.eye(elastic.model.dim)[: model.linkage.dim]:
            direction.value = axis
            slopes.append(model.mesh.mesh.comm.allreduce(float(elastic.assembled(form) @ z)))
    return np.array(slopes)


def _compressibility_hint(model: MechanismModel, order: int) -> Hint | None:
    limit, links = _LOCKS[order], model.mechanism.flexible_links
    stiff = [
        link.name
        for link, own in zip(links, model.mixed, strict=True)
        if link.material.law.nu > limit and model.elastic.model.confined and not own
    ]
    if not stiff:
        return None
    remedy = "use order 2 or 3 with" if order == 1 else "use"
    return Hint(
        "u–p (mixed) formulation",
        f"Poisson's ratio of {', '.join(stiff)} is above {limit:g}: elements of order {order} are too stiff there; "
        f"{remedy} formulation=MixedFormulation(above={limit:g}), or compare two sizes",
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
    """Names of links that come closer than half an element to each other and share no joint (collective)."""
    snapshot = gather(model, frame)
    mesh, links = model.mesh, model.mechanism.flexible_links

    def search() -> list[tuple[str, str]]:
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


def _buckling_hint(model: MechanismModel, frame: Frame) -> Hint | None:
    """The largest compression of a strip between two joints over its Euler load out of the plane.

    N_cr = π² E I / L²,     I = h b³ / 12,     h in the plane, b the depth
    """
    worst = max((_slenderness(model, link, frame) for link in model.mechanism.flexible_links), default=(0.0, ""))
    share, name = worst
    if not name:
        return None
    return Hint(
        "bending out of the plane",
        f"the compression of {name} is about {share:.2g} of what buckles it out of the plane"
        + ("; use space='3d'" if share > _SLENDER else ""),
        share > _SLENDER,
    )


def _slenderness(model: MechanismModel, link: FlexibleLink, frame: Frame) -> tuple[float, str]:
    joints = [joint for joint in model.mechanism.joints if link in (joint.a, joint.b)]
    if not isinstance(link.shape, Strip) or len(joints) < 2:
        return 0.0, ""
    first, last = (np.array(joint.at[:2]) for joint in (joints[0], joints[-1]))
    length = hypot(*(last - first))
    forces = [frame.reactions[joint.name].force[:2] for joint in joints if joint.name in frame.reactions]
    load = max((float(np.linalg.norm(force)) for force in forces), default=0.0)
    critical = pi**2 * link.material.law.E * link.shape.thickness * link.shape.depth**3 / 12.0 / length**2
    return load / critical, link.name
