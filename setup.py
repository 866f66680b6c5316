"""Build description for plain pip and for colcon (ament_python) alike."""

from glob import glob

from setuptools import find_packages, setup

package_name = "proximity_monitor"

scene = ["pyyaml>=6.0", "jsonschema>=4.10"]
nodes = [*scene, "rich>=13.0"]
bag = ["rosbags>=0.11.9"]
display = ["viser>=1.1,<2"]
cad = ["cadquery-ocp>=7.9"]
robots = ["example-robot-data>=6.0", "xacro>=2.0"]
study = [*scene, "rich>=13.0", "matplotlib>=3.6"]
docs = ["mkdocs>=1.6,<2", "mkdocs-material>=9.5,<10", "mkdocstrings[python]>=0.26"]
ros = [*nodes, "ros-jazzy-rclpy", "ros-jazzy-common-interfaces", "ros-rclpy[fastrtps]"]
peers = [
    "python-fcl>=0.7",
    "coal>=3.0",
    "fcpw>=1.2",
    "pin>=3.4",
    "pycollada>=0.9",
    "trimesh>=4.6",
    *cad,
    *robots,
]
# The formatter's output differs between its minor versions, so one of them decides for everybody.
checks = [
    "pytest>=7.4",
    "pytest-xdist>=3.7",
    "hypothesis>=6.90",
    "trimesh>=4.6",
    "python-fcl>=0.7",
    "scipy>=1.11",
    "geomdl>=5.3",
    "mpmath>=1.3",
    "playwright>=1.45",
    *cad,
    "ruff>=0.17,<0.18",
    *bag,
    *display,
    *robots,
]

setup(
    name=package_name,
    version="0.1.0",
    description="Certified minimum distances between moving bodies, and ROS 2 nodes around them",
    author="proximity_monitor maintainers",
    author_email="maintainers@proximity-monitor.dev",
    maintainer="proximity_monitor maintainers",
    maintainer_email="maintainers@proximity-monitor.dev",
    license="Apache-2.0",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={f"{package_name}.scene": ["schema.json", "bundled/**/*"]},
    # pip ignores install_scripts, and a console script called `node` would shadow Node.js in a
    # virtual environment. The launchers are therefore data: both tools put them where
    # `ros2 run` looks for them.
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        (f"share/{package_name}/config", sorted(glob("config/*"))),
        (f"share/{package_name}/rviz", sorted(glob("rviz/*"))),
        (f"share/{package_name}/launch", sorted(glob("launch/*.launch.py"))),
        (f"lib/{package_name}", ["scripts/display", "scripts/node", "scripts/player"]),
    ],
    python_requires=">=3.11",
    install_requires=["numpy>=1.26", "numba>=0.60"],
    extras_require={
        "scene": scene,  # scene files
        "nodes": nodes,  # all that the nodes need where ROS 2 itself comes from the system
        "ros": ros,  # the nodes with ROS 2 from wheels
        "bag": bag,  # motion from ROS 2 bags
        "display": display,  # the page in the browser
        "cad": cad,  # STEP files
        "robots": robots,  # the robots of the bundled scene, and xacro files
        "bench": [*nodes, *peers],  # the engine beside the libraries that people use today
        "docs": docs,  # the site of the documents
        "study": study,  # what accuracy costs, with figures
        "checks": checks,  # the test tools alone, for the same case as `nodes`
        "test": [*ros, *study, *checks],
    },
    entry_points={"console_scripts": ["proximity_monitor = proximity_monitor.__main__:main"]},
    zip_safe=False,
)
