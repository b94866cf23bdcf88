"""Substitutes for models that Gazebo Classic worlds expect to be installed."""

from __future__ import annotations

BUILTIN_MODELS = {
    "sun": """
        <light name="sun" type="directional">
          <pose>0 0 10 0 0 0</pose>
          <cast_shadows>true</cast_shadows>
          <diffuse>0.8 0.8 0.8 1</diffuse>
          <direction>-0.5 0.1 -0.9</direction>
        </light>""",
    "ground_plane": """
        <model name="ground_plane">
          <link name="link">
            <visual name="visual">
              <geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>
              <material><diffuse>0.5 0.5 0.5 1</diffuse></material>
            </visual>
          </link>
        </model>""",
}
