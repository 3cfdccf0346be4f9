/* What every file of the compiled core shares: views of arrays, and how an index is checked.

The core is C99 without allocation, without global state and without fast-math: the same input gives the same
bits on every processor. Arrays come from Python as views; `AT` and `CELL` read and write them, and a build
with CHECKED stops the process at the first index outside its array, with the file and the line, and counts.
A constant of the Python modules stands in constants.h under the name of its module and its own. */

#ifndef CORE_H
#define CORE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* A view of an array that is contiguous in memory: rows, and numbers in a row (1 of a plain column). */
#define VIEW(name, type) \
    typedef struct { \
        type *at; \
        int64_t rows, columns; \
    } name
VIEW(Floats, double);
VIEW(Floats32, float);
VIEW(Ints, int64_t);
VIEW(Ints32, int32_t);
VIEW(Bytes, uint8_t);
VIEW(Bools, uint8_t);

#ifdef CHECKED
int64_t core_inside(int64_t index, int64_t count, const char *file, int line);
#define INSIDE(index, count) core_inside((index), (count), __FILE__, __LINE__)
#define COUNT(number, more) ((number) += (more))
#else
#define INSIDE(index, count) (index)
#define COUNT(number, more) ((void)0)
#endif

/* The i-th number of a view, its rows one behind the other; the number in row i and column j. */
#define AT(view, i) ((view).at[INSIDE((int64_t)(i), (view).rows * (view).columns)])
#define CELL(view, i, j) \
    ((view).at[INSIDE((int64_t)(i), (view).rows) * (view).columns + INSIDE((int64_t)(j), (view).columns)])

#define PI 3.14159265358979323846

static inline int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
static inline int64_t most(int64_t a, int64_t b) { return a > b ? a : b; }

/* The lesser and the greater of two numbers, the first where they are equal, as Python's min and max. */
static inline double lesser(double a, double b) { return b < a ? b : a; }
static inline double greater(double a, double b) { return b > a ? b : a; }
static inline double squared(double x) { return x * x; }

#endif
