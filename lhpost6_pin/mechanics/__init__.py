"""The plant ready to evaluate: pose, coordinates, rigid body on Pinocchio, equilibrium, one step."""
