"""Range sensors of one number: sonars and infrared."""
