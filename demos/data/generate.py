"""Makes the synthetic measurements of the specimens: cubic elements on a finer mesh than the fit's, and noise.

python3 demos/data/generate.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from characterise import FILES, TRUE, bending_test, onyx

import fenicsmech as fm
from fenicsmech.files import write_csv

LARGEST = {1.0: 0.225, 2.0: 1.75}  # N
READINGS = 12
NOISE = 0.007  # standard deviation of a displacement, relative to the specimen's largest
SEED = 20


def main():
    random = np.random.default_rng(SEED)
    for thickness, name in FILES.items():
        scene, push = bending_test(thickness, onyx(TRUE))
        sim = fm.Simulation(scene, space="3d", order=3, size=1.6)
        forces = np.round(np.linspace(0.0, LARGEST[thickness], READINGS + 1)[1:], 4)
        exact = sim.load_displacement(push, forces=list(forces)).displacements
        read = exact + NOISE * exact.max() * random.standard_normal(READINGS)
        columns = {"force [N]": forces, "displacement [mm]": np.round(read, 3)}
        write_csv(Path(__file__).parent / name, columns)


if __name__ == "__main__":
    main()
