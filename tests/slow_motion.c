/* Slow motion: for whoever loads this, time passes SLOW_MOTION times as slowly as for the world.

   Preloaded (ld.so(8)) into every process of a flight: a machine that is too weak for one in real time
   has so much more processor time for each of its seconds. Clocks are read slower, and what waits waits
   longer; nothing else changes. All processes count from one moment, SLOW_MOTION_SINCE: CLOCK_REALTIME
   and CLOCK_MONOTONIC then [ns]. Clocks of CPU time are slower from their zero on, so that a share of a
   processor is what it was. What the kernel writes by itself (dates of files, /proc, TCP's timers) is in
   the world's time. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <linux/futex.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define S_NS 1000000000LL
#define S_US 1000000LL
#define LONGEST_UP_S 1000000000LL /* No machine has been up for 31 years, and it is later than 2001. */

static double slower = 1.0;
static int64_t since_realtime, since_monotonic; /* [ns] */
static pthread_once_t learnt = PTHREAD_ONCE_INIT;

static void learn(void)
{
    const char *factor = getenv("SLOW_MOTION"), *since = getenv("SLOW_MOTION_SINCE");
    char *rest;

    if (!factor || !since)
        return;
    slower = atof(factor);
    since_realtime = strtoll(since, &rest, 10);
    since_monotonic = strtoll(rest, NULL, 10);
}

static int64_t ns_of(const struct timespec *t) { return t->tv_sec * S_NS + t->tv_nsec; }
static int64_t us_of(const struct timeval *t) { return t->tv_sec * S_US + t->tv_usec; }
static struct timespec timespec_of(int64_t ns) { return (struct timespec){ns / S_NS, ns % S_NS}; }
static struct timeval timeval_of(int64_t us) { return (struct timeval){us / S_US, us % S_US}; }
static int64_t longer(int64_t duration) { return (int64_t)((double)duration * slower); }
static int64_t shorter(int64_t duration) { return (int64_t)((double)duration / slower); }

static int64_t since(clockid_t clock)
{
    switch (clock) {
    case CLOCK_REALTIME:
    case CLOCK_REALTIME_COARSE:
        return since_realtime;
    case CLOCK_MONOTONIC:
    case CLOCK_MONOTONIC_COARSE:
    case CLOCK_MONOTONIC_RAW:
    case CLOCK_BOOTTIME:
        return since_monotonic;
    default: /* CPU time */
        return 0;
    }
}

/* In the world's time: the moment t of a slow clock, and a slow duration. */
static struct timespec moment(clockid_t clock, const struct timespec *t)
{
    return timespec_of(since(clock) + longer(ns_of(t) - since(clock)));
}

static struct timespec duration(const struct timespec *t) { return timespec_of(longer(ns_of(t))); }

static int duration_ms(int ms)
{
    int64_t ms_longer = longer(ms);

    return ms <= 0 ? ms : ms_longer > INT32_MAX ? INT32_MAX : (int)ms_longer;
}

/* Whose clock it is where nobody says. */
static clockid_t clock_of(const struct timespec *t)
{
    return t->tv_sec > LONGEST_UP_S ? CLOCK_REALTIME : CLOCK_MONOTONIC;
}

/* What it is called with here goes on, slower, to `libc`, the function that stands behind this one. */
#define LIBC(type, name, ...)                                        \
    static type (*libc)(__VA_ARGS__);                                \
    if (!libc)                                                       \
        libc = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name);        \
    pthread_once(&learnt, learn)

int clock_gettime(clockid_t clock, struct timespec *t)
{
    LIBC(int, clock_gettime, clockid_t, struct timespec *);
    int failed = libc(clock, t);

    if (!failed)
        *t = timespec_of(since(clock) + shorter(ns_of(t) - since(clock)));
    return failed;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone)
{
    struct timespec now;

    (void)zone;
    clock_gettime(CLOCK_REALTIME, &now);
    *t = timeval_of(ns_of(&now) / (S_NS / S_US));
    return 0;
}

time_t time(time_t *t)
{
    struct timespec now;

    clock_gettime(CLOCK_REALTIME, &now);
    if (t)
        *t = now.tv_sec;
    return now.tv_sec;
}

clock_t clock(void)
{
    struct timespec used;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    return (clock_t)(ns_of(&used) / (S_NS / CLOCKS_PER_SEC));
}

int getrusage(__rusage_who_t who, struct rusage *usage)
{
    LIBC(int, getrusage, __rusage_who_t, struct rusage *);
    int failed = libc(who, usage);

    if (!failed) {
        usage->ru_utime = timeval_of(shorter(us_of(&usage->ru_utime)));
        usage->ru_stime = timeval_of(shorter(us_of(&usage->ru_stime)));
    }
    return failed;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *t, struct timespec *left)
{
    LIBC(int, clock_nanosleep, clockid_t, int, const struct timespec *, struct timespec *);
    int is_moment = flags & TIMER_ABSTIME;
    struct timespec later = is_moment ? moment(clock, t) : duration(t);
    int failed = libc(clock, flags, &later, left);

    if (failed == EINTR && left && !is_moment)
        *left = timespec_of(shorter(ns_of(left)));
    return failed;
}

int nanosleep(const struct timespec *t, struct timespec *left)
{
    int failed = clock_nanosleep(CLOCK_REALTIME, 0, t, left);

    if (failed)
        errno = failed;
    return failed ? -1 : 0;
}

int usleep(useconds_t us)
{
    struct timespec t = timespec_of(us * (S_NS / S_US));

    return nanosleep(&t, NULL);
}

unsigned sleep(unsigned s)
{
    struct timespec t = {s, 0}, left = {0, 0};

    return nanosleep(&t, &left) ? (unsigned)left.tv_sec : 0;
}

