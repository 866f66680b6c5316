"""Many pairs at once: schedule, answers carried through motion, broad phase."""
