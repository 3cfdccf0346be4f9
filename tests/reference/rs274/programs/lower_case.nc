g21
g0 x1 y-2 z3
g1 x3 f100
g2 x5 i1
m2
