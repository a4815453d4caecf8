"""Force laws: scalar kernels that know their equation and nothing of machines, poses or time loops."""
