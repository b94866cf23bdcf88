"""MuJoCo models of our own, for tests."""

SHAPES = """
<mujoco model="shapes">
  <asset>
    <texture name="sky" type="skybox" builtin="flat" rgb1=".3 .5 .7" rgb2=".3 .5 .7"
      width="4" height="24"/>
    <texture name="check" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0"
      width="64" height="64"/>
    <texture name="cube" type="cube" builtin="gradient" rgb1=".8 .2 .2" rgb2=".2 .2 .8"
      width="16" height="16"/>
    <texture name="plain" type="cube" builtin="flat" rgb1=".5 1 1" rgb2=".5 1 1"
      width="4" height="4"/>
    <material name="grid" texture="check" texuniform="true" texrepeat="2 2" reflectance=".2"/>
    <material name="cube" texture="cube"/>
    <material name="plain" texture="plain" rgba="1 .5 0 1"/>
    <hfield name="hills" nrow="5" ncol="4" size="1 1.5 .5 .1"
      elevation="0 .1 .5 .2  .3 .9 .1 0  .2 .2 .2 .6  0 0 1 .3  .4 .2 .1 0"/>
    <mesh name="tetra" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
  </asset>
  <worldbody>
    <light pos="0 0 4" dir="0 0 -1" diffuse=".7 .7 .7"/>
    <geom name="floor" type="plane" size="0 0 .05" material="grid"/>
    <geom type="box" group="3" size="1 1 1" pos="0 0 8"/>
    <body name="ball" pos="2 0 .5">
      <freejoint/>
      <geom type="sphere" size=".4" material="cube"/>
    </body>
    <body name="can" pos="1.5 1.5 .6" euler="20 0 30">
      <geom name="side" type="cylinder" size=".3 .5" material="plain"/>
    </body>
    <body name="pill" pos="0 2 .8" euler="0 40 0">
      <geom type="capsule" size=".25 .4" material="cube"/>
    </body>
    <body name="egg" pos="-1.5 1.5 .6">
      <geom type="ellipsoid" size=".3 .5 .6" rgba=".2 .8 .3 1"/>
    </body>
    <body name="crate" pos="-2 0 .4" euler="0 0 20">
      <joint name="hinge" axis="0 0 1"/>
      <geom type="box" size=".4 .3 .4" material="cube"/>
      <geom type="box" size=".1 .1 .1" pos="0 0 .5" rgba="1 0 0 .5"/>
      <site name="lid" pos="0 0 .7"/>
    </body>
    <body name="ground" pos="0 -2.5 .15">
      <geom type="hfield" hfield="hills" rgba=".6 .5 .3 1"/>
    </body>
    <body name="tet" pos="1.2 -1 .3"><geom type="mesh" mesh="tetra"/></body>
    <camera name="top" pos="0 0 5" fovy="60" resolution="80 60"/>
    <camera name="view" pos="0 -5.5 4.5" xyaxes="1 0 0 0 .65 .76" fovy="50"/>
  </worldbody>
</mujoco>
"""
