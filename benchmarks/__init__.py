"""Benchmarks: they measure fenicsmech from outside and print their tables with machine and commit.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.NAME [--write]        from the project's root

====================  ==========================================================================================
``solvers``           the default solver of equilibria and others, on hard cases
``work_precision``    accuracy and time of fidelity levels, with their Pareto front
``accuracy_control``  ``Simulation(scene, accuracy=…)`` against an exhaustive search
``large``             conjugate gradients against the factor on fine meshes (and ``schur``: algebraic multigrid)
``stopping``          time saved by ending Newton's iteration and an optimisation early
``performance``       each choice in the solver, one at a time
``effects``           the time that each effect takes
``optimisers``        Levenberg–Marquardt against BFGS
``constrained``       SQP against optimisers of scipy and NLopt, under inequalities
``closeness``         targets missed where designs stay close to the drawing; designs given by parameters alone
``handles``           quality of the mesh with optimal and with naive handles
``parts``             targets in the exported parts of the demos
``frames``            seconds per load step of the demos' mechanisms; whole designs
``verification``      the tests that compare with exact solutions and other programs, as one table
``walk``              two calls whose files are counted
====================  ==========================================================================================

``--write`` leaves the table in docs/tables/NAME.md. ``mechanisms`` holds the scenes, those of the demos, and ``table``
the options and the output of all benchmarks.
"""
