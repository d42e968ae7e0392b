/* A real-time loop at 1024 Hz with a virtual actuator in place of the rig: it asks, moves, measures, and sees gain and
 * delay while it runs. Prints a reading once a second, and at the end how long steps took.
 *
 *     gcc -std=c99 -O2 realtime.c -o realtime $(pkg-config --cflags --libs rthstrack) -lm
 *     ./realtime [SECONDS] [--fast]
 *
 * 60 seconds unless told otherwise; --fast does not wait between samples. As root, or with the limits rtprio and
 * memlock raised, it runs under SCHED_FIFO with its memory locked.
 */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sched.h>
#include <time.h>

#include <rthstrack.h>

enum { RATE_HZ = 1024, NS_PER_S = 1000000000, SECONDS_AT_MOST = 86400 };

/* Nanoseconds of every sample, kept until the end. */
typedef struct times {
    const char *what;
    double *ns;
} times;

static double target_m(double t) {
    const double two_pi = 6.283185307179586;
    return 1e-3 * (4.0 * sin(two_pi * 1.1 * t) + 2.0 * sin(two_pi * 2.7 * t + 0.5) + 1.0 * sin(two_pi * 6.3 * t + 1.0)
                   + 0.3 * sin(two_pi * 11.9 * t + 2.0));
}

static double ns_between(struct timespec from, struct timespec to) {
    return (double)(to.tv_sec - from.tv_sec) * NS_PER_S + (double)(to.tv_nsec - from.tv_nsec);
}

static struct timespec now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t;
}

/* The instant of sample i: reckoned from the start, so that rounding does not add up. */
static struct timespec instant(struct timespec start, uint64_t i) {
    uint64_t ns = (uint64_t)start.tv_nsec + i % RATE_HZ * NS_PER_S / RATE_HZ;
    struct timespec t;
    t.tv_sec = start.tv_sec + (time_t)(i / RATE_HZ + ns / NS_PER_S);
    t.tv_nsec = (long)(ns % NS_PER_S);
    return t;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static times times_of(const char *what, size_t n) {
    times made = {what, malloc(n * sizeof(double))};
    if (made.ns == NULL) {
        fprintf(stderr, "realtime: no memory for %zu samples\n", n);
        exit(1);
    }
    /* Written once, so that the loop does not wait for the pages. */
    memset(made.ns, 0, n * sizeof(double));
    return made;
}

static void print_and_free(times t, size_t n) {
    qsort(t.ns, n, sizeof(double), ascending);
    printf("%-14s p50 %8.2f us   p99 %8.2f us   worst %8.2f us\n", t.what, 1e-3 * t.ns[(n - 1) / 2],
           1e-3 * t.ns[(size_t)(0.99 * (double)(n - 1))], 1e-3 * t.ns[n - 1]);
    free(t.ns);
}

static void print_reading(const rthstrack_reading *r) {
    if (!r->valid) {
        printf("%7.3f s   %s\n", r->time_s, rthstrack_reason_text(r->reason));
        return;
    }
    printf("%7.3f s   A %.6f   d %9.5f ms   f_eq %7.4f Hz", r->time_s, r->amplitude, 1e3 * r->delay_s,
           r->equivalent_frequency_hz);
    /* None where gain and delay are not constant over frequency, as this plant's are not. */
    if (r->delay_interval_s[0] <= r->delay_interval_s[1]) {
        printf("   d in %.5f to %.5f ms", 1e3 * r->delay_interval_s[0], 1e3 * r->delay_interval_s[1]);
    }
    putchar('\n');
}

static void become_real_time(void) {
    struct sched_param priority;
    priority.sched_priority = 50;
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        puts("remark: memory is not locked (mlockall); a page fault may hold a step up");
    }
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) {
        puts("remark: not under SCHED_FIFO; other programs may hold a step up");
    }
}

static void check(rthstrack_status status, const char *what, const char *message) {
    if (status != RTHSTRACK_OK) {
        fprintf(stderr, "realtime: %s: %s\n", what, message[0] ? message : rthstrack_status_text(status));
        exit(1);
    }
}

