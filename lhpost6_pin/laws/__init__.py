"""Force laws: scalar kernels, one equation each, independent of machines, poses and time loops."""
