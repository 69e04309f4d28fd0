"""How much an experiment file, its matrix and its meshes may hold; what a run may hold is in sim/limits.py.

What is beyond is no experiment, but a mistake or an attack: it is told in a line, before time or memory go into it.
"""

# Reading takes some 45 us a value and 2.5 us a line of comment: what is beyond these is refused in less than 2 s.
MOST_VALUES = 20_000  # keys, numbers, texts, lists and groups, aliases written out
LARGEST_FILE = 500_000  # bytes
LONGEST_TEXT = 4096  # characters: as many as a path may have; and Python reads whole numbers of up to 4300 digits
DEEPEST = 50  # groups and lists inside each other: settings need 6, and each level takes some of Python's 1000 calls

MOST_TOLD = 100  # mistakes: nobody reads more at once, and looking for what was meant takes 1 ms each
LONGEST_LINE = 500  # characters of a mistake
LONGEST_NAME, MOST_NAMES = 100, 300  # characters and names among which to look for what was meant: up to 6 ms
MOST_LOOKED_AT = 1_000_000  # values, in search of further mistakes: some 1 us each
MOST_SEARCHED = 10_000  # runs of a matrix, the same: some 0.03 ms each, or 0.1 ms where they have little in common

MOST_PLANNED = 1_000_000  # a plan takes some 2 kB of memory a run

# Reading a mesh takes some 10 times its file in memory; ten million triangles are 500 MB in the plainest format.
LARGEST_MESH = 500_000_000  # bytes
SEEN_FIRST = 4096  # bytes that tell whether it is of its format at all, before the rest is read
LONGEST_HEADER, MOST_PROPERTIES = 20_000, 100  # bytes and properties of a PLY header: each list takes the square of their number
LONGEST_JSON, MOST_NODES = 20_000_000, 1000  # bytes, and nodes, accessors or primitives of a glTF file: up to 1 ms each
MOST_REPEATED = 2_000_000  # corners and vertices that nodes repeat of meshes in the file: 125 B each
