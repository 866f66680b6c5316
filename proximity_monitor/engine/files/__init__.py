"""Readers that turn model files into models, one for each format.

The readers of triangle formats do not depend on the engine: they take a file's bytes and its
folder, and return `Triangles` or raise `FormatError`. They use no library, because libraries for
these formats silently skip what they do not support (polygons, fans, undefined objects) or cannot
parse.
"""
