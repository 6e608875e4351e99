"""What accuracy costs in time.

- ``rung``: a fidelity, and the ladder of them for a scene
- ``quantity``: what is looked at: a number read from one equilibrium
- ``measurement``: value and seconds of a rung
- ``extrapolation``: the limit of a sequence of meshes, and how well it is known
- ``error_split``: modelling, discretisation and algebraic error
- ``study``: the ladder run, the reference found, every rung beside it
- ``files``: table and plot of a study
"""

from fenicsmech.accuracy.error_split import ErrorSplit, split_error
from fenicsmech.accuracy.extrapolation import Limit, extrapolate
from fenicsmech.accuracy.files import front_of, save_study, study_text
from fenicsmech.accuracy.measurement import Measurement
from fenicsmech.accuracy.quantity import Displacement, Quantity
from fenicsmech.accuracy.rung import RIGID, TOLERANCE, Rung, ladder
from fenicsmech.accuracy.study import Study, run_study

__all__ = [
    "Displacement",
    "ErrorSplit",
    "Limit",
    "Measurement",
    "Quantity",
    "RIGID",
    "Rung",
    "Study",
    "TOLERANCE",
    "extrapolate",
    "front_of",
    "ladder",
    "run_study",
    "save_study",
    "split_error",
    "study_text",
]
