"""Range sensors with a single value: sonars and infrared sensors."""
