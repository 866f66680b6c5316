"""Many pairs at once: assemblies, batches, answers kept through motion, schedule, broad phase."""