int poll(struct pollfd *files, nfds_t count, int ms)
{
    LIBC(int, poll, struct pollfd *, nfds_t, int);
    return libc(files, count, duration_ms(ms));
}

int ppoll(struct pollfd *files, nfds_t count, const struct timespec *t, const sigset_t *mask)
{
    LIBC(int, ppoll, struct pollfd *, nfds_t, const struct timespec *, const sigset_t *);
    struct timespec later = t ? duration(t) : (struct timespec){0, 0};

    return libc(files, count, t ? &later : NULL, mask);
}

int epoll_wait(int file, struct epoll_event *events, int most, int ms)
{
    LIBC(int, epoll_wait, int, struct epoll_event *, int, int);
    return libc(file, events, most, duration_ms(ms));
}

int epoll_pwait(int file, struct epoll_event *events, int most, int ms, const sigset_t *mask)
{
    LIBC(int, epoll_pwait, int, struct epoll_event *, int, int, const sigset_t *);
    return libc(file, events, most, duration_ms(ms), mask);
}

int select(int count, fd_set *restrict in, fd_set *restrict out, fd_set *restrict odd,
           struct timeval *restrict t)
{
    LIBC(int, select, int, fd_set *, fd_set *, fd_set *, struct timeval *);
    struct timeval later = t ? timeval_of(longer(us_of(t))) : (struct timeval){0, 0};
    int ready = libc(count, in, out, odd, t ? &later : NULL);

    if (t) /* Linux says what is left. */
        *t = timeval_of(shorter(us_of(&later)));
    return ready;
}

int pselect(int count, fd_set *restrict in, fd_set *restrict out, fd_set *restrict odd,
            const struct timespec *restrict t, const sigset_t *restrict mask)
{
    LIBC(int, pselect, int, fd_set *, fd_set *, fd_set *, const struct timespec *, const sigset_t *);
    struct timespec later = t ? duration(t) : (struct timespec){0, 0};

    return libc(count, in, out, odd, t ? &later : NULL, mask);
}

/* On x86-64 dlsym would find the oldest version, whose conditions are laid out otherwise. */
int pthread_cond_timedwait(pthread_cond_t *restrict one, pthread_mutex_t *restrict mutex,
                           const struct timespec *restrict t)
{
    static int (*libc)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
    struct timespec later;

    if (!libc)
        libc = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
    if (!libc)
        libc = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    pthread_once(&learnt, learn);
    later = moment(clock_of(t), t);
    return libc(one, mutex, &later);
}

int pthread_cond_clockwait(pthread_cond_t *one, pthread_mutex_t *mutex, clockid_t clock,
                           const struct timespec *t)
{
    LIBC(int, pthread_cond_clockwait, pthread_cond_t *, pthread_mutex_t *, clockid_t,
         const struct timespec *);
    struct timespec later = moment(clock, t);

    return libc(one, mutex, clock, &later);
}

int sem_timedwait(sem_t *restrict one, const struct timespec *restrict t)
{
    LIBC(int, sem_timedwait, sem_t *, const struct timespec *);
    struct timespec later = moment(CLOCK_REALTIME, t);

    return libc(one, &later);
}

int sem_clockwait(sem_t *restrict one, clockid_t clock, const struct timespec *restrict t)
{
    LIBC(int, sem_clockwait, sem_t *, clockid_t, const struct timespec *);
    struct timespec later = moment(clock, t);

    return libc(one, clock, &later);
}

int timerfd_settime(int file, int flags, const struct itimerspec *t, struct itimerspec *before)
{
    LIBC(int, timerfd_settime, int, int, const struct itimerspec *, struct itimerspec *);
    int is_moment = flags & TFD_TIMER_ABSTIME && ns_of(&t->it_value);
    struct itimerspec later = {duration(&t->it_interval), duration(&t->it_value)};

    if (is_moment)
        later.it_value = moment(clock_of(&t->it_value), &t->it_value);
    return libc(file, flags, &later, before);
}

int setitimer(__itimer_which_t which, const struct itimerval *restrict t,
              struct itimerval *restrict before)
{
    LIBC(int, setitimer, __itimer_which_t, const struct itimerval *, struct itimerval *);
    struct itimerval later = {timeval_of(longer(us_of(&t->it_interval))),
                              timeval_of(longer(us_of(&t->it_value)))};

    return libc(which, &later, before);
}

int setsockopt(int file, int level, int name, const void *value, socklen_t size)
{
    LIBC(int, setsockopt, int, int, int, const void *, socklen_t);
    struct timeval later;

    if (level == SOL_SOCKET && (name == SO_RCVTIMEO || name == SO_SNDTIMEO) && size == sizeof later) {
        later = timeval_of(longer(us_of(value)));
        value = &later;
    }
    return libc(file, level, name, value, size);
}

/* Browsers ask the kernel itself. */
long syscall(long number, ...)
{
    LIBC(long, syscall, long, ...);
    const struct timespec *t;
    struct timespec later;
    va_list given;
    long a[6];
    int what, k;

    va_start(given, number);
    for (k = 0; k < 6; k++)
        a[k] = va_arg(given, long);
    va_end(given);
    if (number == SYS_clock_gettime)
        return clock_gettime((clockid_t)a[0], (struct timespec *)a[1]);
    what = (int)a[1] & FUTEX_CMD_MASK;
    t = (const struct timespec *)a[3];
    if (number == SYS_futex && t && (what == FUTEX_WAIT || what == FUTEX_WAIT_BITSET)) {
        if (what == FUTEX_WAIT)
            later = duration(t);
        else
            later = moment(a[1] & FUTEX_CLOCK_REALTIME ? CLOCK_REALTIME : CLOCK_MONOTONIC, t);
        a[3] = (long)&later;
    }
    return libc(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
