/* What benchmarks/online_load.py sends. Ends by itself.
 *
 *   online_load samples PORT SECONDS RATE ACTUATORS    counter, target_1, measured_1, ... as doubles, each at its time
 *   online_load garbage PORT SECONDS RATE ACTUATORS    what is no sample, in a burst every millisecond
 *
 * Prints one line: datagrams sent, datagrams the system did not take, worst lateness in microseconds. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static long long now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void wait_until(long long ns) {
    struct timespec t = {ns / 1000000000LL, ns % 1000000000LL};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0) {
    }
}

static double wave(double t, int actuator) { return sin(9.0 * t) + 0.3 * sin(23.0 * t + actuator); }

/* Sixteen kinds: of any length but that of samples, and of that length with a counter that counts nothing. */
static size_t garbage(unsigned char *bytes, long long i, size_t sample_bytes) {
    const double counters[] = {NAN, -1.0, 0.5, INFINITY};
    size_t length = (size_t)(i * 37 % 1400);
    for (size_t k = 0; k < length; k++) bytes[k] = (unsigned char)(i * 31 + (long long)k * 7);
    if (i % 16 < 4) {
        memcpy(bytes, &counters[i % 4], sizeof(double));
        return sample_bytes;
    }
    return length % sample_bytes == 0 ? length + 1 : length;
}

int main(int n, char **arguments) {
    if (n != 6) return 2;
    const int is_garbage = strcmp(arguments[1], "garbage") == 0;
    const int port = atoi(arguments[2]), actuators = atoi(arguments[5]);
    const double seconds = atof(arguments[3]), rate = atof(arguments[4]);
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((unsigned short)port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (s < 0 || actuators < 1 || actuators > 256 || connect(s, (struct sockaddr *)&to, sizeof to) != 0) return 1;
    static double sample[1 + 2 * 256];
    static unsigned char bytes[8192];
    const size_t sample_bytes = (1 + 2 * (size_t)actuators) * sizeof(double);
    const long long total = (long long)(seconds * rate), begin = now_ns();
    long long sent = 0, refused = 0, worst = 0;
    for (long long i = 0; i < total; i++) {
        const double t = (double)i / rate;
        long long due = begin + (long long)(1e9 * t);
        size_t length = sample_bytes;
        const void *content = sample;
        if (is_garbage) {
            due = begin + (long long)(1e3 * t) * 1000000LL;
            length = garbage(bytes, i, sample_bytes);
            content = bytes;
        } else {
            sample[0] = (double)i;
            for (int a = 0; a < actuators; a++) {
                sample[1 + 2 * a] = wave(t, a);
                sample[2 + 2 * a] = 0.95 * wave(t - 0.012, a);
            }
        }
        if (now_ns() < due) wait_until(due);
        if (send(s, content, length, 0) == (ssize_t)length) sent++;
        else refused++;
        const long long late = now_ns() - due;
        if (late > worst) worst = late;
    }
    printf("%lld %lld %lld\n", sent, refused, worst / 1000);
    close(s);
    return 0;
}
