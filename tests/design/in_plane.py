"""Design fields of models in which mechanisms move in the plane or in space."""

import numpy as np

from fenicsmech.model import MechanismModel


def design_field(model: MechanismModel, values: np.ndarray) -> np.ndarray:
    """``values`` (nodes, dimension of the mechanism) as a design field, flat; half links keep their mid-plane."""
    missing = model.elastic.model.dim - values.shape[1]
    return np.pad(values, ((0, 0), (0, missing))).ravel()
