/* Preloaded, it makes a process see what one sees that has more rights than who started it (set-user-ID,
 * capabilities). */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/auxv.h>

char *secure_getenv(const char *name) {
    (void)name;
    return NULL;
}

unsigned long getauxval(unsigned long type) {
    unsigned long (*real)(unsigned long);
    *(void **)&real = dlsym(RTLD_NEXT, "getauxval");
    return type == AT_SECURE ? 1 : real(type);
}
