"""Values of forms in the fields of flexible links, and their derivatives by each field."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import assemble_vector, compile_form
from fenicsmech.model import MechanismModel


class FormValue:
    """A form at the fields that the model holds; compiled when it is first needed.

    Args:
        model: whose links it is integrated over.
        form: a scalar.
        fields: by which it is derived, by name.
    """

    def __init__(self, model: MechanismModel, form: ufl.Form, fields: Mapping[str, fem.Function]) -> None:
        self._model, self._form, self._fields = model, form, dict(fields)
        self._slopes: dict[str, tuple] = {}

    def value(self) -> float:
        """The value on the whole mesh."""
        return float(self._model.mesh.comm.allreduce(fem.assemble_scalar(self._compiled)))

    def slope(self, name: str) -> np.ndarray:
        """The derivative by a field, this rank's owned values, flat."""
        if name not in self._slopes:
            field = self._fields[name]
            with self._model.clock.phase("compile"):
                form = compile_form(ufl.derivative(self._form, field))
            self._slopes[name] = form, fem.Function(field.function_space)
        with self._model.clock.phase("adjoint"):
            return assemble_vector(*self._slopes[name]).copy()

    def per_link(self, name: str) -> np.ndarray:
        """The derivative by the value of a field of cells on each flexible link, (links,)."""
        cells, links = self.slope(name), len(self._model.mechanism.flexible_links)
        sums = np.bincount(self._model.mesh.link[: len(cells)], weights=cells, minlength=links)
        return self._model.mesh.comm.allreduce(sums, op=MPI.SUM)

    @cached_property
    def _compiled(self):
        return compile_form(self._form)
