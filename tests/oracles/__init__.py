"""Reference solvers for the tests: independent of fenicsmech, each checked against closed forms in this folder."""
