/* The C interface as a C program meets it. Built and run by tests/c.rs: as it is, under valgrind, and with
 * the heap counted. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <rthstrack.h>

static int failures = 0;

#define CHECK(condition)                                                           \
    do {                                                                           \
        if (!(condition)) {                                                        \
            printf("%s:%d: not so: %s\n", __FILE__, __LINE__, #condition);         \
            failures++;                                                            \
        }                                                                          \
    } while (0)

/* With the linker's --wrap every request for memory passes here, the library's too if it is linked statically. */
#ifdef COUNT_HEAP
static size_t heap_calls = 0;
void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *old, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
int __real_posix_memalign(void **out, size_t alignment, size_t size);
void __real_free(void *old);
void *__wrap_malloc(size_t size) { heap_calls++; return __real_malloc(size); }
void *__wrap_calloc(size_t n, size_t size) { heap_calls++; return __real_calloc(n, size); }
void *__wrap_realloc(void *old, size_t size) { heap_calls++; return __real_realloc(old, size); }
void *__wrap_aligned_alloc(size_t alignment, size_t size) {
    heap_calls++;
    return __real_aligned_alloc(alignment, size);
}
int __wrap_posix_memalign(void **out, size_t alignment, size_t size) {
    heap_calls++;
    return __real_posix_memalign(out, alignment, size);
}
void __wrap_free(void *old) { heap_calls++; __real_free(old); }
#else
static const size_t heap_calls = 0;
#endif

/* Readings and samples of most tests. */
enum { ROOM = 64, N_SAMPLES = 600 };

static char message[256];

static double motion(double t) { return sin(9.0 * t) + 0.3 * sin(23.0 * t) + 0.2 * cos(41.0 * t); }

/* 128 samples a second, windows of a second, P = 1: a reading every 8 samples from the 128th on. */
static rthstrack_monitor_config small(void) {
    rthstrack_monitor_config config;
    CHECK(rthstrack_monitor_config_default(&config, sizeof config, RTHSTRACK_ABI_VERSION) == RTHSTRACK_OK);
    config.rate_hz = 128.0;
    config.window_s = 1.0;
    config.update_hz = 16.0;
    config.estimator = RTHSTRACK_ESTIMATOR_LEAST_SQUARES;
    return config;
}

static rthstrack_monitor *create(rthstrack_monitor_config config) {
    rthstrack_monitor *monitor = NULL;
    rthstrack_status status = rthstrack_monitor_create(&config, &monitor, message, sizeof message);
    if (status != RTHSTRACK_OK) {
        printf("create: %s\n", message);
        exit(1);
    }
    CHECK(monitor != NULL && message[0] == 0);
    return monitor;
}

/* Measured comes 20 ms later and 5 % too small; the actuators start a second apart. */
static void signals(double *target, double *measured, size_t n_samples, size_t n_actuators) {
    for (size_t i = 0; i < n_samples; i++) {
        for (size_t a = 0; a < n_actuators; a++) {
            double t = (double)i / 128.0 + (double)a;
            target[i * n_actuators + a] = motion(t);
            measured[i * n_actuators + a] = 0.95 * motion(t - 0.020);
        }
    }
}

/* All readings of n samples, step by step. */
static size_t stepped(rthstrack_monitor *monitor, const double *target, const double *measured, size_t n_samples,
                      rthstrack_reading *readings, size_t capacity) {
    size_t n = rthstrack_monitor_n_actuators(monitor), written = 0, n_readings;
    for (size_t i = 0; i < n_samples; i++) {
        CHECK(rthstrack_monitor_step(monitor, target + i * n, measured + i * n, readings + written, capacity - written,
                                     &n_readings) == RTHSTRACK_OK);
        written += n_readings;
    }
    return written;
}

static void versions_fit(void) {
    CHECK(rthstrack_abi_version() == RTHSTRACK_ABI_VERSION);
    CHECK(strchr(rthstrack_version(), '.') != NULL);
}

static void every_number_has_a_text(void) {
    for (int32_t i = -3; i < 300; i++) {
        CHECK(strlen(rthstrack_status_text(i)) > 3);
        CHECK(strlen(rthstrack_reason_text(i)) > 3);
    }
    CHECK(strcmp(rthstrack_status_text(RTHSTRACK_OK), "done") == 0);
    CHECK(strcmp(rthstrack_status_text(-1), "unknown status") == 0);
    CHECK(strcmp(rthstrack_reason_text(-1), "unknown reason") == 0);
    CHECK(strstr(rthstrack_reason_text(RTHSTRACK_REASON_NOT_FINITE), "NaN") != NULL);
}

