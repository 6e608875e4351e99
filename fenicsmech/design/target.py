"""Targets: requirements on quantities at samples, their checks, and the comparison of values with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain

import numpy as np

from fenicsmech.collective import on_one
from fenicsmech.design.description import SplineDesign
from fenicsmech.design.numbers import Number
from fenicsmech.errors import DescriptionError, counted, expect, finite, positive, set_fields
from fenicsmech.mechanism import DRAWN, Configuration, Force, Scene, Units
from fenicsmech.multibody import assemble
from fenicsmech.quantities import Component, Displacement, ForceMagnitude, Magnitude, Quantity, Sample
from fenicsmech.simulation import CurveRequest, Simulation, read_request

MET = 0.01
"""Largest error of a target that counts as met, over its scale."""

Numbers = float | Sequence[float] | np.ndarray


@dataclass(frozen=True, init=False)
class Target:
    """A requirement on a quantity at a sample.

        Target(Displacement(tip, at=(40, 60)), grasp, equals=(5.0, -1.0))
        Target(ForceMagnitude(push), Sample({push: at(5.0)}), equals=2.0)
        Target(MotorTorque(shaft), grasp, at_most=30.0)
        Target(LinkMass(crank, density=1e-9), least=True)
        Target(push, force=4.0, displacement=5.0)

    The last form is short for ``Target(Displacement(push), Sample({push: 4.0}), equals=5.0)``.

    Args:
        quantity: the quantity, or a force.
        sample: the equilibrium at which it is evaluated; none for quantities of links at rest.
        equals: wanted value; of a vector a sequence or array of as many components as are wanted of it, counted from
            the first.
        at_most, at_least: bounds instead.
        least: the quantity, a number, is made as small as possible instead.
        weight: of its squared relative error, or of the minimised quantity, in the objective; bounds have none.
        scale: to which errors are relative, in the unit of the quantity. By default the wanted value's size |ū|, or a
            tenth of the largest one that quantities of the same kind are to equal, where that is more; the size of a
            bound, or where it is zero a tenth of the largest value wanted of quantities of its kind; for a minimised
            quantity its value as drawn, or at the start where the drawn design does not carry its loads.
        force, displacement, configuration: of the short form.

    Attributes:
        quantity, sample, weight: likewise.
        relation: "equals", "at most", "at least" or "least".
        wanted: components of the wanted value or bound; empty for a minimised quantity.
        scale: if it was given.
        vector: whether components are wanted, rather than one number.

    Raises:
        DescriptionError: a number is invalid, there is not exactly one relation, or a bound has a weight.
    """

    quantity: Quantity
    sample: Sample | None
    relation: str
    wanted: tuple[float, ...]
    weight: float
    scale: float | None
    vector: bool = field(compare=False, repr=False)

    def __init__(
        self,
        quantity: Quantity | Force,
        sample: Sample | None = None,
        *,
        equals: Numbers | None = None,
        at_most: Numbers | None = None,
        at_least: Numbers | None = None,
        least: bool = False,
        weight: float = 1.0,
        scale: float | None = None,
        force: float | None = None,
        displacement: float | None = None,
        configuration: Configuration = DRAWN,
    ) -> None:
        if isinstance(quantity, Force):
            if sample is not None or equals is not None:
                raise DescriptionError(
                    f"target of {quantity.name!r}", "a force alone is not a quantity", "Give Displacement(force)"
                )
            if force is None or displacement is None:
                missing = "force" if force is None else "displacement"
                raise DescriptionError(
                    f"{missing} of a target for {quantity.name!r}",
                    "it is not given",
                    "Give finite force=… and displacement=…, or Displacement(force) with Sample(…) and a relation",
                )
            equals = finite(f"displacement of a target for {quantity.name!r}", displacement)
            sample = Sample({quantity: finite(f"force of a target for {quantity.name!r}", force)}, configuration)
            quantity = Displacement(quantity)
        elif not isinstance(quantity, Quantity):
            raise DescriptionError(
                "target", f"{quantity!r} is neither a quantity nor a force", "Give one of the mechanism's forces"
            )
        elif force is not None or displacement is not None or configuration != DRAWN:
            raise DescriptionError(
                f"target of the {quantity}",
                "force, displacement and configuration belong in its sample",
                "Give Sample(…)",
            )
        part, relations = f"target of the {quantity}", {"equals": equals, "at most": at_most, "at least": at_least}
        given = {relation: value for relation, value in relations.items() if value is not None}
        if len(given) + bool(least) != 1:
            raise DescriptionError(
                part, f"it has {len(given) + bool(least)} relations", "Give one of equals, at_most, at_least and least"
            )
        relation, wanted = next(iter(given.items()), ("least", ()))
        vector = isinstance(wanted, Sequence | np.ndarray) and not isinstance(wanted, str) and np.ndim(wanted) > 0
        numbers: tuple = tuple(wanted) if vector else (wanted,)  # type: ignore[arg-type]  # the vector is a sequence
        if given and not numbers:
            raise DescriptionError(part, f"{relation} is empty", "Give a number for each component that is wanted")
        weight = positive(f"weight of a target for the {quantity}", weight)
        if relation in ("at most", "at least") and weight != 1.0:
            raise DescriptionError(
                part,
                f"{weight:g} weighs a bound, which holds whatever it weighs",
                "Leave out weight=…, or give scale=…",
            )
        if quantity.of_state != isinstance(sample, Sample):
            raise DescriptionError(
                part,
                f"its sample is {sample!r}",
                "Give Sample(…)" if quantity.of_state else "Leave it out: links at rest have one shape",
            )
        if sample is not None and sample == quantity.since:
            raise DescriptionError(part, f"both of its samples are {sample}", "Give two that differ")
        set_fields(
            self,
            quantity=quantity,
            sample=sample,
            relation=relation,
            wanted=tuple(finite(f"wanted value of the {part}", value) for value in numbers),
            weight=weight,
            scale=None if scale is None else positive(f"scale of the {part}", scale),
            vector=bool(given) and vector,
        )

    @property
    def samples(self) -> tuple[Sample, ...]:
        """The equilibria that the quantity depends on: its sample, then the other one of a cycle; none at rest."""
        return tuple(own for own in (self.sample, self.quantity.since) if own is not None)

    @property
    def size(self) -> int:
        """Number of components that are wanted."""
        return max(len(self.wanted), 1)

    @property
    def name(self) -> str:
        """The target in words."""
        return f"{self.quantity}{'' if self.sample is None else f' under {self.sample}'}"

    def check(self, scene: Scene, dim: int) -> None:
        """Checks the quantity, and the number of wanted values, in ``dim`` dimensions.

        Raises:
            DescriptionError: the scene has no such quantity, or it has other components than are wanted.
        """
        self.quantity.check(scene, dim)
        size = self.quantity.size(dim)
        if size > 1 and self.relation == "least":
            raise DescriptionError(
                f"target of the {self.quantity}",
                f"it has {counted(size, 'component')}, and only a number can be least",
                "Give Magnitude(…) of it, or Component(…, direction=…)",
            )
        if len(self.wanted) > size or (size > 1 and not self.vector):
            raise DescriptionError(
                f"target of the {self.quantity}",
                f"it has {counted(size, 'component')} and {counted(self.size, 'wanted value')}",
                "Give as many numbers as it has",
            )

    @property
    def on_curve(self) -> tuple[Force, float, float, Configuration] | None:
        """Force, magnitude, displacement and configuration of a point of a load–displacement curve, if it is one."""
        if self.sample is None or self.sample.moved or self.relation != "equals" or len(self.sample.forces) != 1:
            return None
        (force, magnitude), *_ = self.sample.forces
        if self.quantity != Displacement(force) or not isinstance(magnitude, float):
            return None
        return force, magnitude, self.wanted[0], self.sample.configuration


def limits(
    quantity: Quantity,
    samples: Sample | Target | Iterable[Sample | Target],
    *,
    at_most: Numbers | None = None,
    at_least: Numbers | None = None,
    scale: float | None = None,
) -> tuple[Target, ...]:
    """One limit at several samples, over a motion for instance: a target for each.

        targets=[*targets, *limits(LargestStress(), targets, at_most=30.0)]
        targets=[*targets, *limits(LeastGap(left, right), motion, at_least=1.0)]

    Args:
        quantity: what is limited; that of a cycle in the cycles from its own sample to each of these.
        samples: where, one or several, each once; of targets theirs, so that all targets of a problem stand for all its
            equilibria.
        at_most, at_least: the bound.
        scale: to which errors are relative, see ``Target``.

    Raises:
        DescriptionError: there is no sample, or not exactly one bound.
    """
    expect("limits", quantity, Quantity, "a quantity", "Give one, such as LargestStress()")
    several = (samples,) if isinstance(samples, Sample | Target) else samples
    expect(f"limits of the {quantity}", several, Iterable, "a list of samples", "Give samples, or targets with some")
    given: list[tuple[Sample, ...]] = []
    for own in several:
        expect(f"limits of the {quantity}", own, Sample | Target, "a sample", "Give samples, or targets with some")
        given.append(own.samples if isinstance(own, Target) else (own,))
    found = [sample for sample in dict.fromkeys(chain.from_iterable(given)) if sample != quantity.since]
    if not found:
        raise DescriptionError(f"limits of the {quantity}", "there is no sample", "Give samples, or targets with some")
    return tuple(Target(quantity, own, at_most=at_most, at_least=at_least, scale=scale) for own in found)


class Comparison:
    """Values of all components compared with the wanted ones.

    With the scale s and the weight w of a target, and the value v of a component,

        equals     residual        √w (v − v̄) / s
        at most    inequality      (v − v̄) / s ≤ 0,     at least with the other sign
        least      plain objective w v / s

    Args:
        targets: all of them.
        units: of the scene.
        drawn: values of all components as drawn, to which minimised quantities are relative; 1 where not known.

    Attributes:
        places: the components of each target.
        scales, scale_of: of the targets, (targets,), and of their components, (components,).
        relative: whether a minimised quantity is relative to its drawn value.
        smoothed: which components are smoothed extremes, (components,).
        resolution: changes of components within the accuracy of extremes, over their scales, (components,).

    Raises:
        DescriptionError: zero is wanted, and no scale is given.
    """

    def __init__(self, targets: Sequence[Target], units: Units, drawn: np.ndarray | None = None) -> None:
        self.targets, self._units = tuple(targets), units
        sizes = [target.size for target in targets]
        self.places = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes), strict=True)]
        relations = np.repeat([target.relation for target in targets], sizes)
        self._equal, self._bounded = relations == "equals", np.isin(relations, ("at most", "at least"))
        self._summed = relations == "least"
        self.relative = any(target.relation == "least" and target.scale is None for target in targets)
        self.smoothed = np.repeat([target.quantity.smoothed for target in targets], sizes)
        self.resolution = np.repeat([target.quantity.resolution for target in targets], sizes)
        self._wanted = np.concatenate([target.wanted or (0.0,) for target in targets])
        self.scales = np.array(
            [self._scale(k, None if drawn is None else float(drawn[self.places[k]][0])) for k in range(len(targets))]
        )
        weights = np.array([target.weight for target in targets])
        self.scale_of = np.repeat(self.scales, sizes)
        self._root = np.sqrt(np.repeat(weights, sizes))
        self._sign = np.where(relations == "at least", -1.0, 1.0)
        self.names = tuple(target.name for target in targets for _ in range(target.size))

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self._wanted)

    def relative_to(self, values: np.ndarray) -> Comparison:
        """The same with minimised quantities relative to those in ``values`` (components,)."""
        return Comparison(self.targets, self._units, values)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Of the components that are to equal something."""
        return (self._relative(values) * self._root)[self._equal]

    def plain(self, values: np.ndarray) -> float:
        """Σ w v / s of the minimised quantities."""
        return float(np.sum((self._relative(values) * self._root**2)[self._summed]))

    def inequalities(self, values: np.ndarray) -> np.ndarray:
        """Of the components that are bounded."""
        return (self._relative(values) * self._sign)[self._bounded]

    def bounded(self) -> tuple[str, ...]:
        """Names of the inequalities."""
        return tuple(name for name, own in zip(self.names, self._bounded, strict=True) if own)

    def slopes(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of residuals, plain objective and inequalities from those of components (components, n)."""
        relative = rows / self.scale_of[:, None]
        root = self._root[:, None]
        plain = np.sum((relative * root**2)[self._summed], axis=0)
        return (relative * root)[self._equal], plain, (relative * self._sign[:, None])[self._bounded]

    def residual_errors(self, errors: np.ndarray) -> np.ndarray:
        """|e| of the residuals from errors of components, (components,)."""
        return (np.abs(errors) / self.scale_of * self._root)[self._equal]

    def relative_slopes(self, rows: np.ndarray) -> np.ndarray:
        """Derivatives of components relative to their scales, (components, n)."""
        return rows / self.scale_of[:, None]

    def errors(self, values: np.ndarray) -> np.ndarray:
        """Relative errors of the targets, (targets,): signed for numbers, else lengths; 0 where a bound is kept."""
        off, found = self._relative(values), []
        for target, place in zip(self.targets, self.places, strict=True):
            if target.relation == "least":
                found.append(0.0)
            elif target.relation == "equals":
                found.append(float(off[place][0]) if target.size == 1 else float(np.linalg.norm(off[place])))
            else:
                found.append(float(np.max((off * self._sign)[place], initial=0.0)))
        return np.array(found)

    def objective_error(self, values: np.ndarray, errors: np.ndarray) -> float:
        """Discretisation error of the objective, O(v + d) − O(v), from the errors d of the components.

            O(v + d) − O(v) = Σ w (r d / s + ½ (d / s)²) over equals,     Σ w d / s over the minimised quantities.

        Far from the targets the first term counts, and the estimate is as good as those of the components; where
        targets are met the second one is left, whose factor is the square of theirs. R depends on the design alone.
        """
        d, r, weights = errors / self.scale_of, self._relative(values), self._root**2
        squares = weights * (r * d + 0.5 * d**2)
        return float(np.sum(squares[self._equal]) + np.sum((weights * d)[self._summed]))

    def _relative(self, values: np.ndarray) -> np.ndarray:
        return (values - self._wanted) / self.scale_of

    def _scale(self, k: int, drawn: float | None) -> float:
        target = self.targets[k]
        if target.scale is not None:
            return target.scale
        if target.relation == "least":
            return abs(drawn) if drawn else 1.0
        scale = float(np.linalg.norm(target.wanted))
        if target.relation == "equals" or scale == 0.0:
            alike = [other for other in self.targets if self._kind(other) == self._kind(target)]
            if target.relation == "equals":
                alike = [other for other in alike if other.relation == "equals"]
            scale = max(scale, 0.1 * max(float(np.linalg.norm(other.wanted)) for other in alike))
        if scale == 0.0:
            raise DescriptionError(
                f"target of the {target.name}", "zero is wanted, to which no error is relative", "Give scale=…"
            )
        return scale

    def _kind(self, target: Target) -> tuple[type[Quantity], str]:
        """What is measured, and its unit: a component or magnitude is of the kind of its vector."""
        quantity = target.quantity
        while isinstance(quantity, Component | Magnitude):
            quantity = quantity.vector
        return type(quantity), quantity.unit(self._units)


def check_targets(simulation: Simulation, targets: Sequence[Target]) -> None:
    """Refuses targets whose parts ``simulation`` does not have, and those that cannot be compared with anything.

    Raises:
        DescriptionError: a target is missing or belongs to another mechanism; its size is not that of its quantity.
        AssemblyError: a configuration does not assemble.
    """
    if not targets:
        raise DescriptionError("design problem", "there are no targets", "Give targets=[Target(…), …]")
    dim = simulation.linkage.dim
    for target in targets:
        expect("design problem", target, Target, "a target", "Give Target(…)")
        for sample in target.samples:
            sample_request(simulation, sample, [sample.value])
            on_one(simulation.comm, partial(assemble, simulation.linkage, sample.configuration))
        target.check(simulation.scene, dim)
        target.quantity.check_materials(simulation.materials)
        if target.sample is not None and isinstance(target.quantity, ForceMagnitude):
            moved = target.sample.moved
            if moved is None or moved[0] != target.quantity.force:
                raise DescriptionError(
                    f"target of the {target.quantity}",
                    f"nothing prescribes the displacement of {target.quantity.force.name!r}",
                    "Give Sample({force: at(…)})",
                )
    Comparison(targets, simulation.scene.units)


def sample_request(simulation: Simulation, sample: Sample, values: Sequence[float]) -> CurveRequest:
    """The request for the path of a sample through ``values`` of its part, if it makes sense for ``simulation``.

    Raises:
        DescriptionError: a force or motor belongs to another mechanism.
    """
    return read_request(
        simulation.scene.mechanism,
        sample.part,
        forces=values if sample.moved is None else None,
        displacements=None if sample.moved is None else values,
        configuration=sample.configuration,
        others=dict(sample.others),
    )


def check_sensitivities(
    targets: Sequence[Target],
    designs: Sequence[SplineDesign | Number],
    *,
    sensitivities: np.ndarray,
    errors: np.ndarray,
) -> None:
    """Refuses targets that are missed and that no parameter moves.

    Args:
        targets: the targets.
        designs: what may change.
        sensitivities: relative change of each component when a parameter changes by its length ℓ, (components,
            parameters).
        errors: relative errors of the targets, (targets,).

    Raises:
        DescriptionError: naming the first such target.
    """
    names = ", ".join(str(own) if isinstance(own, Number) else repr(own.link.name) for own in designs)
    rounding, first = 1e-9, 0
    for target, error in zip(targets, errors, strict=True):
        rows, first = sensitivities[first : first + target.size], first + target.size
        if np.abs(rows).max(initial=0.0) > rounding or (abs(error) <= rounding and target.relation != "least"):
            continue
        if target.sample is not None and not target.sample.moved and target.sample.magnitude == 0.0:
            reason, remedy = "no force acts", "Give a force that is not zero"
        else:
            reason = f"{names} do not carry the force, or something rigid holds its point"
            remedy = "Let links that carry it change, or give targets for another force"
        raise DescriptionError(
            f"target of the {target.name}", f"it does not depend on what may change: {reason}", remedy
        )
