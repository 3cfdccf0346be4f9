/* A triangle mesh with its tree of boxes; collision/scene.py makes it. */

#ifndef COLLISION_TREE_H
#define COLLISION_TREE_H

#include "collision/shapes.h"

typedef struct {
    Floats triangles; /* (t, 9) corners of the triangles of all meshes */
    Floats boxes;     /* (m, 6) low and high corners of the nodes of all trees */
    int64_t triangle, count; /* the first triangle of this mesh, and how many */
    int64_t box, levels;     /* the root of this tree, and the levels below it */
} Tree;

/* Return the distance of a segment from the surface; `nearest` is a triangle of the mesh to begin with, and
   becomes the nearest one. */
double tree_distance(const Tree *tree, const double *segment, int64_t *nearest, double *place);

/* Tell whether a point lies inside the surface. */
bool tree_holds(const Tree *tree, const double *point);

#endif
