"""Recovered stress and strain at the vertices of a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenicsmech.stress.recovered import Recovered, von_mises


@dataclass(frozen=True, eq=False)
class StressField:
    """Recovered stress and strain at the vertices of the mesh; zero where joints hold a link.

    Attributes:
        stress: Cauchy's, (vertices, 3, 3).
        strain: nominal, U − I of the elastic deformation R U, in the plane of planar models, (vertices, dim, dim).
    """

    stress: np.ndarray
    strain: np.ndarray

    @classmethod
    def of(cls, found: Recovered, vertices: np.ndarray, count: int) -> StressField:
        """The field from one recovered point at each of some ``vertices`` (n,) of ``count``."""
        assert found.elastic is not None, "strains are recovered with it"
        dim = found.elastic.shape[-1]
        stress, strain = np.zeros((count, 3, 3)), np.zeros((count, dim, dim))
        stress[vertices] = found.stress[:, 0]
        # F = R U,     U = V Σ Vᵀ
        _, stretches, V = np.linalg.svd(found.elastic[:, 0])
        strain[vertices] = np.swapaxes(V, -1, -2) @ ((stretches - 1.0)[..., None] * V)
        return cls(stress, strain)

    @property
    def von_mises(self) -> np.ndarray:
        """Von Mises stress, (vertices,)."""
        return von_mises(self.stress)

    @property
    def principal_strain(self) -> np.ndarray:
        """Largest principal strain, which allowable strains are compared with, (vertices,)."""
        return np.linalg.eigvalsh(self.strain)[..., -1]
