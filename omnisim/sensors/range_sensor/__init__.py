"""Single-beam range sensors: sonars and infrared sensors."""
