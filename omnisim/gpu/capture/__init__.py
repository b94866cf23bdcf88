"""The capture: from the atlas to the camera's pixels."""
