"""Many pairs at once: batches, answers carried through motion, schedule, broad phase."""
