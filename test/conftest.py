"""How all property tests run: the same examples each time, however busy the machine is.

`pytest --hypothesis-profile=search` draws new examples instead.
"""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("search", deadline=None, print_blob=True)
settings.register_profile("repeatable", settings.get_profile("search"), derandomize=True)
settings.load_profile("repeatable")
