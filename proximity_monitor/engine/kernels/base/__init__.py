"""What all kernels rest on: compiling, memory, numbers, rounding."""
