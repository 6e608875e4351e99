"""The price of accuracy in time: fidelity levels of one scene, measured against the limit of the finest in space.

- ``levels``: a fidelity, and all of them for a scene
- ``measurement``: value and seconds of a level
- ``extrapolation``: the limit of a sequence of meshes, and how well it is known
- ``study``: all levels run, the reference found, and the error of each split into its parts
- ``files``, ``plot``: table and plot of a study
"""

from .extrapolation import Limit, extrapolate
from .files import front_of, save_study, study_text
from .levels import RIGID, TOLERANCE, FidelityLevel, fidelity_levels
from .measurement import Measurement, Quantity
from .plot import ModellingError, WorkSeries, pareto_front, plot_work_precision
from .study import ErrorSplit, Study, run_study, split_error
