"""`python -m proximity_monitor.display`."""

import sys

from proximity_monitor.display.run import main
from proximity_monitor.ending import leave_with

sys.exit(leave_with(main()))
