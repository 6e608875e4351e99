"""A design problem in one simulation: rest shape, objective, and equilibria loaded from zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from fenicsmech.collective import on_all
from fenicsmech.design.description import SplineDesign, check_designs, shape_requests, with_followers
from fenicsmech.design.equilibria import FollowOptions, SampleEquilibria
from fenicsmech.design.numbers import Number
from fenicsmech.design.objective import Group, Objective, sample_numbers, split
from fenicsmech.design.regularisers import Regulariser
from fenicsmech.design.rest_shape import ParametricShape
from fenicsmech.design.result import DesignResult, shapes_of
from fenicsmech.design.shape.handle_optimum import HandlePlacement
from fenicsmech.design.shape.shape_map import LinkShape, shape_links
from fenicsmech.design.target import Comparison, Target, check_targets
from fenicsmech.elasticity import PLANE_STRESS, Quadrature
from fenicsmech.errors import DescriptionError
from fenicsmech.log import Clock
from fenicsmech.mechanism import Strip
from fenicsmech.model import fits
from fenicsmech.quantities import NumberKind
from fenicsmech.simulation import Simulation


class DesignedSimulation:
    """The links of one simulation that may change, and the objective of all targets there, built on first use.

    Args:
        simulation: in which equilibria are computed.
        designs: what may change.
        targets: requirements on the mechanism.
        regulariser: R.
        clock: of the phases.

    Attributes:
        shapes: the links whose shape may change, by parameters of their own or with their joints alone.
        numbers: those that may change.
        changed: the links whose solids change.

    Raises:
        DescriptionError: designs or targets name parts that the simulation does not have, or the simulation belongs to
            another design.
        AssemblyError: a target's configuration does not assemble.
    """

    def __init__(
        self,
        simulation: Simulation,
        designs: Sequence[SplineDesign | Number],
        targets: Sequence[Target],
        regulariser: Regulariser,
        clock: Clock,
    ) -> None:
        simulation = simulation.check_drawn("design problem")
        check_targets(simulation, targets)
        self.simulation, self.designs, self.targets = simulation, tuple(designs), tuple(targets)
        self._regulariser, self.clock = regulariser, clock
        self.numbers = tuple(own for own in self.designs if isinstance(own, Number))
        for number in self.numbers:
            number.kind.check(simulation.scene, simulation.linkage.dim)
        self.shapes = with_followers([own for own in self.designs if isinstance(own, SplineDesign)], self.numbers)
        solids = [link for number in self.numbers for link in number.kind.reshaped]
        self.changed = tuple(dict.fromkeys([*(link for own in self.shapes for link in own.links), *solids]))
        self._requests = shape_requests(self.shapes, simulation, self.numbers)
        self._like: DesignedSimulation | None = None
        self._narrower: DesignedSimulation | None = None
        self._wider: dict[tuple[NumberKind, ...], DesignedSimulation] = {}

    def with_targets(self, targets: Sequence[Target]) -> DesignedSimulation:
        """The same with other targets, which shares handles, weights and compiled sensitivities."""
        other = DesignedSimulation(self.simulation, self.designs, targets, self._regulariser, self.clock)
        other._like, other._wider = self, self._wider
        return other

    def with_numbers(self, kinds: Sequence[NumberKind]) -> DesignedSimulation:
        """The same with further numbers, between any bounds; kept for other targets.

        Raises:
            DescriptionError: the scene has no such number, it changes already, or a link cannot follow it.
        """
        key = tuple(kinds)
        if key not in self._wider:
            drawn = [kind.shared([kind.described(part) for part in kind.parts]) for kind in kinds]
            bounds = [sorted((0.5 * value, 2.0 * value)) if value else (-1.0, 1.0) for value in drawn]
            designs = (*self.designs, *(Number(kind, *own) for kind, own in zip(kinds, bounds, strict=True)))
            check_designs(designs)
            wider = DesignedSimulation(self.simulation, designs, self.targets, self._regulariser, self.clock)
            wider._narrower = self
            self._wider[key] = wider
        return self._wider[key].with_targets(self.targets)

    def on(self, simulation: Simulation) -> DesignedSimulation:
        """The same in another simulation."""
        return DesignedSimulation(simulation, self.designs, self.targets, self._regulariser, self.clock)

    @cached_property
    def in_plane_stress(self) -> DesignedSimulation | None:
        """The same problem in plane stress; None if that is not in space, or the scene or a target does not fit."""
        if self.simulation.fidelity.model.dim < 3 or not fits(self.simulation.scene, PLANE_STRESS):
            return None
        try:
            return self.on(self._at(model=PLANE_STRESS))
        except DescriptionError:
            return None

    @property
    def cheapest(self) -> Simulation:
        """That in plane stress if it is not None, else this one, with elements as large as strips are thick."""
        flat = self.in_plane_stress or self
        own, shapes = flat.simulation.fidelity, flat.simulation.shapes
        sizes = {
            link: max(size, shape.thickness) if isinstance(shape := shapes[link], Strip) else size
            for link, size in own.sizes.items()
        }
        return flat._at(order=min(own.order, 2), sizes=sizes)

    def _at(self, **changes: Any) -> Simulation:
        """The simulation at another fidelity, of which layers and quadrature follow."""
        fidelity = replace(self.simulation.fidelity, layers=None, **changes)
        quadrature = Quadrature.for_order(fidelity.order, fidelity.model.dim)
        return self.simulation.with_shapes({}, fidelity=replace(fidelity, quadrature=quadrature))

    @cached_property
    def _shapes(self) -> list[LinkShape]:
        """Handles and weights of the links that change, the same on all processes."""
        with self.clock.phase("setup"):
            mesh = self.simulation.model.mesh
        with self.clock.phase("weights"):
            return shape_links(mesh, self._requests)

    @cached_property
    def rest(self) -> ParametricShape:
        """The rest shape of the links that change."""
        if self._like is not None:
            return self._like.rest
        return ParametricShape(self.simulation.model, self._shapes, self.shapes, self.numbers)

    @cached_property
    def loaded(self) -> SampleEquilibria:
        """The equilibria of all targets, of all processes together."""
        other = self._like or self._narrower
        like = None if other is None else other.loaded
        return SampleEquilibria(self.simulation, self.targets, numbers=self._kinds, like=like)

    @property
    def _kinds(self) -> list[NumberKind]:
        return [own.kind for own in self.numbers]

    @cached_property
    def team(self) -> tuple[Group, Objective]:
        """This process's group, and the objective on its simulation."""
        rest = self.rest
        with self.clock.phase("setup"):
            group, simulation = split(self.simulation.comm, sample_numbers(self.targets)), self.simulation
            like: SampleEquilibria | None = None
            if group.comm is simulation.comm:
                like = self.loaded
            else:
                simulation = simulation.on(group.comm)
                rest = ParametricShape(simulation.model, self._shapes, self.shapes, self.numbers)
            mine = [self.targets[k] for k in group.mine]
            # optimisers shorten steps that lose an equilibrium; the halves of the way there are solves for a step that
            # mostly is refused
            options, comm = FollowOptions(halvings=0), self.simulation.comm
            # a point of one group's targets may be off its link
            equilibria = on_all(comm, lambda: SampleEquilibria(simulation, mine, options, self._kinds, like))
            comparison = Comparison(self.targets, simulation.scene.units)
            objective = Objective(
                rest, equilibria, comparison=comparison, regulariser=self._regulariser, group=group, clock=self.clock
            )
        return group, objective

    def given(self, design: DesignResult | HandlePlacement | np.ndarray) -> tuple[np.ndarray, HandlePlacement | None]:
        """Parameters of a design, and its handle positions if they are known.

        Raises:
            DescriptionError: the result belongs to other links, or the parameters are not as many finite numbers.
        """
        if isinstance(design, HandlePlacement):
            parameters, _ = self.given(design.p)
            return parameters, self.rest.placement_from(parameters, design.theta)
        if not isinstance(design, DesignResult):
            parameters = np.array(design, dtype=float)
            if parameters.shape != self.rest.initial.shape or not np.all(np.isfinite(parameters)):
                raise DescriptionError(
                    "design", f"parameters of shape {parameters.shape}", f"Give {len(self.rest.initial)} finite numbers"
                )
            return parameters, None
        own = shapes_of(design, self.rest.links)
        known = {number.name: number.value for number in design.numbers}
        for number in self.numbers:
            if str(number) not in known:
                raise DescriptionError(
                    f"design of {design.mechanism!r}", f"it has no {number}", "Use a result of the same numbers"
                )
        values = self.rest.numbers.scaled([known[str(number)] for number in self.numbers])
        parameters = np.concatenate([*(o.parameters for o in own), values])
        theta = np.concatenate([np.zeros(0), *(o.handles for o in own)])
        return parameters, self.rest.placement_from(parameters, theta)
