"""A first machine file for a table: what is known of it stated, the rest typical, with wide priors."""
