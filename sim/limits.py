"""How much a run may hold. What is beyond is a slip of the pen or an attack, and is told before any memory goes into it."""

# Coordinates and lengths, m: floats are 0.1 mm apart there, and farther out squares and products of lengths overflow.
FARTHEST = 1e12
# A ball takes 56 B at its release and some 300 B in flight: 4 GB.
MOST_BALLS = 10_000_000
# A ball takes 64 B in each recorded frame (place, velocity, work, loss): 64 GB.
MOST_RECORDED = 1_000_000_000  # balls x frames
# Whole numbers up to here are exact as floats, in which time and steps are counted. It would take years.
MOST_STEPS = 2**53
# A triangle takes up to 1 kB while it becomes faces, edges and a tree: 10 GB.
MOST_TRIANGLES = 10_000_000
MOST_CELLS = 4096  # of a heightfield along one side
MOST_EVALUATED = 50_000_000  # operations of an expression x points: 6 ns each, or of numbers too small for all their digits 40
LONGEST_EXPRESSION = 1000  # characters; Python's parser and the stack bear what can nest in them
