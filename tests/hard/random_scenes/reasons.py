"""Whether an error about a scene that makes sense is true, judged without the solver.

Each excuse is proven by a number of its own, which the table of scenes gives. Some follow from geometry and springs,
the others from the last equilibrium, which must be one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fenicsmech as fm

from .assembly_check import smallest_gap
from .blueprint import Blueprint, Built, CompliancePlan, GravityPlan, SpringPlan
from .closure import Place
from .motions import STEP, body_modes, moved
from .potential import Potential
from .residual_check import check, fault
from .stability_check import eigenvalues, led_stiffness
from .thresholds import THRESHOLDS
from .unstrained_check import unstrained_motions

HELD = "the point cannot move that way"


@dataclass(frozen=True)
class Excuse:
    """Why an error is true.

    Attributes:
        reason: in words.
        proof: the number that shows it.
    """

    reason: str
    proof: str


def true_reason(blueprint: Blueprint, built: Built | None, failure: fm.FenicsmechError) -> Excuse | None:
    """Why the error is right; None if it is not."""
    if isinstance(failure, fm.AssemblyError):
        return unassembled(blueprint)
    if not isinstance(failure, fm.EquilibriumError):
        return None
    last = failure.last
    for reason in _BY_GEOMETRY:
        if excuse := reason(blueprint, built, last):
            return excuse
    if last is None or not _proven(blueprint, built, last):
        return None
    for reason in _BY_STATE:
        if excuse := reason(blueprint, built, last):
            return excuse
    return turned_back(blueprint, built, failure)


def _proven(blueprint: Blueprint, built: Built, last: fm.Frame) -> bool:
    """Whether the last equilibrium is one, with the share of constant loads that it has."""
    potential = Potential.of(blueprint, built.simulation, last.state.load_factor)
    return not fault(blueprint, last, None, check(potential, last, math.nan))


def unassembled(blueprint: Blueprint) -> Excuse | None:
    """Rigid links cannot be joined where motors are to take them, whatever shape the flexible ones have."""
    if blueprint.idle_spins:
        return None
    return _excuse("rigid links cannot be joined", "gap over length", smallest_gap(blueprint), above=THRESHOLDS.joined)


def immobile(blueprint: Blueprint, built: Built, last: fm.Frame | None) -> Excuse | None:
    """No admissible motion takes the force's point along its direction, by the geometry of joints alone."""
    if blueprint.control == "forces" or last is None:
        return None
    potential = Potential.of(blueprint, built.simulation)
    places = potential.places(last.state.poses)
    u = potential.nodal(potential.fields(last.state.u)[0], places)
    if abs(potential.led_travel(u + 1j * STEP * potential.free, places).imag) > 0.0:
        return None
    rates = [
        potential.led_travel(potential.nodal(u, there), there).imag / STEP
        for there in (moved(places, 1j * STEP * mode) for mode in body_modes(potential, places))
    ]
    rate = float(np.linalg.norm(rates))
    return _excuse(HELD, "travel per motion of bodies", rate, below=THRESHOLDS.immobile)


def adrift(blueprint: Blueprint, built: Built, last: fm.Frame | None) -> Excuse | None:
    """Loads work along a motion of the drawn mechanism that deforms neither links nor springs and is not prescribed.

    Then no equilibrium is near the drawn configuration, however small the load.
    """
    potential = Potential.of(blueprint, built.simulation)
    motions = _drawn_motions(potential)
    sample = blueprint.samples[-1] if blueprint.control == "forces" else 0.0
    rates, _ = _resistance(potential, motions)
    if blueprint.control != "forces":
        rates = np.vstack([rates, [potential.led_travel(du, there).imag / STEP for du, there in motions]])
    free, _ = _split(rates)
    work = np.zeros(len(motions))
    for k, (du, there) in enumerate(motions):
        done = sum(size * potential.travel(force, du, there) for force, size in potential.acting(sample))
        for plan in blueprint.effects:
            if isinstance(plan, GravityPlan):
                done = done - potential.alone(plan).effect_energy(du, there)
        work[k] = np.imag(done) / STEP
    size = sum(abs(amount) for _, amount in potential.acting(sample)) + potential.weight
    share = float(np.linalg.norm(free @ work)) / max(size, 1e-300)
    reason = "nothing but the force holds the mechanism"
    return _excuse(reason, "work of loads along a free motion", share, above=THRESHOLDS.adrift)


def drowned(blueprint: Blueprint, built: Built, last: fm.Frame | None) -> Excuse | None:
    """A motion of the drawn mechanism that deforms no link is resisted by springs softer than the rounding of links.

    A link of width b and modulus E, in elements about as long as thick, has nodal stiffnesses of E b, each rounded to
    1e-16 of itself; a motion feels those of some thousand nodes: k < 1e-14 E b, k per square of the velocity of what
    moves fastest.
    """
    potential = Potential.of(blueprint, built.simulation)
    rates, stiffnesses = _resistance(potential, _drawn_motions(potential))
    _, resisted = _split(rates)
    if not len(resisted):
        return None
    softest = float(np.linalg.eigvalsh(resisted @ (rates.T * stiffnesses) @ rates @ resisted.T)[0])
    share = softest / max(link.young * link.depth for link in blueprint.flexible)
    reason = "springs softer than the rounding of stiff links"
    return _excuse(reason, "stiffness over the stiffest link's", share, below=THRESHOLDS.drowned)


