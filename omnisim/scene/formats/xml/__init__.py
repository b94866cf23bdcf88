"""XML of robots and worlds: a safe parser, and elements whose errors name their location."""
