"""The rest shape of links by design parameters: splines, handles, weights, optimal handle positions."""
