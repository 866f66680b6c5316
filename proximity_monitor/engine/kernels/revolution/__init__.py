"""Solids of revolution: their profiles in the half-plane (rho, z)."""
