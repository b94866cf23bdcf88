"""Import of Gazebo models as robot files."""
