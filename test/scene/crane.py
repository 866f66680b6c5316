"""A crane: its URDF, a mesh, and a scene that it stands in."""

CRANE = """<robot name="crane">
  <link name="world"/>
  <link name="Base">
    <collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision>
    <collision><origin xyz="0 0 0.3"/><geometry><sphere radius="0.05"/></geometry></collision>
    <visual><geometry><mesh filename="meshes/wedge.obj"/></geometry></visual>
  </link>
  <link name="boom">
    <collision>
      <origin xyz="0.5 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.05" length="1"/></geometry>
    </collision>
    <visual>
      <origin xyz="0 0 1"/>
      <geometry><mesh filename="package://crane/meshes/wedge.obj" scale="2 -1 1"/></geometry>
    </visual>
  </link>
  <link name="frame"/>
  <link name="hook-1">
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
  </link>
  <link name="lamp">
    <collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision>
  </link>
  <joint name="stand" type="fixed"><parent link="world"/><child link="Base"/>
    <origin xyz="0 0 0.1"/></joint>
  <joint name="swing" type="revolute"><parent link="Base"/><child link="boom"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-3" upper="3"/></joint>
  <joint name="end" type="fixed"><parent link="boom"/><child link="frame"/>
    <origin xyz="1 0 0"/></joint>
  <joint name="drop" type="prismatic"><parent link="frame"/><child link="hook-1"/>
    <axis xyz="0 0 -1"/><limit lower="0" upper="0.8"/></joint>
  <joint name="wire" type="fixed"><parent link="boom"/><child link="lamp"/>
    <origin xyz="0.5 0 -0.06"/></joint>
</robot>
"""
WEDGE = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
SCENE = """version: 1
unit: mm
bodies:
  - {name: floor, primitive: {box: {size: [4000, 4000, 10]}}, pose: {position: [0, 0, -5]}}
robots:
  - name: crane
    urdf: crane/crane.urdf
    angles_deg: {swing: 90}
    offsets: {drop: 100}
"""
