"""From design parameters to the rest shape of links: splines, handles, weights, best handle positions."""
