"""What can be asked about: meshes, what they enclose, their hierarchies."""
