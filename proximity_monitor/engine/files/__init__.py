"""Model files to models: a reader for each format.

Those of triangles do not know the engine: they take a file's bytes and the folder it lies in, and
return `Triangles` or raise `FormatError`. No library is asked: those for these formats leave out in
silence what they do not know (polygons, fans, undefined objects) or cannot parse.
"""