def at_limit(blueprint: Blueprint, built: Built, last: fm.Frame) -> Excuse | None:
    """The last equilibrium has all but lost the stiffness of its softest mode, that of the unloaded scene.

    Modes are those at the prescribed force or displacement; constant loads are raised before either. Paths go on past
    limit points.
    """
    constant = last.state.load_factor < 1.0
    if blueprint.control == "path" and not constant:
        return None
    led = blueprint.control == "displacements" and not constant
    loaded = Potential.of(blueprint, built.simulation, last.state.load_factor)
    unloaded = Potential.of(blueprint, built.simulation, 0.0)
    drawn = built.simulation.linkage.joints.drawn
    before = eigenvalues(unloaded, np.zeros(unloaded.mesh.nodes.size), drawn, 0.0, led=led)[0]
    now = eigenvalues(loaded, last.state.u, last.state.poses, last.force, led=led)[0]
    return _excuse("at a limit point", "stiffness left", now / abs(before), below=THRESHOLDS.soft)


def out_of_reach(blueprint: Blueprint, built: Built, last: fm.Frame) -> Excuse | None:
    """The displacement takes many times the force that would double the weakest link's length, E b t.

    Links stretched straight stiffen: by the tangent of the last equilibrium it takes less than in truth.
    """
    if blueprint.control != "displacements" or last.state.load_factor < 1.0:
        return None
    potential = Potential.of(blueprint, built.simulation)
    stiffness = led_stiffness(potential, last.state.u, last.state.poses, last.force)
    needed = max(abs(last.force + stiffness * (sample - last.displacement)) for sample in blueprint.samples)
    share = needed / min(link.young * link.depth * link.thickness for link in blueprint.flexible)
    return _excuse("links stretched straight", "force needed over E b t", share, above=THRESHOLDS.unreached)


def overstrained(blueprint: Blueprint, built: Built, last: fm.Frame) -> Excuse | None:
    """Under a force the last equilibrium has elements at a multiple of their size, or a fraction of it."""
    if blueprint.control != "forces":
        return None
    stretch = Potential.of(blueprint, built.simulation, last.state.load_factor).largest_stretch(last.state.u)
    return _excuse("elements strained out of shape", "stretch or its inverse", stretch, above=THRESHOLDS.strained)


def turned_back(blueprint: Blueprint, built: Built, failure: fm.EquilibriumError) -> Excuse | None:
    """A path followed from rest through equilibria that pass the checks turns back before what is asked for.

    The first turn counts, and only if the last equilibrium lies before it: what the path may reach after a snap is not
    what loads that grow lead to, and the error names the turn.
    """
    if blueprint.control == "path" or failure.last.state.load_factor < 1.0 or built.configuration is not fm.DRAWN:
        return None
    asked = blueprint.samples[len(failure.frames)]
    name = blueprint.control.removesuffix("s")
    until = fm.Until(**{name: asked}, frames=THRESHOLDS.followed)
    try:
        frames = built.follow(blueprint, until).frames
    except fm.EquilibriumError as error:
        frames = error.frames
    shares = [getattr(frame, name) / asked for frame in frames]
    top = next((k for k in range(len(shares) - 1) if shares[k] > shares[k + 1]), 0)
    if top == 0 or not getattr(failure.last, name) / asked <= shares[top] < 1.0 or "turns back" not in str(failure):
        return None
    if not all(_proven(blueprint, built, frame) for frame in frames[top - 1 : top + 2]):
        return None
    return Excuse("a path of equilibria turns back", f"{name} there over that asked for {shares[top]:.1e}")


_BY_GEOMETRY: tuple[Callable[[Blueprint, Built, fm.Frame | None], Excuse | None], ...] = (immobile, adrift, drowned)
_BY_STATE: tuple[Callable[[Blueprint, Built, fm.Frame], Excuse | None], ...] = (at_limit, out_of_reach, overstrained)


def _excuse(
    reason: str, name: str, number: float, *, below: float = -math.inf, above: float = math.inf
) -> Excuse | None:
    return Excuse(reason, f"{name} {number:.1e}") if number < below or number > above else None


_Motion = tuple[np.ndarray, list[Place]]


def _drawn_motions(potential: Potential) -> list[_Motion]:
    """Steps along motions of the drawn mechanism that deform no link."""
    poses = np.zeros((len(potential.centres), 3 if potential.blueprint.dim == 2 else 7))
    if potential.blueprint.dim == 3:
        poses[:, 3] = 1.0
    still = np.zeros(potential.mesh.nodes.shape)
    return [(du, there) for du, there, _ in unstrained_motions(potential, still, potential.places(poses))]


def _resistance(potential: Potential, motions: list[_Motion]) -> tuple[np.ndarray, np.ndarray]:
    """Rates of springs and joints that give way along motions, (rows, motions), and their stiffnesses, (rows,)."""
    closure, rates, stiffnesses = potential.closure, [], []
    for plan in potential.blueprint.effects:
        match plan:
            case SpringPlan(joint=name, stiffness=stiffness):
                joint = potential.blueprint.joint(name)
                rates.append([[closure.coordinate(joint, there).imag for _, there in motions]])
                stiffnesses.append(stiffness)
            case CompliancePlan(joint=name, compliance=compliance):
                joint = potential.blueprint.joint(name)
                gaps = [closure.gap(joint, there).imag for _, there in motions]
                rates.append(np.reshape(gaps, (len(motions), potential.blueprint.dim)).T)
                stiffnesses += [1.0 / compliance] * potential.blueprint.dim
    rows = np.vstack([np.zeros((0, len(motions))), *rates]).astype(float) / STEP
    return rows, np.array(stiffnesses)


def _split(rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal combinations of motions along which all rates vanish, and those along which they do not."""
    if not rates.shape[1]:
        return np.zeros((0, 0)), np.zeros((0, 0))
    _, values, right = np.linalg.svd(rates.astype(float), full_matrices=True)
    rank = int(np.sum(values > THRESHOLDS.rank * max(values.max(initial=0.0), 1.0)))
    return right[rank:], right[:rank]