static void null_pointers_are_refused(void) {
    rthstrack_monitor_config config = small();
    rthstrack_monitor *monitor = NULL;
    CHECK(rthstrack_monitor_config_default(NULL, sizeof config, RTHSTRACK_ABI_VERSION) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_create(&config, NULL, message, sizeof message) == RTHSTRACK_BAD_POINTER);
    CHECK(strstr(message, "monitor") != NULL);
    monitor = (rthstrack_monitor *)&config;
    CHECK(rthstrack_monitor_create(NULL, &monitor, message, sizeof message) == RTHSTRACK_BAD_POINTER);
    CHECK(strstr(message, "config") != NULL && monitor == NULL);
    CHECK(rthstrack_monitor_create(NULL, &monitor, NULL, 7) == RTHSTRACK_BAD_POINTER);

    double x = 1.0;
    rthstrack_reading reading;
    size_t n_readings = 9, n_taken = 9;
    CHECK(rthstrack_monitor_step(NULL, &x, &x, &reading, 1, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(NULL, &x, &x, 1, &reading, 1, &n_taken, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_restart(NULL, 0) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_n_actuators(NULL) == 0);
    CHECK(rthstrack_monitor_samples_until_reading(NULL) == 0);
    CHECK(rthstrack_monitor_readings_in(NULL, 1000) == 0);
    CHECK(isnan(rthstrack_monitor_latency_s(NULL)) && isnan(rthstrack_monitor_update_hz(NULL)));
    CHECK(isnan(rthstrack_monitor_age_s(NULL)));
    rthstrack_monitor_destroy(NULL);

    monitor = create(config);
    CHECK(rthstrack_monitor_step(monitor, NULL, &x, &reading, 1, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_step(monitor, &x, NULL, &reading, 1, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_step(monitor, &x, &x, NULL, 1, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_step(monitor, &x, &x, &reading, 1, NULL) == RTHSTRACK_BAD_POINTER);
    const double *odd = (const double *)(const void *)((const char *)&x + 1);
    CHECK(rthstrack_monitor_step(monitor, odd, &x, &reading, 1, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(monitor, NULL, &x, 1, &reading, 1, &n_taken, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(monitor, &x, NULL, 1, &reading, 1, &n_taken, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(monitor, &x, &x, 1, NULL, 1, &n_taken, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(monitor, &x, &x, 1, &reading, 1, NULL, &n_readings) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_process(monitor, &x, &x, 1, &reading, 1, &n_taken, NULL) == RTHSTRACK_BAD_POINTER);
    CHECK(rthstrack_monitor_samples_until_reading(monitor) == 128);
    CHECK(rthstrack_monitor_process(monitor, NULL, NULL, 0, NULL, 0, &n_taken, &n_readings) == RTHSTRACK_OK);
    CHECK(n_taken == 0 && n_readings == 0);
    CHECK(rthstrack_monitor_process(monitor, &x, &x, 1, NULL, 0, &n_taken, &n_readings) == RTHSTRACK_OK);
    CHECK(n_taken == 1 && n_readings == 0);
    rthstrack_monitor_destroy(monitor);

    CHECK(rthstrack_actuator_create(1024.0, NULL, message, sizeof message) == RTHSTRACK_BAD_POINTER);
    CHECK(strstr(message, "actuator") != NULL);
    CHECK(rthstrack_actuator_step(NULL, 0.0, &x, &x) == RTHSTRACK_BAD_POINTER);
    rthstrack_actuator_destroy(NULL);
}

static void another_interface_is_refused(void) {
    rthstrack_monitor_config config, before;
    memset(&config, 0x5a, sizeof config);
    before = config;
    const size_t size = sizeof config;
    CHECK(rthstrack_monitor_config_default(&config, size - 4, RTHSTRACK_ABI_VERSION) == RTHSTRACK_ABI_MISMATCH);
    CHECK(rthstrack_monitor_config_default(&config, size, RTHSTRACK_ABI_VERSION + 1) == RTHSTRACK_ABI_MISMATCH);
    CHECK(memcmp(&config, &before, sizeof config) == 0);
    rthstrack_monitor *monitor = (rthstrack_monitor *)&config;
    CHECK(rthstrack_monitor_create(&config, &monitor, message, sizeof message) == RTHSTRACK_ABI_MISMATCH);
    CHECK(monitor == NULL && strstr(message, "rthstrack_monitor_config_default") != NULL);
    config = small();
    config.abi_version++;
    CHECK(rthstrack_monitor_create(&config, &monitor, message, sizeof message) == RTHSTRACK_ABI_MISMATCH);
    config = small();
    config.size = 8;
    CHECK(rthstrack_monitor_create(&config, &monitor, message, sizeof message) == RTHSTRACK_ABI_MISMATCH);
    /* Of settings of another size nothing is read but their first two numbers. */
    uint32_t *first = malloc(2 * sizeof *first);
    CHECK(first != NULL);
    first[0] = 8;
    first[1] = RTHSTRACK_ABI_VERSION + 1;
    CHECK(rthstrack_monitor_create((const rthstrack_monitor_config *)(const void *)first, &monitor, message,
                                   sizeof message) == RTHSTRACK_ABI_MISMATCH);
    free(first);
}

static void refused(rthstrack_monitor_config config, const char *named) {
    rthstrack_monitor *monitor = (rthstrack_monitor *)&config;
    rthstrack_status status = rthstrack_monitor_create(&config, &monitor, message, sizeof message);
    if (status != RTHSTRACK_BAD_SETTING || monitor != NULL || strstr(message, named) == NULL
        || strchr(message, '\n') != NULL) {
        printf("a bad %s: status %d, \"%s\"\n", named, (int)status, message);
        failures++;
    }
}

static void bad_settings_are_refused_in_one_line_that_names_them(void) {
    rthstrack_monitor_config c;
#define BAD(field, value) (c = small(), c.field = (value), refused(c, #field))
    BAD(rate_hz, NAN);
    BAD(rate_hz, 0.0);
    BAD(window_s, 0.0);
    BAD(window_s, INFINITY);
    BAD(window_s, NAN);
    BAD(update_hz, NAN);
    BAD(update_hz, 129.0);
    BAD(max_delay_s, -1.0);
    BAD(expected_delay_s, INFINITY);
    BAD(minimum_amplitude, -1.0);
    BAD(window, 6);
    BAD(detrend, -2);
    BAD(estimator, 3);
    BAD(n_actuators, 0);
    BAD(data_decimation, 3);
    BAD(data_decimation, 0);
    BAD(data_decimation, 1u << 31);
    BAD(frequency_decimation, 3);
    c = small();
    c.band_low_hz = 5.0;
    refused(c, "band_hz");
    c = small();
    c.band_low_hz = 5.0;
    c.band_high_hz = 2.0;
    refused(c, "band_hz");

    c = small();
    c.estimator = 7;
    rthstrack_monitor *monitor;
    CHECK(rthstrack_monitor_create(&c, &monitor, message, sizeof message) == RTHSTRACK_BAD_SETTING);
    CHECK(strcmp(message, "estimator must be a RTHSTRACK_ESTIMATOR_..., 0 to 2, not 7") == 0);
    /* The line is cut where the room ends. */
    memset(message, '#', sizeof message);
    CHECK(rthstrack_monitor_create(&c, &monitor, message, 10) == RTHSTRACK_BAD_SETTING);
    CHECK(strcmp(message, "estimator") == 0 && message[10] == '#');
    CHECK(rthstrack_monitor_create(&c, &monitor, message, 0) == RTHSTRACK_BAD_SETTING);
    CHECK(strcmp(message, "estimator") == 0);
    CHECK(rthstrack_monitor_create(&c, &monitor, NULL, 0) == RTHSTRACK_BAD_SETTING);
}

static void gain_and_delay_are_those_of_the_signals(void) {
    static double target[N_SAMPLES], measured[N_SAMPLES];
    static rthstrack_reading readings[ROOM];
    signals(target, measured, N_SAMPLES, 1);
    rthstrack_monitor *monitor = create(small());
    CHECK(rthstrack_monitor_n_actuators(monitor) == 1 && rthstrack_monitor_update_hz(monitor) == 16.0);
    CHECK(rthstrack_monitor_latency_s(monitor) == 0.0);
    CHECK(rthstrack_monitor_age_s(monitor) == 0.5 * 127.0 / 128.0);
    CHECK(rthstrack_monitor_samples_until_reading(monitor) == 128);
    CHECK(rthstrack_monitor_readings_in(monitor, 127) == 0 && rthstrack_monitor_readings_in(monitor, 136) == 2);
    size_t n = stepped(monitor, target, measured, N_SAMPLES, readings, ROOM);
    CHECK(n == (N_SAMPLES - 128) / 8 + 1);
    for (size_t i = 0; i < n; i++) {
        const rthstrack_reading *r = &readings[i];
        CHECK(r->valid == 1 && r->actuator == 0 && r->index == 127 + 8 * i);
        CHECK(r->time_s == (double)r->index / 128.0 && r->centre_s == r->time_s - 0.5 * 127.0 / 128.0);
        /* The first windows have no samples before them; between the samples motion is read by a polynomial. */
        CHECK(fabs(r->amplitude - 0.95) < 1e-3 && fabs(r->delay_s - 0.020) < 1e-4);
        CHECK(fabs(r->phase_rad + 6.283185307179586 * r->equivalent_frequency_hz * r->delay_s) < 1e-12);
    }
    rthstrack_monitor_destroy(monitor);
}

static void blocks_give_the_bits_of_steps(void) {
    enum { N = 3, ALL = ROOM * N };
    static double target[N_SAMPLES * N], measured[N_SAMPLES * N];
    static rthstrack_reading by_steps[ALL], by_blocks[ALL];
    signals(target, measured, N_SAMPLES, N);
    rthstrack_monitor_config config = small();
    config.n_actuators = N;
    config.data_decimation = 2;
    rthstrack_monitor *one = create(config), *other = create(config);
    size_t n = stepped(one, target, measured, N_SAMPLES, by_steps, ALL);
    CHECK(n > 3 * N);
    size_t done = 0, written = 0;
    for (size_t length = 1; done < N_SAMPLES; length = length * 7 % 61) {
        size_t block = length < N_SAMPLES - done ? length : N_SAMPLES - done, n_taken, n_readings;
        size_t due = rthstrack_monitor_readings_in(other, block);
        CHECK(rthstrack_monitor_process(other, target + done * N, measured + done * N, block, by_blocks + written,
                                        ALL - written, &n_taken, &n_readings) == RTHSTRACK_OK);
        CHECK(n_taken == block && n_readings == due);
        done += n_taken;
        written += n_readings;
    }
    CHECK(written == n && memcmp(by_steps, by_blocks, n * sizeof by_steps[0]) == 0);
    for (size_t i = 0; i < n; i++) {
        CHECK(by_steps[i].actuator == i % N && by_steps[i].valid);
    }

    /* Room for one window's readings at a time, or for one reading more. */
    CHECK(rthstrack_monitor_restart(other, 0) == RTHSTRACK_OK);
    done = written = 0;
    size_t calls = 0;
    for (rthstrack_status status = RTHSTRACK_NO_ROOM; status == RTHSTRACK_NO_ROOM; calls++) {
        size_t n_taken, n_readings;
        status = rthstrack_monitor_process(other, target + done * N, measured + done * N, N_SAMPLES - done,
                                           by_blocks + written, N + calls % 2, &n_taken, &n_readings);
        CHECK(status == RTHSTRACK_OK || status == RTHSTRACK_NO_ROOM);
        CHECK(n_readings == N);
        done += n_taken;
        written += n_readings;
        if (calls > N_SAMPLES) {
            break;
        }
    }
    CHECK(done == N_SAMPLES && written == n && memcmp(by_steps, by_blocks, n * sizeof by_steps[0]) == 0);
    rthstrack_monitor_destroy(one);
    rthstrack_monitor_destroy(other);
}

static void without_room_the_sample_is_not_taken(void) {
    double x[2] = {1.0, 2.0};
    rthstrack_reading readings[2];
    size_t n_readings = 9, n_taken = 9;
    rthstrack_monitor_config config = small();
    config.n_actuators = 2;
    rthstrack_monitor *monitor = create(config);
    CHECK(rthstrack_monitor_step(monitor, x, x, readings, 1, &n_readings) == RTHSTRACK_NO_ROOM);
    CHECK(n_readings == 0 && rthstrack_monitor_samples_until_reading(monitor) == 128);
    CHECK(rthstrack_monitor_step(monitor, x, x, readings, 2, &n_readings) == RTHSTRACK_OK);
    CHECK(rthstrack_monitor_samples_until_reading(monitor) == 127);
    CHECK(rthstrack_monitor_process(monitor, x, x, SIZE_MAX, readings, 2, &n_taken, &n_readings)
          == RTHSTRACK_BAD_LENGTH);
    CHECK(rthstrack_monitor_process(monitor, x, x, SIZE_MAX / 16, readings, 2, &n_taken, &n_readings)
          == RTHSTRACK_BAD_LENGTH);
    CHECK(n_taken == 0 && n_readings == 0 && rthstrack_monitor_samples_until_reading(monitor) == 127);
    rthstrack_monitor_destroy(monitor);
}

static void what_is_no_number_leaves_no_trace(void) {
    static double target[N_SAMPLES], measured[N_SAMPLES];
    static rthstrack_reading clean[ROOM], broken[ROOM];
    static const double odd[] = {NAN, INFINITY, -INFINITY};
    signals(target, measured, N_SAMPLES, 1);
    for (int estimator = 0; estimator < 3; estimator++) {
        rthstrack_monitor_config config = small();
        config.estimator = estimator;
        rthstrack_monitor *one = create(config), *other = create(config);
        size_t n = stepped(one, target, measured, N_SAMPLES, clean, ROOM);
        double *signal = estimator == 1 ? target : measured, held = signal[200];
        signal[200] = odd[estimator];
        CHECK(stepped(other, target, measured, N_SAMPLES, broken, ROOM) == n);
        signal[200] = held;
        size_t invalid = 0;
        for (size_t i = 0; i < n; i++) {
            if (!broken[i].valid) {
                CHECK(broken[i].reason == RTHSTRACK_REASON_NOT_FINITE && isnan(broken[i].delay_s));
                CHECK(broken[i].index >= 200);
                invalid++;
            } else if (estimator == RTHSTRACK_ESTIMATOR_FEI || broken[i].index < 200 || i + 1 == n) {
                CHECK(memcmp(&clean[i], &broken[i], sizeof clean[i]) == 0);
            } else {
                /* The others see less of what came before the window. */
                CHECK(fabs(clean[i].amplitude - broken[i].amplitude) < 0.01);
            }
        }
        CHECK(invalid >= 128 / 8 && invalid <= 128 / 8 + 1);
        rthstrack_monitor_destroy(one);
        rthstrack_monitor_destroy(other);
    }
}

static void after_a_restart_nothing_is_remembered(void) {
    static double target[N_SAMPLES], measured[N_SAMPLES];
    static rthstrack_reading first[ROOM], second[ROOM];
    signals(target, measured, N_SAMPLES, 1);
    rthstrack_monitor *monitor = create(small());
    size_t n = stepped(monitor, target, measured, N_SAMPLES, first, ROOM);
    CHECK(stepped(monitor, measured, target, 77, second, ROOM) > 0);
    CHECK(rthstrack_monitor_restart(monitor, 5) == RTHSTRACK_OK);
    CHECK(rthstrack_monitor_restart(monitor, 0) == RTHSTRACK_OK);
    CHECK(rthstrack_monitor_samples_until_reading(monitor) == 128);
    CHECK(stepped(monitor, target, measured, N_SAMPLES, second, ROOM) == n);
    CHECK(memcmp(first, second, n * sizeof first[0]) == 0);
    /* The index may be any, and goes round. */
    CHECK(rthstrack_monitor_restart(monitor, UINT64_MAX - 126) == RTHSTRACK_OK);
    CHECK(stepped(monitor, target, measured, N_SAMPLES, second, ROOM) == n);
    CHECK(second[0].index == 0 && second[1].index == 8 && second[1].delay_s == first[1].delay_s);
    rthstrack_monitor_destroy(monitor);
}

static void the_actuator_follows_late(void) {
    rthstrack_actuator *actuator = NULL;
    double displacement = -1.0, force = -1.0;
    CHECK(rthstrack_actuator_create(-3.0, &actuator, message, sizeof message) == RTHSTRACK_BAD_SETTING);
    CHECK(actuator == NULL && strstr(message, "rate_hz") != NULL);
    CHECK(rthstrack_actuator_create(1024.0, &actuator, message, sizeof message) == RTHSTRACK_OK);
    CHECK(rthstrack_actuator_step(actuator, NAN, &displacement, &force) == RTHSTRACK_NOT_FINITE);
    CHECK(rthstrack_actuator_step(actuator, INFINITY, &displacement, &force) == RTHSTRACK_NOT_FINITE);
    CHECK(displacement == -1.0 && force == -1.0);
    CHECK(rthstrack_actuator_step(actuator, 1e-3, &displacement, &force) == RTHSTRACK_OK);
    CHECK(displacement == 0.0 && force == 0.0);
    for (int i = 0; i < 10; i++) {
        CHECK(rthstrack_actuator_step(actuator, 1e-3, &displacement, NULL) == RTHSTRACK_OK);
    }
    CHECK(displacement > 0.0 && displacement < 0.5e-3);
    for (int i = 0; i < 2000; i++) {
        CHECK(rthstrack_actuator_step(actuator, 1e-3, NULL, &force) == RTHSTRACK_OK);
    }
    CHECK(rthstrack_actuator_step(actuator, 1e-3, &displacement, &force) == RTHSTRACK_OK);
    /* At rest: y = f / k and q = a3 f, b2 q = a1b0 (g u - y). */
    double stiffness = 1.19e6, y = 1.0261 * 1e-3 / (1.0 + 9.9976e4 * 3.3 * stiffness / 2.1283e13);
    CHECK(fabs(displacement - y) < 1e-9 && fabs(force - stiffness * y) < 1e-3);
    rthstrack_actuator_destroy(actuator);
}

/* Everything but create and destroy, with every estimator, P above 1, and samples that are no numbers. */
static void nothing_but_create_and_destroy_uses_the_heap(void) {
    static double target[N_SAMPLES], measured[N_SAMPLES];
    static rthstrack_reading readings[ROOM];
    signals(target, measured, N_SAMPLES, 1);
    measured[150] = NAN;
    size_t total = 0;
    for (int estimator = 0; estimator < 3; estimator++) {
        rthstrack_monitor_config config = small();
        config.estimator = estimator;
        config.data_decimation = estimator == 1 ? 1 : 2;
        config.window = estimator;
        config.detrend = RTHSTRACK_DETREND_LINEAR;
        size_t at_first = heap_calls;
        rthstrack_monitor *monitor = create(config);
        rthstrack_actuator *actuator;
        CHECK(rthstrack_actuator_create(128.0, &actuator, message, sizeof message) == RTHSTRACK_OK);
        size_t before = heap_calls, n_taken, n_readings;
        total += before - at_first;
        stepped(monitor, target, measured, N_SAMPLES, readings, ROOM);
        rthstrack_monitor_restart(monitor, 3);
        CHECK(rthstrack_monitor_process(monitor, target, measured, N_SAMPLES, readings, ROOM, &n_taken, &n_readings)
              == RTHSTRACK_OK);
        rthstrack_monitor_step(monitor, target, measured, readings, 0, &n_readings);
        rthstrack_monitor_step(monitor, NULL, measured, readings, 1, &n_readings);
        rthstrack_monitor_readings_in(monitor, 500);
        rthstrack_monitor_samples_until_reading(monitor);
        rthstrack_monitor_latency_s(monitor);
        rthstrack_status_text(RTHSTRACK_NO_ROOM);
        rthstrack_reason_text(readings[0].reason);
        for (int i = 0; i < N_SAMPLES; i++) {
            double y, f;
            CHECK(rthstrack_actuator_step(actuator, 1e-3 * target[i], &y, &f) == RTHSTRACK_OK);
        }
        CHECK(heap_calls == before);
        rthstrack_monitor_destroy(monitor);
        rthstrack_actuator_destroy(actuator);
    }
#ifdef COUNT_HEAP
    CHECK(total > 30);
    printf("heap calls of three monitors and actuators: %zu, all of them in create\n", total);
#else
    CHECK(total == 0);
#endif
}

int main(void) {
    versions_fit();
    every_number_has_a_text();
    null_pointers_are_refused();
    another_interface_is_refused();
    bad_settings_are_refused_in_one_line_that_names_them();
    gain_and_delay_are_those_of_the_signals();
    blocks_give_the_bits_of_steps();
    without_room_the_sample_is_not_taken();
    what_is_no_number_leaves_no_trace();
    after_a_restart_nothing_is_remembered();
    the_actuator_follows_late();
    nothing_but_create_and_destroy_uses_the_heap();
    if (failures > 0) {
        printf("%d failed\n", failures);
        return 1;
    }
    puts("all as promised");
    return 0;
}
