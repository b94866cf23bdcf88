// Delays what threads other than the first broadcast: preload it to widen races with them.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

static void delay(void) {
    if (syscall(SYS_gettid) != getpid()) usleep(500);
}

int pthread_cond_broadcast(pthread_cond_t *condition) {
    static int (*next)(pthread_cond_t *);
    if (!next) next = dlsym(RTLD_NEXT, "pthread_cond_broadcast");
    delay();
    return next(condition);
}

int cnd_broadcast(void *condition) {
    static int (*next)(void *);
    if (!next) next = dlsym(RTLD_NEXT, "cnd_broadcast");
    delay();
    return next(condition);
}
