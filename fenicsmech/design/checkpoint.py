"""Checkpoints: what a minimisation needs to go on after its process was killed, as JSON that is always complete."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.design.optimisers import Iterate, Optimiser, Start
from fenicsmech.design.regularisers import Regulariser
from fenicsmech.design.rest_shape import RestShape
from fenicsmech.design.spline_design import Target
from fenicsmech.errors import DescriptionError
from fenicsmech.report import atomic_write
from fenicsmech.simulation import Simulation

_FORMAT = "fenicsmech checkpoint 1"


@dataclass(frozen=True, eq=False)
class Saved:
    """What a checkpoint holds: where to go on, and the handle positions θ there."""

    start: Start
    handles: np.ndarray


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file of one problem.

    Attributes:
        path: the file.
        problem: what is minimised and how, as plain data; a checkpoint of anything else is refused.
    """

    path: Path
    problem: Mapping[str, object]

    def save(self, iterate: Iterate, handles: np.ndarray) -> None:
        """Writes an iterate and its handle positions; the file before it stays until this one is complete."""
        data = {
            "format": _FORMAT,
            "problem": self.problem,
            "number": iterate.number,
            "evaluations": iterate.evaluations,
            "objective": iterate.evaluation.value,
            "parameters": iterate.evaluation.parameters.tolist(),
            "handles": handles.tolist(),
            "memory": iterate.memory.tolist(),
        }
        with atomic_write(self.path) as file:
            file.write(json.dumps(data))

    def load(self) -> Saved:
        """Where to go on.

        Raises:
            DescriptionError: there is no such file, it is no checkpoint, or one of another problem.
        """
        part = f"checkpoint {str(self.path)!r}"
        try:
            data = json.loads(self.path.read_text())
        except FileNotFoundError:
            raise DescriptionError(part, "there is no such file", "Start without resuming") from None
        except (UnicodeDecodeError, json.JSONDecodeError):
            data = None
        if not isinstance(data, dict) or data.get("format") != _FORMAT:
            raise DescriptionError(part, "it is not a checkpoint of this program", "Start without resuming")
        mine = json.loads(json.dumps(self.problem))
        if data["problem"] != mine:
            other = [key for key in mine if data["problem"].get(key) != mine[key]]
            raise DescriptionError(
                part,
                f"it belongs to another problem: {', '.join(other)} differ(s)",
                "Resume with the options of the first run, or start anew",
            )
        start = Start(
            np.array(data["parameters"]), data["number"], data["evaluations"], np.array(data["memory"], dtype=float)
        )
        return Saved(start, np.array(data["handles"]))

    def load_together(self, comm: MPI.Comm) -> Saved | None:
        """The same on all processes, errors too; None if there is no file yet (collective)."""
        return from_one(comm, lambda: self.load() if self.path.exists() else None)


def fingerprint(
    simulation: Simulation,
    rest: RestShape,
    targets: Sequence[Target],
    regulariser: Regulariser,
    optimiser: Optimiser,
) -> dict[str, object]:
    """What is minimised and how, as plain data that a checkpoint must agree with."""
    fidelity, mechanism = simulation.fidelity, simulation.scene.mechanism
    return {
        "mechanism": mechanism.name,
        "space": fidelity.model.name,
        "order": fidelity.order,
        "sizes": list(fidelity.sizes.values()),
        "effects": [repr(effect) for effect in simulation.scene.effects],
        "drawing": [repr(link) for link in mechanism.flexible_links],
        "links": [[link.name, link.spline.initial.tolist()] for link in rest.links],
        "bounds": [repr(link.bounds) for link in rest.links],
        "forces": [[t.force_part.name, *t.force_part.at, *t.force_part.direction] for t in targets],
        "configurations": [[t.configuration.name, *(at for _, at in t.configuration.positions)] for t in targets],
        "targets": [[t.force, t.displacement, t.weight] for t in targets],
        "regulariser": repr(regulariser),
        "optimiser": type(optimiser).__name__,
    }
