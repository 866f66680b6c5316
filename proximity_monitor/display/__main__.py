"""`python -m proximity_monitor.display`."""

import sys

from proximity_monitor.display.run import main

sys.exit(main())
