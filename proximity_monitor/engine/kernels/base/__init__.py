"""The base of all kernels: compiling, memory, arithmetic, rounding, and the records of a search."""
