/* A statement of KRL by its numbers. */

#ifndef KRL_STATEMENT_H
#define KRL_STATEMENT_H

#include "krl/letters.h"

/* The k-th number of a statement. */
#define SLOT(value, k) ((value)[INSIDE(k, W_STATEMENT_COLUMNS)])

typedef struct {
    int kind, blend;
} Statement;

/* Read a statement that is no motion into value. */
Statement other_statement(Place begin, Place end, Place text, double *value);

#endif
