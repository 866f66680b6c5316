"""How long tests wait for other processes. A test that reaches a deadline has found a defect."""

DEADLINE_S = 60.0
"""Far more than the 20 s after which Fast DDS forgets a killed peer."""

POSE_TIMEOUT_S = 10.0
"""When a pose is stale, in tests of other things: no busy machine stands still for so long."""

START_DEADLINE_S = 600.0
"""The first start on a machine compiles the kernels."""
