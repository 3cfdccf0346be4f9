/* What the loader asks the core: which sources it was built from, and for which processors. */

#include "core.h"

#include <stdio.h>
#include <stdlib.h>

EXPORT const char *core_sources(void) { return CORE_SOURCES; }

/* Tell whether this processor has the instructions of the faster build: x86-64-v3, AVX2 among them. */
EXPORT int32_t core_is_wide(void) {
#if defined(__x86_64__) || defined(_M_X64)
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma");
#else
    return 0;
#endif
}

#ifdef CHECKED
int64_t core_inside(int64_t index, int64_t count, const char *file, int line) {
    if (index < 0 || index >= count) {
        fprintf(stderr, "%s:%d: index %lld outside 0 to %lld\n", file, line, (long long)index, (long long)count - 1);
        fflush(stderr);
        abort();
    }
    return index;
}
#endif
