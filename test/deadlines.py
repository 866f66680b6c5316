"""How long tests wait for what another process does. Whoever comes to these has found a defect."""

DEADLINE_S = 60.0
"""Fast DDS forgets a killed peer after 20 s."""

POSE_TIMEOUT_S = 10.0
"""When a pose is stale, where that is not what is tested: no busy machine stands still so long."""

START_DEADLINE_S = 600.0
"""The first start on a machine compiles the kernels."""
