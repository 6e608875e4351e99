"""Optimisers: Levenberg–Marquardt for least squares, SQP for inequalities and other objectives, the paper's BFGS."""
