"""Designs as plain data: what was found, how well it meets its targets, and files of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from fenicsmech.errors import DescriptionError
from fenicsmech.files import atomic_write

_FORMAT = "fenicsmech design 1"


@dataclass(frozen=True)
class LinkDesign:
    """The shape of one link.

    Attributes:
        name: of the link.
        parameters: its part of p.
        handles: positions θ of its handles, which are the best near those of the designs on the way.
        controls: position and thickness (x, y, δ), then tangent, of every control point, (points, 2, 3).
        thickness: least and largest thickness in the plane.
        bend: largest curvature ratio.
    """

    name: str
    parameters: tuple[float, ...]
    handles: tuple[float, ...]
    controls: tuple[tuple[tuple[float, ...], ...], ...]
    thickness: tuple[float, float]
    bend: float


@dataclass(frozen=True)
class TargetResult:
    """How far a target was reached.

    Attributes:
        force_name, configuration: what acts, and where the motors stand.
        force: its magnitude.
        wanted, started, reached: displacement that is wanted, of the design the optimisation started from, and of
            the best design.
        error: of the reached displacement, relative to the wanted one (to a tenth of the largest wanted one where
            the wanted one is next to nothing).
        finer_elements_add: estimate of what infinitely fine elements would add to the reached displacement; None if
            loading the mechanism from zero does not lead there.
    """

    force_name: str
    configuration: str
    force: float
    wanted: float
    started: float
    reached: float
    error: float
    finer_elements_add: float | None


@dataclass(frozen=True)
class DesignResult:
    """The outcome of an optimisation.

    Attributes:
        mechanism: its name.
        links: the best shapes found.
        targets: how far each target was reached, in the order they were given.
        reason: why the optimisation ended, in words.
        converged: whether it ended at a minimum.
        verified: whether loading the mechanism from zero leads to the equilibria that were followed from design to
            design; the log says where not.
        active: the bounds that hold the design back, in words.
        objective: of the initial and of the final design.
        objective_error: estimate of what infinitely fine elements would add to the final one; None if one of its
            targets' displacements is not known.
        iterations, evaluations: of the objective.
        mesh_ratio_max: largest circumradius over inradius among the cells.
        seconds: wall-clock time.
        phases: the same by phase, on the first process: setup, weights, handles, regularisers, equilibria, gradients,
            verification; the rest is the optimiser's own.
        processes, groups: how many worked, and in how many groups.
    """

    mechanism: str
    links: tuple[LinkDesign, ...]
    targets: tuple[TargetResult, ...]
    reason: str
    converged: bool
    verified: bool
    active: tuple[str, ...]
    objective: tuple[float, float]
    objective_error: float | None
    iterations: int
    evaluations: int
    mesh_ratio_max: float
    seconds: float
    phases: Mapping[str, float]
    processes: int
    groups: int

    @property
    def worst_error(self) -> float:
        """Largest relative error among the targets."""
        return max(abs(target.error) for target in self.targets)

    @property
    def thickness(self) -> tuple[float, float]:
        """Least and largest thickness among all links."""
        return min(link.thickness[0] for link in self.links), max(link.thickness[1] for link in self.links)

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return sum(len(link.parameters) for link in self.links)

    def save(self, path: str | Path) -> None:
        """Writes the result as JSON (call it on one process)."""
        with atomic_write(Path(path)) as file:
            file.write(json.dumps({"format": _FORMAT, **asdict(self)}, indent=2, ensure_ascii=False))

    @staticmethod
    def load(path: str | Path) -> DesignResult:
        """A result that was saved.

        Raises:
            DescriptionError: there is no such file, or it holds no design.
        """
        part = f"design {str(path)!r}"
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise DescriptionError(part, "there is no such file", "Check its name") from None
        except (UnicodeDecodeError, json.JSONDecodeError):
            data = None
        if not isinstance(data, dict) or data.pop("format", None) != _FORMAT:
            raise DescriptionError(part, "it does not hold a design", "Give a file written by DesignResult.save")
        try:
            return _read(data)
        except (KeyError, TypeError) as error:
            raise DescriptionError(part, f"it is incomplete ({error})", "Give an unchanged file") from None


def _read(data: dict) -> DesignResult:
    links = tuple(
        LinkDesign(
            name=link["name"],
            parameters=tuple(link["parameters"]),
            handles=tuple(link["handles"]),
            controls=tuple(tuple(tuple(row) for row in point) for point in link["controls"]),
            thickness=tuple(link["thickness"]),
            bend=link["bend"],
        )
        for link in data.pop("links")
    )
    targets = tuple(TargetResult(**target) for target in data.pop("targets"))
    active, objective = tuple(data.pop("active")), tuple(data.pop("objective"))
    return DesignResult(links=links, targets=targets, active=active, objective=objective, **data)
