"""Strain energy densities against their textbook forms, from rounding-size to large strain."""

import mpmath
import numpy as np
import pytest

from fenicsmech.elasticity import PLANE_STRESS, SPATIAL, Moduli, density
from fenicsmech.elasticity.energies import density as energies_density
from fenicsmech.elasticity.strain import spatial_strain
from fenicsmech.elasticity.stress import cauchy_stress
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import EnergyLaw, NeoHookean

from . import textbook
from .cases import LAWS, each_case, each_law
from .pointwise import energies, pointwise, tensor
