"""Optimisers of a regularised least-squares objective: Levenberg–Marquardt, the default, and BFGS, as in the paper."""
