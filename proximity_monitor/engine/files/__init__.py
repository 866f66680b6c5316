"""Model files to triangles: a reader for each format, none of which knows the engine.

A reader takes a file's bytes and the folder it lies in, and returns `Triangles` or raises
`FormatError`. No library is asked: those for these formats leave out in silence what they do not
know (polygons, fans, undefined objects) or cannot parse.
"""