int main(int argc, char **argv) {
    long seconds = 60;
    int fast = 0;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--fast") == 0) {
            fast = 1;
        } else {
            seconds = strtol(argv[i], NULL, 10);
        }
    }
    if (seconds < 1 || seconds > SECONDS_AT_MOST) {
        fprintf(stderr, "usage: realtime [SECONDS] [--fast]   (SECONDS from 1 to %d)\n", SECONDS_AT_MOST);
        return 2;
    }
    if (rthstrack_abi_version() != RTHSTRACK_ABI_VERSION) {
        fprintf(stderr, "realtime: compiled for another rthstrack than the %s found here\n", rthstrack_version());
        return 1;
    }

    char message[256];
    rthstrack_actuator *actuator;
    check(rthstrack_actuator_create(RATE_HZ, &actuator, message, sizeof message), "actuator", message);

    rthstrack_monitor_config config;
    check(rthstrack_monitor_config_default(&config, sizeof config, RTHSTRACK_ABI_VERSION), "settings", "");
    config.rate_hz = RATE_HZ;
    config.window_s = 2.0;
    config.band_low_hz = 0.0;
    config.band_high_hz = 32.0;
    config.estimator = RTHSTRACK_ESTIMATOR_LEAST_SQUARES;
    config.data_decimation = 8;
    rthstrack_monitor *monitor;
    check(rthstrack_monitor_create(&config, &monitor, message, sizeof message), "monitor", message);
    printf("rthstrack %s: readings %g times a second, each speaks for %.3f s before it\n", rthstrack_version(),
           rthstrack_monitor_update_hz(monitor), rthstrack_monitor_age_s(monitor));

    size_t n = (size_t)seconds * RATE_HZ;
    times step = times_of("monitor step", n), cycle = times_of("whole cycle", n), wake = times_of("wake-up late", n);
    size_t missed = 0, overslept = 0;
    rthstrack_reading reading;
    int seen = 0;
    if (!fast) {
        become_real_time();
    }
    fflush(stdout);

    /* The first sample is due in a tenth of a second. */
    struct timespec start = now();
    start.tv_nsec += NS_PER_S / 10;
    for (size_t i = 0; i < n; i++) {
        struct timespec due = instant(start, i);
        if (!fast) {
            while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) != 0) {
                /* A signal woke it. */
            }
        }
        struct timespec awake = now();

        /* Without compensation the target is the command. */
        double target = target_m((double)i / RATE_HZ), measured;
        rthstrack_status moved = rthstrack_actuator_step(actuator, target, &measured, NULL);
        struct timespec before = now();
        size_t n_readings;
        rthstrack_status judged = rthstrack_monitor_step(monitor, &target, &measured, &reading, 1, &n_readings);
        struct timespec after = now();
        seen |= n_readings > 0;
        if (moved != RTHSTRACK_OK || judged != RTHSTRACK_OK) {
            fprintf(stderr, "realtime: %s\n", rthstrack_status_text(moved != RTHSTRACK_OK ? moved : judged));
            return 1;
        }

        step.ns[i] = ns_between(before, after);
        cycle.ns[i] = ns_between(awake, after);
        wake.ns[i] = fast ? 0.0 : ns_between(due, awake);
        if (!fast) {
            struct timespec end = instant(start, i + 1);
            missed += ns_between(end, after) > 0.0;
            overslept += ns_between(end, awake) > 0.0;
        }
        /* Printing may wait for the terminal: a laboratory's program leaves it to another thread. */
        if ((i + 1) % RATE_HZ == 0 && seen) {
            print_reading(&reading);
        }
    }

    print_and_free(step, n);
    print_and_free(cycle, n);
    print_and_free(wake, n);
    printf("missed deadlines: %zu of %zu, %zu of them because the machine woke the loop too late\n", missed, n,
           overslept);
    rthstrack_monitor_destroy(monitor);
    rthstrack_actuator_destroy(actuator);
    return 0;
}
