/* Long columns of numpy in temporary files instead of memory, by numpy's allocation handlers (NEP 49).

An array of at least so many bytes is a shared mapping of a file that has no name any more: it vanishes with the
array, whatever ends the process. Its pages may be let go at any time and come back from the file. The space is
reserved first; where the disk has none, and for all shorter arrays, memory is taken as usual. This is the one
file of the core with state: the list of the mappings. */

#if defined(__linux__)
#define _GNU_SOURCE
#elif defined(__APPLE__)
#define _DARWIN_C_SOURCE
#endif

#include "core.h"

#include <stdlib.h>
#include <string.h>

#if defined(__linux__) || defined(__APPLE__)
#define HAS_MAPPINGS
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

/* As numpy declares them. */
typedef struct {
    void *context;
    void *(*malloc)(void *context, size_t size);
    void *(*calloc)(void *context, size_t count, size_t size);
    void *(*realloc)(void *context, void *at, size_t size);
    void (*free)(void *context, void *at, size_t size);
} Allocator;

typedef struct {
    char name[127];
    uint8_t version;
    Allocator allocator;
} Handler;

#ifdef HAS_MAPPINGS

enum { MOST_MAPPINGS = 4096, LONGEST_PATH = 4096 };

static struct {
    pthread_mutex_t lock;
    char folder[LONGEST_PATH];
    size_t least_bytes;
    int count;
    struct {
        void *at;
        size_t size;
    } mapping[MOST_MAPPINGS];
} state = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* Return a file without a name in the folder, -1 where there can be none. */
static int nameless(void) {
#ifdef O_TMPFILE
    const int at_once = open(state.folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (at_once >= 0)
        return at_once;
#endif
    char path[LONGEST_PATH + 32];
    snprintf(path, sizeof path, "%s/gcode2krl-XXXXXX", state.folder);
    const int file = mkstemp(path);
    if (file >= 0)
        unlink(path);
    return file;
}

/* Take room on the disk, so that no page is without when it is written to. */
static bool has_room(int file, size_t size) {
#if defined(__APPLE__)
    fstore_t room = {F_ALLOCATEALL, F_PEOFPOSMODE, 0, (off_t)size, 0};
    return fcntl(file, F_PREALLOCATE, &room) != -1 && ftruncate(file, (off_t)size) == 0;
#else
    return posix_fallocate(file, 0, (off_t)size) == 0;
#endif
}

static void *in_file(size_t size) {
    const int file = nameless();
    if (file < 0)
        return NULL;
    void *at = MAP_FAILED;
    if (has_room(file, size))
        at = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (at == MAP_FAILED)
        return NULL;
    pthread_mutex_lock(&state.lock);
    const bool noted = state.count < MOST_MAPPINGS;
    if (noted) {
        state.mapping[state.count].at = at;
        state.mapping[state.count].size = size;
        state.count++;
    }
    pthread_mutex_unlock(&state.lock);
    if (noted)
        return at;
    munmap(at, size);
    return NULL;
}

static int number_of(const void *at) {
    for (int k = state.count - 1; k >= 0; k--)
        if (state.mapping[k].at == at)
            return k;
    return -1;
}

/* Return the size of a mapping, 0 where an address is none. */
static size_t size_of(const void *at) {
    pthread_mutex_lock(&state.lock);
    const int k = number_of(at);
    const size_t size = k < 0 ? 0 : state.mapping[k].size;
    pthread_mutex_unlock(&state.lock);
    return size;
}

/* Unmap what begins at an address; tell whether it was a mapping. */
static bool unmapped(void *at) {
    pthread_mutex_lock(&state.lock);
    const int k = number_of(at);
    if (k >= 0) {
        munmap(at, state.mapping[k].size);
        state.mapping[k] = state.mapping[--state.count];
    }
    pthread_mutex_unlock(&state.lock);
    return k >= 0;
}

static void *taken(void *context, size_t size) {
    (void)context;
    void *at = size >= state.least_bytes ? in_file(size) : NULL;
    return at ? at : malloc(size);
}

static void *taken_empty(void *context, size_t count, size_t size) {
    (void)context;
    void *at = size && count >= state.least_bytes / size && count <= SIZE_MAX / size ? in_file(count * size) : NULL;
    return at ? at : calloc(count, size); /* a new file is zero too */
}

static void given_back(void *context, void *at, size_t size) {
    (void)context;
    (void)size;
    /* what malloc returns does not begin a page where it is long, and is no mapping where it does */
    if (((uintptr_t)at & 0xFFF) || !unmapped(at))
        free(at);
}

static void *changed(void *context, void *at, size_t size) {
    const size_t before = at ? size_of(at) : 0;
    if (!before)
        return realloc(at, size);
    void *other = taken(context, size);
    if (other) {
        memcpy(other, at, before < size ? before : size);
        given_back(context, at, before);
    }
    return other;
}

static Handler handler = {"gcode2krl_long_columns", 1, {NULL, taken, taken_empty, changed, given_back}};

/* Return the handler for columns of at least so many bytes in files of a folder. */
EXPORT void *long_columns_handler(const char *folder, int64_t least_bytes) {
    if (strlen(folder) >= LONGEST_PATH)
        return NULL;
    strcpy(state.folder, folder);
    state.least_bytes = (size_t)least_bytes;
    return &handler;
}

/* Let go of all pages of all mappings; they come back where they are looked at. */
EXPORT void long_columns_let_go(void) {
    pthread_mutex_lock(&state.lock);
    for (int k = 0; k < state.count; k++)
        madvise(state.mapping[k].at, state.mapping[k].size, MADV_DONTNEED);
    pthread_mutex_unlock(&state.lock);
}

/* Return how many columns lie in files now. */
EXPORT int64_t long_columns_count(void) {
    pthread_mutex_lock(&state.lock);
    const int64_t count = state.count;
    pthread_mutex_unlock(&state.lock);
    return count;
}

#else /* there the columns stay in memory */

EXPORT void *long_columns_handler(const char *folder, int64_t least_bytes) {
    (void)folder;
    (void)least_bytes;
    return NULL;
}

EXPORT void long_columns_let_go(void) {}

EXPORT int64_t long_columns_count(void) { return 0; }

#endif
