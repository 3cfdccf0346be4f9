/* Settings, waits and triggers by their numbers; anything else is another statement. */

#include "krl/statement.h"

#include <string.h>

/* Return the place behind the words of $VEL.CP, $APO.CDIS and WAIT SEC, else NULL. */
static Place setting(Place begin, Place end, int *kind) {
    *kind = W_KIND_VEL_CP;
    if (STANDS(begin, end, W_VEL_CP))
        return begin + sizeof(W_VEL_CP) - 1;
    *kind = W_KIND_APO_CDIS;
    if (STANDS(begin, end, W_APO_CDIS))
        return begin + sizeof(W_APO_CDIS) - 1;
    *kind = W_KIND_WAIT_SEC;
    if (!STANDS(begin, end, W_WAIT))
        return NULL;
    const Place behind = begin + sizeof(W_WAIT) - 1, second = blank(behind, end);
    return second > behind && STANDS(second, end, W_SEC) ? second + sizeof(W_SEC) - 1 : NULL;
}

/* Read what a setting is set to into value; return its blending: 1 for a dwell, W_MALFORMED, else 0. */
static int set_to(Place at, Place end, int kind, double *value) {
    bool sound = true;
    at = blank(at, end);
    if (kind != W_KIND_WAIT_SEC) {
        sound = is(at, end, '=');
        at = blank_behind(at, end);
    }
    at = number_at(at, end, &SLOT(value, 0));
    if (!sound || at == NULL || !ends_here(at, end))
        return W_MALFORMED;
    return kind == W_KIND_WAIT_SEC && at < end && STANDS(blank_behind(at, end), end, W_DWELL);
}

/* Return the place behind a word and the blanks after it, NULL where it does not stand there. */
static Place behind(Place at, Place end, const char *word) {
    const int length = (int)strlen(word);
    return at != NULL && stands(at, end, word, length) ? blank(at + length, end) : NULL;
}

/* Read the name that is assigned to or called; return the place of the `=` or `(`, NULL without one. */
static Place written_name(Place at, Place end, Place text, double *value) {
    const Place first = at;
    if (at == NULL)
        return NULL;
    while (at < end && HERE(at, end) != '=' && HERE(at, end) != '(' && !ends_here(at, end))
        at++;
    Place last = at;
    while (last > first && is_blank(HERE(last - 1, end)))
        last--;
    SLOT(value, W_TRIGGER_NAME) = (double)(first - text);
    SLOT(value, W_TRIGGER_NAME + 1) = (double)(last - first);
    return ends_here(at, end) || last == first ? NULL : at;
}

/* Read the numbers of a call from its `(` on; return the place behind `)`, NULL where it is another. */
static Place arguments(Place at, Place end, double *value) {
    for (int k = 0; k < W_TRIGGER_NUMBERS; k++) {
        const uint8_t separator = k < W_TRIGGER_NUMBERS - 1 ? ',' : ')';
        at = number_at(blank_behind(at, end), end, &SLOT(value, W_TRIGGER_WRITTEN + k));
        if (at == NULL || !is(at, end, separator))
            return NULL;
    }
    return blank_behind(at, end);
}

/* Read `TRIGGER WHEN DISTANCE=0 DELAY=7 DO …` into value; return what it does, 0 for anything else. */
static int trigger(Place at, Place end, Place text, double *value) {
    at = behind(behind(behind(behind(at, end, W_TRIGGER), end, W_WHEN), end, W_DISTANCE), end, "=");
    at = number_at(at, end, &SLOT(value, W_TRIGGER_DISTANCE));
    at = number_at(behind(behind(at, end, W_DELAY), end, "="), end, &SLOT(value, W_TRIGGER_DELAY));
    at = written_name(behind(at, end, W_DO), end, text, value);
    if (at == NULL)
        return 0;
    const bool calls = HERE(at, end) == '(';
    if (calls) {
        double prio;
        at = behind(behind(arguments(at, end, value), end, W_PRIO), end, "=");
        at = number_at(at, end, &prio);
        if (at == NULL || prio != W_PRIO_BY_CONTROLLER)
            return 0;
    } else
        at = number_at(blank_behind(at, end), end, &SLOT(value, W_TRIGGER_WRITTEN));
    if (at == NULL || !ends_here(at, end))
        return 0;
    return calls ? W_CALLS : W_ASSIGNS;
}

Statement other_statement(Place begin, Place end, Place text, double *value) {
    Statement read;
    const Place behind_words = setting(begin, end, &read.kind);
    if (behind_words != NULL)
        read.blend = set_to(behind_words, end, read.kind, value);
    else {
        read.blend = trigger(begin, end, text, value);
        read.kind = read.blend > 0 ? W_KIND_TRIGGER : W_KIND_OTHER;
    }
    return read;
}
