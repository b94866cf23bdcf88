"""Physics of drives: scenes as convex pieces, robots on wheels, and their motion in MuJoCo."""
